# SPDX-License-Identifier: BSD-3-Clause
# What `cmake --install` puts down beside the plugins and the program, which install themselves:
# the core with its headers, and a package that makes find_package(cairn) and cairn_add_plugin()
# work in another project. The components, of which each becomes a Debian package (CairnPackages.cmake): program,
# libraries, development, python, and plugin_<package> for what cairn_add_plugin(PACKAGE) names.
include(CMakePackageConfigHelpers)

set(CAIRN_PACKAGE_FOLDER ${CMAKE_INSTALL_LIBDIR}/cmake/cairn)

install(TARGETS cairn_core cairn_lie EXPORT cairn-targets
        LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT libraries NAMELINK_COMPONENT development)
foreach(folder IN LISTS CAIRN_PUBLIC_FOLDERS ITEMS ${CAIRN_GENERATED_FOLDER})  # those of layers install their own
  install(DIRECTORY ${folder}/cairn DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development
          FILES_MATCHING PATTERN "*.hpp")
endforeach()
install(EXPORT cairn-targets NAMESPACE cairn:: DESTINATION ${CAIRN_PACKAGE_FOLDER} COMPONENT development)
if(TARGET cairn_app)  # installs itself; where the library is from there is known here
  set_target_properties(cairn_app PROPERTIES INSTALL_RPATH "$ORIGIN/../${CMAKE_INSTALL_LIBDIR}")
endif()

configure_package_config_file(cmake/cairnConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/cairnConfig.cmake
                              INSTALL_DESTINATION ${CAIRN_PACKAGE_FOLDER})
# Before 1.0 a minor version may change the plugin boundary.
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/cairnConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/cairnConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/cairnConfigVersion.cmake
              cmake/CairnAddPlugin.cmake cmake/CairnAbiTag.cmake cmake/CairnLayer.cmake cmake/CairnSubject.cmake cmake/FindImgproc.cmake
              cmake/plugin_manifest.cpp.in cmake/plugin_sidecar.json.in
        DESTINATION ${CAIRN_PACKAGE_FOLDER} COMPONENT development)

# The same for pkg-config. Its prefix is found from where the file is.
configure_file(cmake/cairn.pc.in ${CMAKE_CURRENT_BINARY_DIR}/cairn.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/cairn.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
if(TARGET cairn_c)
  configure_file(cmake/cairn_c.pc.in ${CMAKE_CURRENT_BINARY_DIR}/cairn_c.pc @ONLY)
  install(FILES ${CMAKE_CURRENT_BINARY_DIR}/cairn_c.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
endif()

if(NOT CAIRN_PACKAGES)  # which have it in the form that Debian asks for
  install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)
endif()
