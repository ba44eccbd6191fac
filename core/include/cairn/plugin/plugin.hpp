// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <Eigen/Core>

#include "cairn/runtime/api.hpp"
#include "cairn/runtime/version.hpp"

namespace cairn {

class Registrar;

/// One thing that a plugin offers.
struct PluginOffer {
  const char* kind;     ///< "linear_solver", "optimizer", "types", "variable", "factor", …
  const char* name;     ///< the name to ask for
  const char* summary;  ///< one line
};

/// What a plugin hands over from its one C entry point, `cairn_plugin_v1`. Plain data: it is read
/// before anything else of the plugin is trusted.
struct PluginManifest {
  const char* name;
  const char* version;
  const char* licence;
  const char* description;
  const PluginOffer* offers;
  int offer_count;
  const char* fingerprint;  ///< of the code of the plugin: see CAIRN_ABI_FINGERPRINT
  void (*register_plugin)(Registrar&);
};

#define CAIRN_STRINGIFY_(x) #x
#define CAIRN_STRINGIFY(x) CAIRN_STRINGIFY_(x)

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

/// Everything that must agree between core and plugin for their objects to be passed around: as one
/// string, `;`-separated, fixed when the plugin is compiled. (Values of macros, so that core and
/// plugin are compared as they were really compiled.) The compiler's name is in it, its major
/// version only for clang or gcc releases that changed nothing in the C++ ABI is not checked.
#define CAIRN_ABI_FINGERPRINT \
  "cairn abi " CAIRN_STRINGIFY(CAIRN_ABI_VERSION) "; " CAIRN_COMPILER_ "; " CAIRN_STDLIB_         \
  "; Eigen " CAIRN_STRINGIFY(EIGEN_WORLD_VERSION) "." CAIRN_STRINGIFY(EIGEN_MAJOR_VERSION) "."     \
  CAIRN_STRINGIFY(EIGEN_MINOR_VERSION) " max-align=" CAIRN_STRINGIFY(EIGEN_MAX_ALIGN_BYTES)        \
  " max-static-align=" CAIRN_STRINGIFY(EIGEN_MAX_STATIC_ALIGN_BYTES)

/// The name of the entry point, and its type.
#define CAIRN_PLUGIN_ENTRY cairn_plugin_v1
using PluginEntry = const PluginManifest*();

}  // namespace cairn
