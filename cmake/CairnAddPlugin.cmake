# SPDX-License-Identifier: BSD-3-Clause
#
# cairn_add_plugin(NAME name
#                  DESCRIPTION "one line"
#                  OFFERS "kind|name|one line" …
#                  SOURCES file.cpp …
#                  [VERSION 1.0.0] [LICENCE BSD-3-Clause] [LIBRARIES target …] [FOLDER folder])
#
# Builds a plugin: the shared object name.so with cairn's entry point, and beside it name.json, which repeats
# the manifest so that listing plugins opens none of them. One of the sources defines
#
#     void cairn_register(cairn::Registrar& registrar);   // in the global namespace
#
# which adds exactly what OFFERS names. The target is cairn_plugin_<name>. In cairn's own build the plugin goes
# to lib/cairn and is installed; in another project, to the folder of the target, or to FOLDER (put that on
# CAIRN_PLUGIN_PATH).

set(CAIRN_PLUGIN_TEMPLATE_FOLDER ${CMAKE_CURRENT_LIST_DIR})

function(cairn_add_plugin)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "NAME;DESCRIPTION;VERSION;LICENCE;FOLDER" "OFFERS;SOURCES;LIBRARIES")
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
  if(NOT arg_LICENCE)
    set(arg_LICENCE BSD-3-Clause)
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
    string(APPEND cpp_offers "    {\"${CMAKE_MATCH_1}\", \"${CMAKE_MATCH_2}\", \"${CMAKE_MATCH_3}\"},\n")
    if(json_offers)
      string(APPEND json_offers ",\n")
    endif()
    string(APPEND json_offers
           "    {\"kind\": \"${CMAKE_MATCH_1}\", \"name\": \"${CMAKE_MATCH_2}\", \"summary\": \"${CMAKE_MATCH_3}\"}")
  endforeach()

  set(target cairn_plugin_${arg_NAME})
  set(manifest ${CMAKE_CURRENT_BINARY_DIR}/${arg_NAME}_manifest.cpp)
  configure_file(${CAIRN_PLUGIN_TEMPLATE_FOLDER}/plugin_manifest.cpp.in ${manifest} @ONLY)
  add_library(${target} MODULE ${arg_SOURCES} ${manifest})
  target_link_libraries(${target} PRIVATE cairn::core ${arg_LIBRARIES})
  # A symbol that g++ marks unique would be shared between plugins that must not see each other.
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fno-gnu-unique>)
  if(COMMAND cairn_settings)  # cairn's own build
    cairn_settings(${target})
  endif()
  if(arg_FOLDER)
    set(folder ${arg_FOLDER})
  elseif(COMMAND cairn_settings)
    set(folder ${CAIRN_PLUGIN_FOLDER})
    install(TARGETS ${target} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/cairn)
    install(FILES ${folder}/${arg_NAME}.json DESTINATION ${CMAKE_INSTALL_LIBDIR}/cairn)
  else()
    set(folder ${CMAKE_CURRENT_BINARY_DIR})
  endif()
  set_target_properties(${target} PROPERTIES
    OUTPUT_NAME ${arg_NAME} PREFIX "" SUFFIX ".so" LIBRARY_OUTPUT_DIRECTORY ${folder}
    CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON INSTALL_RPATH "$ORIGIN/..")
  configure_file(${CAIRN_PLUGIN_TEMPLATE_FOLDER}/plugin_sidecar.json.in ${folder}/${arg_NAME}.json @ONLY)
endfunction()
