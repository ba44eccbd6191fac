# SPDX-License-Identifier: BSD-3-Clause
#
# cairn_abi_tag(RESULT folder…)
#
# Sets RESULT to 16 hexadecimal digits computed from all headers (*.hpp) below the folders: from each one's name, relative
# to its folder, and its contents. Any edit of a public header gives another tag, so a plugin compiled with other headers
# than the core is recognised. In a project, an edit of one of the headers configures again.

function(cairn_abi_tag result)
  set(watch "")
  if(NOT CMAKE_SCRIPT_MODE_FILE)
    set(watch CONFIGURE_DEPENDS)
  endif()
  set(entries "")
  foreach(folder IN LISTS ARGN)
    file(GLOB_RECURSE headers LIST_DIRECTORIES false RELATIVE ${folder} ${watch} ${folder}/*.hpp)
    foreach(header IN LISTS headers)
      file(SHA256 ${folder}/${header} hash)
      list(APPEND entries "${header} ${hash}")
      if(watch)
        set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${folder}/${header})
      endif()
    endforeach()
  endforeach()
  list(SORT entries)
  string(SHA256 hash "${entries}")
  string(SUBSTRING ${hash} 0 16 tag)
  set(${result} ${tag} PARENT_SCOPE)
endfunction()
