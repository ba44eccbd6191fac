// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/runtime/api.hpp"

namespace cairn {

class Registrar;

/// One thing that a plugin offers.
struct PluginOffer {
  const char* kind;     ///< "linear_solver", "optimizer", "types", "variable", "factor", …
  const char* name;     ///< the name to ask for
  const char* summary;  ///< one line
};

/// A library of cairn that a plugin was compiled with, beside the core.
struct PluginLayer {
  const char* name;   ///< "slam", "compact", …; null ends the list
  const char* built;  ///< the hash of that library's headers when the plugin was compiled
  const char* here;   ///< that of the library which the plugin has in this process
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
  bool optimized;  ///< whether its code was compiled with optimisation; read after `fingerprint`
  const PluginLayer* layers;  ///< up to one without a name; read after `fingerprint`
};

#define CAIRN_STRINGIFY_(x) #x
#define CAIRN_STRINGIFY(x) CAIRN_STRINGIFY_(x)

/// The name of the entry point, and its type.
#define CAIRN_PLUGIN_ENTRY cairn_plugin_v1
using PluginEntry = const PluginManifest*();

}  // namespace cairn
