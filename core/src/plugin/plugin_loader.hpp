// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/plugin/plugin.hpp"
#include "cairn/plugin/plugin_search.hpp"

namespace cairn {

/// What a sidecar file says of its plugin, without opening the shared object.
struct Sidecar {
  std::string name, version, licence, description;
  std::filesystem::path library;
  struct Offered {
    std::string kind, name, summary;
  };
  std::vector<Offered> offers;
};

/// Reads one sidecar file. Throws `Error` (plugin) saying what is missing in it.
Sidecar read_sidecar(const std::filesystem::path& file);

/// The folder of plugins beside the core library.
std::filesystem::path default_folder();

/// The folders of a search, in order, that exist. What is refused (a folder that others may write
/// to, one named in the environment that does not exist) is added to `problems`.
std::vector<std::filesystem::path> plugin_folders(const PluginSearch& search,
                                                  std::vector<PluginProblem>& problems);

/// The Debian package of cairn's with the plugin that offers this name; empty: none is known.
/// Debian packages list them in `packages.txt` beside their plugins (cmake/CairnPackages.cmake).
std::string debian_package_with(std::string_view kind, std::string_view name);

/// Loads a shared object (now, locally, for the rest of the process) and returns its manifest.
/// Throws `Error` (plugin): the dynamic linker's own words if it cannot be loaded, no entry point,
/// another fingerprint; `std::bad_alloc` where the linker was short of memory.
const PluginManifest& load_plugin(const std::filesystem::path& library);

/// The fingerprint of the core itself.
const char* core_fingerprint();

}  // namespace cairn
