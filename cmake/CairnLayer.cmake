# SPDX-License-Identifier: BSD-3-Clause
#
# cairn_add_layer(NAME name FOLDERS folder… SOURCES file.cpp … [LIBRARIES target…] [PRIVATE target…])
#
# Builds a shared library of cairn, libcairn_<name>.so, the target cairn::<name>: a layer whose headers others include.
# Each of the FOLDERS has its public headers in include/ and its private ones in src/; LIBRARIES are the layers below, and
# what its headers include; PRIVATE is what its sources alone need. The layer has an ABI tag, the hash of its public
# headers, in the header cairn/abi/<name>.hpp and in the library itself: a plugin is bound to the layers that it is linked
# with, whose tags its manifest compares when it is loaded, and to no other.
#
# cairn_part_settings(target): how cairn's own libraries and plugins are compiled.
# cairn_command_settings(target): the same of commands, and of what they share.

include(GNUInstallDirs)
include(${CMAKE_CURRENT_LIST_DIR}/CairnAbiTag.cmake)

function(cairn_part_settings target)
  if(COMMAND cairn_settings)  # cairn's own build
    cairn_settings(${target})
    return()
  endif()
  target_compile_features(${target} PRIVATE cxx_std_20)
  target_compile_options(${target} PRIVATE -Wall -Wextra -fvisibility=hidden -fvisibility-inlines-hidden -fno-math-errno
                         $<$<CXX_COMPILER_ID:GNU>:-fno-gnu-unique>)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON)
endfunction()

function(cairn_command_settings target)
  # What takes time lies in the libraries and plugins, whose flags are untouched: it is worth no more than -Og here.
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-Og>)
  if(COMMAND cairn_tell_of_sanitizers)
    cairn_tell_of_sanitizers(${target})
  endif()
endfunction()

# cairn_layers_of(RESULT target…): the layers that targets are linked with, each once.
function(cairn_layers_of result)
  set(layers "")
  foreach(target IN LISTS ARGN)
    if(NOT TARGET ${target})
      continue()
    endif()
    get_target_property(of_target ${target} CAIRN_LAYERS)
    if(NOT of_target)
      set(of_target "")
      get_target_property(type ${target} TYPE)
      get_target_property(below ${target} INTERFACE_LINK_LIBRARIES)
      if(below AND type STREQUAL "STATIC_LIBRARY")
        cairn_layers_of(of_target ${below})
      endif()
    endif()
    list(APPEND layers ${of_target})
  endforeach()
  list(REMOVE_DUPLICATES layers)
  set(${result} "${layers}" PARENT_SCOPE)
endfunction()

function(cairn_add_layer)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "NAME" "FOLDERS;SOURCES;LIBRARIES;PRIVATE")
  set(target cairn_${arg_NAME})
  set(public "")
  foreach(folder IN LISTS arg_FOLDERS)
    list(APPEND public ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/include)
  endforeach()
  cairn_abi_tag(tag ${public})
  set(generated ${CMAKE_CURRENT_BINARY_DIR}/${arg_NAME}_abi)
  file(CONFIGURE OUTPUT ${generated}/include/cairn/abi/${arg_NAME}.hpp @ONLY CONTENT
"// SPDX-License-Identifier: BSD-3-Clause
// Written by CMake (CairnLayer.cmake): the hash of the public headers of the library cairn::@arg_NAME@.
#pragma once

#include \"cairn/runtime/api.hpp\"

#define CAIRN_ABI_TAG_@arg_NAME@ \"@tag@\"
/// The same, as the library was compiled.
extern \"C\" CAIRN_API const char cairn_abi_@arg_NAME@[];
")
  file(CONFIGURE OUTPUT ${generated}/abi.cpp @ONLY CONTENT
"#include \"cairn/abi/@arg_NAME@.hpp\"

const char cairn_abi_@arg_NAME@[] = CAIRN_ABI_TAG_@arg_NAME@;
")
  cairn_layers_of(below ${arg_LIBRARIES})
  set(layers ${below} ${arg_NAME})
  add_library(${target} SHARED ${arg_SOURCES} ${generated}/abi.cpp)
  add_library(cairn::${arg_NAME} ALIAS ${target})
  cairn_part_settings(${target})
  target_include_directories(${target} PUBLIC $<BUILD_INTERFACE:${generated}/include>
                             $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  foreach(folder IN LISTS arg_FOLDERS)
    target_include_directories(${target}
      PUBLIC $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/${folder}/include>
      PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/src)
  endforeach()
  target_link_libraries(${target} PUBLIC ${arg_LIBRARIES} PRIVATE ${arg_PRIVATE})
  set_target_properties(${target} PROPERTIES
    EXPORT_NAME ${arg_NAME} CAIRN_LAYERS "${layers}" EXPORT_PROPERTIES CAIRN_LAYERS
    VERSION ${CAIRN_VERSION} SOVERSION ${CAIRN_SOVERSION} INSTALL_RPATH "$ORIGIN" CAIRN_PUBLIC_FOLDERS "${public}" CAIRN_ABI_TAG ${tag})
  if(COMMAND cairn_settings)
    set_target_properties(${target} PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${CAIRN_LIBRARY_FOLDER})
  else()  # the libraries of cairn are where they were when it was built
    set_target_properties(${target} PROPERTIES INSTALL_RPATH_USE_LINK_PATH ON)
  endif()
  set_property(GLOBAL APPEND PROPERTY CAIRN_LAYERS ${arg_NAME})

  # Installed with a file that find_package(cairn) reads, after those of the layers below.
  set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/cairn)
  install(TARGETS ${target} EXPORT cairn-${arg_NAME}-targets
          LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT libraries NAMELINK_COMPONENT development)
  foreach(folder IN LISTS public ITEMS ${generated}/include)
    install(DIRECTORY ${folder}/cairn DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development
            FILES_MATCHING PATTERN "*.hpp")
  endforeach()
  install(EXPORT cairn-${arg_NAME}-targets NAMESPACE cairn:: DESTINATION ${package_folder} COMPONENT development)
  set(includes "")
  foreach(layer IN LISTS below)
    string(APPEND includes "include(\${CMAKE_CURRENT_LIST_DIR}/cairn-layer-${layer}.cmake)\n")
  endforeach()
  file(CONFIGURE OUTPUT ${generated}/cairn-layer-${arg_NAME}.cmake @ONLY CONTENT
"# SPDX-License-Identifier: BSD-3-Clause
# The library cairn::@arg_NAME@, after those that it needs.
include_guard()
@includes@include(\${CMAKE_CURRENT_LIST_DIR}/cairn-@arg_NAME@-targets.cmake)
")
  install(FILES ${generated}/cairn-layer-${arg_NAME}.cmake DESTINATION ${package_folder} COMPONENT development)
  if(COMMAND cairn_settings AND NOT arg_NAME STREQUAL "slam")  # which cairn.pc has
    list(REMOVE_ITEM below slam)
    list(TRANSFORM below PREPEND cairn_)
    list(JOIN below " " requires)
    file(CONFIGURE OUTPUT ${generated}/cairn_${arg_NAME}.pc @ONLY CONTENT
"prefix=\${pcfiledir}/@CAIRN_PREFIX_FROM_PC@
libdir=\${prefix}/@CMAKE_INSTALL_LIBDIR@

Name: cairn_@arg_NAME@
Description: libcairn_@arg_NAME@ of cairn, a back end for graph SLAM
Version: @CAIRN_VERSION@
Requires: cairn @requires@
Libs: -L\${libdir} -lcairn_@arg_NAME@
")
    install(FILES ${generated}/cairn_${arg_NAME}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
  endif()
endfunction()
