# SPDX-License-Identifier: BSD-3-Clause
# Settings of cairn's own targets. Nothing here touches a project that includes cairn.

if(PROJECT_IS_TOP_LEVEL AND NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
endif()

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE_PROGRAM})
endif()

# One tree like the installed one: bin/cairn, lib/libcairn.so, lib/cairn/<plugin>.so
include(GNUInstallDirs)
set(CAIRN_BINARY_FOLDER ${CMAKE_BINARY_DIR}/bin)
set(CAIRN_LIBRARY_FOLDER ${CMAKE_BINARY_DIR}/lib)
set(CAIRN_PLUGIN_FOLDER ${CAIRN_LIBRARY_FOLDER}/cairn)
# Files of pkg-config find the prefix from where they are.
file(RELATIVE_PATH CAIRN_PREFIX_FROM_PC /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
string(REGEX REPLACE "/$" "" CAIRN_PREFIX_FROM_PC ${CAIRN_PREFIX_FROM_PC})

# What every target of cairn is compiled with, plugins of third parties not included. No -march: one binary
# serves all machines, and hot kernels choose their instruction set when they are loaded.
add_library(cairn_settings INTERFACE)
target_compile_features(cairn_settings INTERFACE cxx_std_20)
target_compile_options(cairn_settings INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor
                       -fvisibility=hidden -fvisibility-inlines-hidden -fno-math-errno
                       $<$<CXX_COMPILER_ID:GNU>:-fno-gnu-unique> $<$<BOOL:${CAIRN_WERROR}>:-Werror>)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  target_compile_options(cairn_settings INTERFACE -Wno-restrict)  # it warns of its own std::string (GCC bug 105651)
endif()
if(CAIRN_HARDEN AND NOT CAIRN_SANITIZE AND NOT CAIRN_COVERAGE)
  # Against inputs that nobody trusts: SECURITY.md. Executables are position independent by default on Debian.
  target_compile_options(cairn_settings INTERFACE -fstack-protector-strong
                         $<$<CXX_COMPILER_ID:GNU>:-fstack-clash-protection>
                         $<$<NOT:$<CONFIG:Debug>>:-U_FORTIFY_SOURCE> $<$<NOT:$<CONFIG:Debug>>:-D_FORTIFY_SOURCE=2>)
  target_link_options(cairn_settings INTERFACE -Wl,-z,relro,-z,now,-z,noexecstack)
endif()
if(CAIRN_COVERAGE)
  target_compile_options(cairn_settings INTERFACE --coverage -fprofile-update=atomic)
  target_compile_definitions(cairn_settings INTERFACE CAIRN_COVERAGE)
  target_link_options(cairn_settings INTERFACE --coverage)
endif()
if(CAIRN_SANITIZE)
  # GCC warns of variables that its own instrumentation seems to leave open, in std::regex for one.
  target_compile_options(cairn_settings INTERFACE -fsanitize=${CAIRN_SANITIZE} -fno-omit-frame-pointer
                         $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
  target_link_options(cairn_settings INTERFACE -fsanitize=${CAIRN_SANITIZE})
  if(CAIRN_FUZZ)
    # A finding ends the program. Comparisons are not traced, which would take a third of the time of numerical code;
    # the words of the formats are in dictionaries.
    target_compile_options(cairn_settings INTERFACE -fno-sanitize-recover=all -fno-sanitize-coverage=trace-cmp
                           -fsanitize-coverage-ignorelist=${PROJECT_SOURCE_DIR}/tests/fuzz/targets/not_counted.txt)
  endif()
endif()

function(cairn_settings target)
  target_link_libraries(${target} PRIVATE $<BUILD_INTERFACE:cairn_settings>)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON)
endfunction()

# cairn_kernels(target): adds kernels_portable.cpp and, on x86-64, kernels_avx2.cpp and kernels_avx512.cpp of this folder, each for
# its instruction set; which of them runs is chosen at run time (cairn/kernel_choice.hpp).
function(cairn_kernels target)
  target_sources(${target} PRIVATE kernels_portable.cpp)
  set_source_files_properties(kernels_portable.cpp PROPERTIES COMPILE_OPTIONS "-O3;-Wno-psabi")
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    target_sources(${target} PRIVATE kernels_avx2.cpp kernels_avx512.cpp)
    target_compile_definitions(${target} PRIVATE CAIRN_X86_KERNELS)
    set_source_files_properties(kernels_avx2.cpp PROPERTIES COMPILE_OPTIONS "-O3;-mavx2;-mfma")
    set_source_files_properties(kernels_avx512.cpp PROPERTIES COMPILE_OPTIONS
      "-O3;-mavx512f;-mavx512dq;-mavx512vl;-mavx2;-mfma;-mprefer-vector-width=512")
  endif()
  if(CAIRN_SANITIZE)  # clang warns of loops that it does not unroll as asked, once they are instrumented
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:Clang>:-Wno-pass-failed>)
  endif()
endfunction()

# cairn_tell_of_sanitizers(target): defines CAIRN_SANITIZED where one is in use, for what has to differ then.
function(cairn_tell_of_sanitizers target)
  if(CAIRN_SANITIZE)
    target_compile_definitions(${target} PRIVATE CAIRN_SANITIZED)
  endif()
endfunction()
