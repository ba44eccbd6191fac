// SPDX-License-Identifier: BSD-3-Clause
// Included by the loader and by the manifest that cairn_add_plugin() writes, and by nothing else:
// the tag below changes with every edit of a public header.
#pragma once

#include <string>  // the standard library's macros

// Eigen's macros alone: its matrices would be most of the time in which a manifest compiles. Only
// where these are known to be two headers that stand for themselves.
#if __has_include(<Eigen/src/Core/util/ConfigureVectorization.h>) && !__has_include(<Eigen/Version>)
#include <Eigen/src/Core/util/Macros.h>

#include <Eigen/src/Core/util/ConfigureVectorization.h>
#else
#include <Eigen/Core>
#endif

#include "cairn/plugin/abi_tag.hpp"
#include "cairn/plugin/plugin.hpp"
#include "cairn/runtime/version.hpp"

#if defined(__clang__)
#define CAIRN_COMPILER_ "clang " CAIRN_STRINGIFY(__clang_major__)
#else
#define CAIRN_COMPILER_ "gcc " CAIRN_STRINGIFY(__GNUC__)
#endif
#if defined(_GLIBCXX_USE_CXX11_ABI)
#define CAIRN_STDLIB_ "libstdc++ cxx11-abi=" CAIRN_STRINGIFY(_GLIBCXX_USE_CXX11_ABI)
#else
#define CAIRN_STDLIB_ "libc++"
#endif
#if defined(_GLIBCXX_DEBUG)
#define CAIRN_STDLIB_DEBUG_ "1"
#else
#define CAIRN_STDLIB_DEBUG_ "0"
#endif
// In unoptimised code newer libraries switch their assertions on by themselves. They change no
// layout, so that alone must not refuse a plugin.
#if defined(_GLIBCXX_ASSERTIONS) && defined(__OPTIMIZE__)
#define CAIRN_STDLIB_ASSERTIONS_ "1"
#else
#define CAIRN_STDLIB_ASSERTIONS_ "0"
#endif

/// Everything that must agree between core and plugin for their objects to be passed around: as one
/// string, `;`-separated, fixed when the plugin is compiled. (Values of macros, so that core and
/// plugin are compared as they were really compiled.) Of the compiler its name and major version
/// count; CAIRN_ABI_TAG is a hash of the core's public headers
/// (cmake/CairnAbiTag.cmake); libraries above the core are compared by `PluginManifest::layers`.
#define CAIRN_ABI_FINGERPRINT \
  "cairn " CAIRN_VERSION "; headers " CAIRN_ABI_TAG "; " CAIRN_COMPILER_ "; " CAIRN_STDLIB_        \
  " debug=" CAIRN_STDLIB_DEBUG_ " assertions=" CAIRN_STDLIB_ASSERTIONS_                            \
  "; Eigen " CAIRN_STRINGIFY(EIGEN_WORLD_VERSION) "." CAIRN_STRINGIFY(EIGEN_MAJOR_VERSION) "."     \
  CAIRN_STRINGIFY(EIGEN_MINOR_VERSION) " max-align=" CAIRN_STRINGIFY(EIGEN_MAX_ALIGN_BYTES)        \
  " max-static-align=" CAIRN_STRINGIFY(EIGEN_MAX_STATIC_ALIGN_BYTES)

/// Whether the including file is compiled with optimisation: `PluginManifest::optimized`. It is no
/// part of the fingerprint, since optimised and unoptimised code may be mixed.
#if defined(__OPTIMIZE__)
#define CAIRN_OPTIMIZED true
#else
#define CAIRN_OPTIMIZED false
#endif
