# SPDX-License-Identifier: BSD-3-Clause
#
# A subject is a folder below plugins/ that the rest of cairn builds and passes its tests without: a library, components,
# commands, a part of the Python package. What it depends on is in its file subject.cmake:
#
#     set(CAIRN_SUBJECT compact)                  # its name, which is that of its folder
#     set(CAIRN_SUBJECT_NEEDS sparsify online)    # the subjects without which it is not built
#
# Its CMakeLists.txt begins with
#
#     cmake_minimum_required(VERSION 3.25)
#     include(subject.cmake)
#     if(NOT COMMAND cairn_settings)
#       project(cairn_compact VERSION 0.1.0 LANGUAGES CXX)
#       find_package(cairn 0.1 REQUIRED COMPONENTS ${CAIRN_SUBJECT_NEEDS} program)
#     endif()
#
# so that it is built in cairn's tree, and alone against an installed cairn.

# cairn_add_subjects(folder…): adds those whose needs are there, in the order of these; of each other one there is a line.
function(cairn_add_subjects)
  set(left "")
  foreach(folder IN LISTS ARGN)
    if(NOT EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/subject.cmake)
      continue()
    endif()
    include(${CMAKE_CURRENT_SOURCE_DIR}/${folder}/subject.cmake)
    if(NOT CAIRN_SUBJECT STREQUAL folder)
      message(FATAL_ERROR "${folder}/subject.cmake: the subject is called '${CAIRN_SUBJECT}', not as its folder")
    endif()
    set(needs_${folder} ${CAIRN_SUBJECT_NEEDS})
    list(APPEND left ${folder})
  endforeach()
  set(added "")
  set(before "")
  while(NOT "${left}" STREQUAL "${before}")
    set(before ${left})
    foreach(folder IN LISTS before)
      set(missing ${needs_${folder}})
      list(REMOVE_ITEM missing ${added} "")
      if(NOT missing)
        add_subdirectory(${folder})
        list(APPEND added ${folder})
        list(REMOVE_ITEM left ${folder})
      endif()
    endforeach()
  endwhile()
  foreach(folder IN LISTS left)
    set(missing ${needs_${folder}})
    list(REMOVE_ITEM missing ${added})
    list(JOIN missing ", " missing)
    message(STATUS "cairn: leaving out ${folder}, which needs ${missing}")
  endforeach()
  set(CAIRN_SUBJECTS ${added} CACHE INTERNAL "The subjects that are built, each after those that it needs")
endfunction()

# cairn_add_python(SOURCES file.cpp… BINDS name… LIBRARIES target…): a subject's part of the Python module, whose functions
# bind_<name>(py::module_&) are called in this order, after those of the subjects that it needs. It is built in cairn's own
# tree alone, in which the module is.
function(cairn_add_python)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "" "SOURCES;BINDS;LIBRARIES")
  list(TRANSFORM arg_SOURCES PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/)
  set_property(GLOBAL APPEND PROPERTY CAIRN_PYTHON_SOURCES ${arg_SOURCES})
  set_property(GLOBAL APPEND PROPERTY CAIRN_PYTHON_BINDS ${arg_BINDS})
  set_property(GLOBAL APPEND PROPERTY CAIRN_PYTHON_LIBRARIES ${arg_LIBRARIES})
endfunction()
