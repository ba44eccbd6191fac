# SPDX-License-Identifier: BSD-3-Clause
# OpenCV's core and imgproc: the target cairn_imgproc. Debian's packages of these two have no CMake files.
find_path(IMGPROC_INCLUDE_FOLDER opencv2/imgproc.hpp PATH_SUFFIXES opencv4)
find_library(IMGPROC_LIBRARY opencv_imgproc)
find_library(IMGPROC_CORE_LIBRARY opencv_core)
mark_as_advanced(IMGPROC_INCLUDE_FOLDER IMGPROC_LIBRARY IMGPROC_CORE_LIBRARY)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(Imgproc REQUIRED_VARS IMGPROC_LIBRARY IMGPROC_CORE_LIBRARY IMGPROC_INCLUDE_FOLDER)
if(Imgproc_FOUND AND NOT TARGET cairn_imgproc)
  add_library(cairn_imgproc INTERFACE)
  target_include_directories(cairn_imgproc SYSTEM INTERFACE ${IMGPROC_INCLUDE_FOLDER})
  target_link_libraries(cairn_imgproc INTERFACE ${IMGPROC_LIBRARY} ${IMGPROC_CORE_LIBRARY})
endif()
