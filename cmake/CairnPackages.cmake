# SPDX-License-Identifier: BSD-3-Clause
# Debian packages by CPack, one per component of CairnInstall.cmake (docs/install.md): `cpack` in a build of the preset
# package, or ./dev package. What libraries a package needs, dpkg-shlibdeps finds out; packages of cairn need one another
# in exactly this version, because the fingerprint of the headers would refuse any other.

set(CAIRN_MAINTAINER "The cairn authors <cairn@cairn.invalid>" CACHE STRING "The maintainer that the packages name")
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME cairn)
set(CPACK_PACKAGE_VENDOR "The cairn authors")
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # each package has its own
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
set(CPACK_DEBIAN_PACKAGE_MAINTAINER "${CAIRN_MAINTAINER}")
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${CAIRN_LIBRARY_FOLDER})
# Folders that CMake makes as it installs, whatever the umask of the user.
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
    OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)

set(control_folder ${PROJECT_BINARY_DIR}/debian)
set(libraries_package libcairn${CAIRN_SOVERSION})

# cairn_package(component name section description [DEPENDS component…] [COMMENT text] [PAGE]): the package of a
# component, with its copyright and the changes. COMMENT: of the copyright; PAGE: the package has the page of apps/report.
function(cairn_package component name section description)
  cmake_parse_arguments(PARSE_ARGV 4 arg "PAGE" "COMMENT" "DEPENDS")
  string(TOUPPER ${component} COMPONENT)
  set(CPACK_DEBIAN_${COMPONENT}_PACKAGE_NAME ${name} PARENT_SCOPE)
  set(CPACK_DEBIAN_${COMPONENT}_PACKAGE_SECTION ${section} PARENT_SCOPE)
  set(CPACK_DEBIAN_${COMPONENT}_DESCRIPTION "${description}" PARENT_SCOPE)
  set(CPACK_COMPONENT_${COMPONENT}_DEPENDS ${arg_DEPENDS} PARENT_SCOPE)
  set(CPACK_COMPONENTS_ALL ${CPACK_COMPONENTS_ALL} ${component} PARENT_SCOPE)

  set(comment "")
  if(arg_COMMENT)
    set(comment "Comment:\n ${arg_COMMENT}\n")
  endif()
  set(page "")
  if(arg_PAGE)
    file(READ ${PROJECT_SOURCE_DIR}/cmake/debian_copyright_page.txt page)
  endif()
  file(READ ${PROJECT_SOURCE_DIR}/LICENSE licence)
  string(REGEX REPLACE "^BSD 3-Clause License\n\nCopyright[^\n]*\n\n" "" licence "${licence}")
  string(STRIP "${licence}" licence)
  string(REPLACE "\n\n" "\n.\n" licence "${licence}")
  string(REPLACE "\n" "\n " licence "${licence}")
  configure_file(${PROJECT_SOURCE_DIR}/cmake/debian_copyright.in ${control_folder}/${name}/copyright @ONLY)
  install(FILES ${control_folder}/${name}/copyright ${control_folder}/changelog.gz ${control_folder}/changelog.Debian.gz
          DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${name} COMPONENT ${component})
endfunction()

# cairn_python_sources(component name): the compiled form of a package's Python sources comes and goes with it.
function(cairn_python_sources component name)
  string(TOUPPER ${component} COMPONENT)
  set(scripts ${control_folder}/${name}/postinst ${control_folder}/${name}/prerm)
  file(WRITE ${control_folder}/${name}/postinst
       "#!/bin/sh\nset -e\nif [ \"$1\" = configure ] && command -v py3compile >/dev/null; then\n  py3compile -p ${name}\nfi\n")
  file(WRITE ${control_folder}/${name}/prerm
       "#!/bin/sh\nset -e\nif command -v py3clean >/dev/null; then\n  py3clean -p ${name}\nfi\n")
  file(CHMOD ${scripts} PERMISSIONS
       OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
  set(CPACK_DEBIAN_${COMPONENT}_PACKAGE_CONTROL_EXTRA ${scripts} PARENT_SCOPE)
endfunction()

# The changes of cairn, and, as Debian asks for it, of the packages.
find_program(CAIRN_GZIP gzip REQUIRED)
file(MAKE_DIRECTORY ${control_folder})
configure_file(${PROJECT_SOURCE_DIR}/CHANGELOG.md ${control_folder}/changelog COPYONLY)
string(TIMESTAMP now "%a, %d %b %Y %H:%M:%S +0000" UTC)  # that of SOURCE_DATE_EPOCH, if there is one
file(WRITE ${control_folder}/changelog.Debian "cairn (${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE}) unstable; urgency=medium

  * Packages of cairn ${PROJECT_VERSION}; changelog.gz has its changes.

 -- ${CAIRN_MAINTAINER}  ${now}\n")
execute_process(COMMAND ${CAIRN_GZIP} -9nf ${control_folder}/changelog ${control_folder}/changelog.Debian
                COMMAND_ERROR_IS_FATAL ANY)

set(what_it_is "cairn is a back end for graph SLAM, simultaneous localization and mapping:
it estimates poses and landmarks from the measurements of a robot. Solvers,
variable and factor types, and file formats are plugins, chosen by name.")

cairn_package(libraries ${libraries_package} libs "back end for graph SLAM, shared libraries
${what_it_is}

This package has the libraries. Most of what is chosen by name is in the
package cairn.")
set(this_version "(= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})")
set(CPACK_DEBIAN_LIBRARIES_PACKAGE_RECOMMENDS "cairn ${this_version}")
set(libraries_control ${control_folder}/${libraries_package})
file(WRITE ${libraries_control}/triggers "activate-noawait ldconfig\n")
get_property(layers GLOBAL PROPERTY CAIRN_LAYERS)
list(TRANSFORM layers PREPEND libcairn_)
set(shlibs "")
foreach(library IN ITEMS libcairn libcairn_c LISTS layers)
  string(APPEND shlibs "${library} ${CAIRN_SOVERSION} ${libraries_package} ${this_version}\n")
endforeach()
file(WRITE ${libraries_control}/shlibs "${shlibs}")
set(CPACK_DEBIAN_LIBRARIES_PACKAGE_CONTROL_EXTRA ${libraries_control}/triggers ${libraries_control}/shlibs)
# CPack's scripts call ldconfig besides.
file(WRITE ${libraries_control}/overrides "${libraries_package}: maintscript-calls-ldconfig *\n")
install(FILES ${libraries_control}/overrides DESTINATION ${CMAKE_INSTALL_DATADIR}/lintian/overrides
        RENAME ${libraries_package} COMPONENT libraries)

cairn_package(development libcairn-dev libdevel "back end for graph SLAM, development files
${what_it_is}

This package has the headers, and what CMake and pkg-config need, for programs
that use cairn and for plugins."
  DEPENDS libraries)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "libeigen3-dev (>= 3.4)")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS "cairn, cmake (>= 3.25), pkg-config")

cairn_package(program cairn science "back end for graph SLAM whose solvers are plugins chosen by name
${what_it_is}

This package has the program cairn, which optimises, compares, sparsifies and
shows graphs, and the plugins that need only small libraries under permissive
licences."
  DEPENDS libraries PAGE)

if(TARGET cairn_python)
  string(REGEX MATCH "^([0-9]+)\\.([0-9]+)" this_python ${CAIRN_PYTHON_VERSION})
  math(EXPR next_minor "${CMAKE_MATCH_2} + 1")
  cairn_package(python python3-cairn python "back end for graph SLAM, Python package
${what_it_is}

This package has the module cairn for Python 3, with graphs and covariances as
NumPy arrays."
    DEPENDS libraries program)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= ${this_python}~), python3 (<< ${CMAKE_MATCH_1}.${next_minor}), python3-numpy")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS python3-matplotlib)
  cairn_python_sources(python python3-cairn)
  if(CAIRN_ROS)
    cairn_package(ros cairn-ros science "back end for graph SLAM, node for ROS
${what_it_is}

This package has a node for ROS 1 that estimates the trajectory of a robot from
odometry and loop closures."
      DEPENDS libraries python)
    set(CPACK_DEBIAN_ROS_PACKAGE_SHLIBDEPS OFF)
    set(CPACK_DEBIAN_ROS_PACKAGE_DEPENDS
        "python3, python3-numpy, python3-rospy, python3-geometry-msgs, python3-nav-msgs, python3-tf2-msgs, python3-visualization-msgs")
    set(CPACK_DEBIAN_ROS_PACKAGE_RECOMMENDS python3-roslaunch)
    cairn_python_sources(ros cairn-ros)
  endif()
endif()

# Plugins that need large libraries, or some under the GPL: each package says what it has, and under which licence that is
# as a whole.
get_property(plugin_packages GLOBAL PROPERTY CAIRN_PLUGIN_PACKAGES)
list(REMOVE_DUPLICATES plugin_packages)
foreach(package IN LISTS plugin_packages)
  get_property(plugins GLOBAL PROPERTY CAIRN_PLUGINS_OF_${package})
  set(summaries "")
  set(licences "")
  set(names "")
  foreach(plugin IN LISTS plugins)
    get_target_property(summary ${plugin} CAIRN_PLUGIN_DESCRIPTION)
    get_target_property(licence ${plugin} CAIRN_PLUGIN_LICENCE)
    string(REPLACE cairn_plugin_ "" plugin_name ${plugin})
    list(APPEND names ${plugin_name})
    string(APPEND summaries "\n\nPlugin ${plugin_name}, ${licence}:\n${summary}.")
    string(APPEND licences " ${plugin_name}, with the libraries that it is linked with: ${licence}.\n")
  endforeach()
  list(JOIN names ", " names)
  string(STRIP "${licences}" licences)
  cairn_package(plugin_${package} cairn-plugin-${package} science "back end for graph SLAM, plugins: ${names}
${what_it_is}${summaries}"
    DEPENDS libraries program COMMENT "${licences}")
endforeach()
# What each of them offers, for the message where it is not installed (core/src/plugin/plugin_loader.hpp).
get_property(packaged_names GLOBAL PROPERTY CAIRN_PACKAGED_NAMES)
file(WRITE ${control_folder}/packages.txt "${packaged_names}")
install(FILES ${control_folder}/packages.txt DESTINATION ${CMAKE_INSTALL_LIBDIR}/cairn COMPONENT program)
list(TRANSFORM plugin_packages PREPEND cairn-plugin-)
set(recommended ${plugin_packages})  # what commands need: cairn explore, cairn plot
list(FILTER recommended INCLUDE REGEX "-exploration$")
list(FILTER plugin_packages EXCLUDE REGEX "-exploration$")
if(TARGET cairn_python)
  list(APPEND recommended python3-cairn python3-matplotlib)
endif()
list(JOIN recommended ", " CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS)
list(JOIN plugin_packages ", " CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS)
if(TARGET cairn_plugin_cholmod)  # Debian's plain BLAS is several times slower
  set(CPACK_DEBIAN_PLUGIN_CHOLMOD_PACKAGE_RECOMMENDS libopenblas0-pthread)
endif()
if(TARGET cairn_plugin_spqr)
  set(CPACK_DEBIAN_PLUGIN_SPQR_PACKAGE_RECOMMENDS libopenblas0-pthread)
endif()

include(CPack)
