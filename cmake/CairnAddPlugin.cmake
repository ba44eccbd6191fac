# SPDX-License-Identifier: BSD-3-Clause
#
# cairn_add_plugin(NAME name
#                  DESCRIPTION "one line"
#                  OFFERS "kind|name|one line" …
#                  SOURCES file.cpp …
#                  [VERSION 1.0.0] [LICENCE MIT] [LIBRARIES target …] [FOLDER folder] [PACKAGE package])
#
# Builds a plugin: the shared object name.so with cairn's entry point, and beside it name.json, which repeats
# the manifest so that listing plugins opens none of them. One of the sources defines
#
#     void cairn_register(cairn::Registrar& registrar);   // in the global namespace
#
# which adds exactly what OFFERS names. The target is cairn_plugin_<name>. In cairn's own build the plugin goes
# to lib/cairn and is installed there, and PACKAGE says that it needs large libraries, or some under the GPL: then it is
# in the Debian package cairn-plugin-PACKAGE instead of in that of the program (CairnPackages.cmake), and in the
# component plugin_PACKAGE of `cmake --install`. In another project
# - it is built in the folder of the target, or in FOLDER (which CAIRN_PLUGIN_PATH may name);
# - `cmake --install` puts it in CAIRN_PLUGIN_INSTALL_FOLDER, by default the folder of the user's plugins, which cairn
#   searches: $XDG_DATA_HOME/cairn/plugins, or ~/.local/share/cairn/plugins; of a subject (CairnSubject.cmake) in
#   lib/cairn below the prefix;
# - where no build type is given, it is Release: without optimisation a plugin is tens of times slower;
# - without LICENCE, the licence is "unstated".

include(${CMAKE_CURRENT_LIST_DIR}/CairnLayer.cmake)
set(CAIRN_PLUGIN_TEMPLATE_FOLDER ${CMAKE_CURRENT_LIST_DIR})

# Settings of another project's plugins.
macro(cairn_third_party_defaults)
  set(user_data "$ENV{XDG_DATA_HOME}")
  if(NOT IS_ABSOLUTE "${user_data}")
    set(user_data "$ENV{HOME}/.local/share")
  endif()
  if(NOT IS_ABSOLUTE "${user_data}")
    set(user_data share)  # below the prefix
  endif()
  set(plugin_folder "${user_data}/cairn/plugins")
  if(DEFINED CAIRN_SUBJECT)  # a library for everybody, and what goes with it: beside cairn's own
    set(plugin_folder "${CMAKE_INSTALL_LIBDIR}/cairn")
  endif()
  set(CAIRN_PLUGIN_INSTALL_FOLDER "${plugin_folder}" CACHE STRING
      "Where cmake --install puts plugins of cairn; relative to the prefix if it is not absolute")
endmacro()

function(cairn_add_plugin)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "NAME;DESCRIPTION;VERSION;LICENCE;FOLDER;PACKAGE" "OFFERS;SOURCES;LIBRARIES")
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "cairn_add_plugin: unknown argument ${arg_UNPARSED_ARGUMENTS}")
  endif()
  foreach(needed NAME DESCRIPTION OFFERS SOURCES)
    if(NOT arg_${needed})
      message(FATAL_ERROR "cairn_add_plugin(NAME ${arg_NAME}): ${needed} is missing")
    endif()
  endforeach()
  if(NOT arg_VERSION)
    set(arg_VERSION ${PROJECT_VERSION})
  endif()
  if(NOT arg_VERSION)
    set(arg_VERSION 0.0.0)
  endif()
  if(COMMAND cairn_settings)  # cairn's own build
    set(default_licence BSD-3-Clause)
  else()
    set(default_licence unstated)
    cairn_third_party_defaults()
  endif()
  if(NOT arg_LICENCE)
    set(arg_LICENCE ${default_licence})
  endif()

  # The texts go into C++ and JSON string literals, which escape alike.
  foreach(text IN ITEMS DESCRIPTION VERSION LICENCE)
    string(REPLACE "\\" "\\\\" arg_${text} "${arg_${text}}")
    string(REPLACE "\"" "\\\"" arg_${text} "${arg_${text}}")
  endforeach()

  set(cpp_offers "")
  set(json_offers "")
  foreach(offer IN LISTS arg_OFFERS)
    string(REPLACE "\\;" ";" offer "${offer}")
    string(REPLACE "\\" "\\\\" offer "${offer}")
    string(REPLACE "\"" "\\\"" offer "${offer}")
    if(NOT offer MATCHES "^([a-z_]+)\\|([^|]+)\\|([^|]+)$")
      message(FATAL_ERROR "cairn_add_plugin(NAME ${arg_NAME}): an offer is \"kind|name|one line\", not \"${offer}\"")
    endif()
    if(arg_PACKAGE)
      set_property(GLOBAL APPEND_STRING PROPERTY CAIRN_PACKAGED_NAMES
                   "${CMAKE_MATCH_1} ${CMAKE_MATCH_2} cairn-plugin-${arg_PACKAGE}\n")
    endif()
    string(APPEND cpp_offers "    {\"${CMAKE_MATCH_1}\", \"${CMAKE_MATCH_2}\", \"${CMAKE_MATCH_3}\"},\n")
    if(json_offers)
      string(APPEND json_offers ",\n")
    endif()
    string(APPEND json_offers
           "    {\"kind\": \"${CMAKE_MATCH_1}\", \"name\": \"${CMAKE_MATCH_2}\", \"summary\": \"${CMAKE_MATCH_3}\"}")
  endforeach()

  cairn_layers_of(layers ${arg_LIBRARIES})
  set(cpp_layer_headers "")
  set(cpp_layers "")
  foreach(layer IN LISTS layers)
    string(APPEND cpp_layer_headers "#include \"cairn/abi/${layer}.hpp\"\n")
    string(APPEND cpp_layers "    {\"${layer}\", CAIRN_ABI_TAG_${layer}, cairn_abi_${layer}},\n")
  endforeach()
  set(target cairn_plugin_${arg_NAME})
  set(manifest ${CMAKE_CURRENT_BINARY_DIR}/${arg_NAME}_manifest.cpp)
  configure_file(${CAIRN_PLUGIN_TEMPLATE_FOLDER}/plugin_manifest.cpp.in ${manifest} @ONLY)
  add_library(${target} MODULE ${arg_SOURCES} ${manifest})
  target_link_libraries(${target} PRIVATE cairn::core cairn::lie ${arg_LIBRARIES})
  # A symbol that g++ marks unique would be shared between plugins that must not see each other.
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fno-gnu-unique>)
  set(folder ${CMAKE_CURRENT_BINARY_DIR})
  set(install_folder ${CAIRN_PLUGIN_INSTALL_FOLDER})
  if(COMMAND cairn_settings)
    cairn_settings(${target})
    set(folder ${CAIRN_PLUGIN_FOLDER})
    set(install_folder ${CMAKE_INSTALL_LIBDIR}/cairn)
    set_target_properties(${target} PROPERTIES INSTALL_RPATH "$ORIGIN/..")
  else()  # the libraries of cairn, and its own, are where they were when it was built
    set_target_properties(${target} PROPERTIES INSTALL_RPATH_USE_LINK_PATH ON)
  endif()
  if(arg_FOLDER)
    set(folder ${arg_FOLDER})
  endif()
  set_target_properties(${target} PROPERTIES
    OUTPUT_NAME ${arg_NAME} PREFIX "" SUFFIX ".so" LIBRARY_OUTPUT_DIRECTORY ${folder}
    CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
  configure_file(${CAIRN_PLUGIN_TEMPLATE_FOLDER}/plugin_sidecar.json.in ${folder}/${arg_NAME}.json @ONLY)
  if(NOT (arg_FOLDER AND COMMAND cairn_settings))  # that is one of cairn's tests
    if(TARGET cairn_plugins)  # all of cairn's own
      add_dependencies(cairn_plugins ${target})
      set_property(GLOBAL APPEND PROPERTY CAIRN_PLUGIN_TARGETS ${target})
    endif()
    set(component Unspecified)
    if(COMMAND cairn_settings AND NOT arg_PACKAGE)
      set(component program)
    elseif(arg_PACKAGE)
      set(component plugin_${arg_PACKAGE})
      set_property(GLOBAL APPEND PROPERTY CAIRN_PLUGIN_PACKAGES ${arg_PACKAGE})
      set_property(GLOBAL APPEND PROPERTY CAIRN_PLUGINS_OF_${arg_PACKAGE} ${target})
      set_target_properties(${target} PROPERTIES
        CAIRN_PLUGIN_DESCRIPTION "${arg_DESCRIPTION}" CAIRN_PLUGIN_LICENCE "${arg_LICENCE}")
    endif()
    install(TARGETS ${target} LIBRARY DESTINATION ${install_folder} COMPONENT ${component})
    install(FILES ${folder}/${arg_NAME}.json DESTINATION ${install_folder} COMPONENT ${component})
  endif()
endfunction()

# cairn_add_plugin_tests(NAME name [SOURCES file.cpp …] [ARGUMENTS argument …])
#
# Tests of a plugin that cairn_add_plugin(NAME name) builds, for CTest, after enable_testing():
# - name.check runs the conformance suite over it in a process of its own, `cairn plugins --check` with the ARGUMENTS, such
#   as --seconds 120 or --types slam3d:metric=g2o. It needs the program, which is looked for beside the library and on the
#   PATH; CAIRN_PROGRAM names another. Without one there is a line when configuring, and no such test.
# - name.test, with SOURCES: a program of these, name_test, with cairn::slam and what the plugin is linked with, which is given
#   the plugin's path.
function(cairn_add_plugin_tests)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "NAME" "SOURCES;ARGUMENTS")
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "cairn_add_plugin_tests: unknown argument ${arg_UNPARSED_ARGUMENTS}")
  endif()
  if(NOT TARGET cairn_plugin_${arg_NAME})
    message(FATAL_ERROR "cairn_add_plugin_tests(NAME ${arg_NAME}): there is no such plugin in this project; "
                        "cairn_add_plugin(NAME ${arg_NAME} …) comes first")
  endif()
  find_program(CAIRN_PROGRAM cairn HINTS ${cairn_DIR}/../../../bin ${cairn_DIR}/../../../../bin
               DOC "The program cairn, whose `plugins --check` tests plugins")
  if(CAIRN_PROGRAM)
    add_test(NAME ${arg_NAME}.check
             COMMAND ${CAIRN_PROGRAM} plugins ${arg_ARGUMENTS} --check $<TARGET_FILE:cairn_plugin_${arg_NAME}>)
  else()
    message(STATUS "cairn: no test ${arg_NAME}.check: the program cairn is not installed; CAIRN_PROGRAM names it")
  endif()
  if(arg_SOURCES)
    add_executable(${arg_NAME}_test ${arg_SOURCES})
    get_target_property(libraries cairn_plugin_${arg_NAME} LINK_LIBRARIES)
    target_link_libraries(${arg_NAME}_test PRIVATE cairn::slam ${libraries})
    add_test(NAME ${arg_NAME}.test COMMAND ${arg_NAME}_test $<TARGET_FILE:cairn_plugin_${arg_NAME}>)
  endif()
endfunction()
