// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

// Where a `Registry` looks for plugins, and what it finds there: for programs that list or choose
// plugins. A header of its own, since no plugin needs it.

namespace cairn {

/// A name on offer, as `cairn plugins` lists it; known from the sidecar file, without loading
/// anything.
struct Offer {
  std::string kind;
  std::string name;
  std::string summary;
  std::string plugin;          ///< name of the plugin; "this program" if it was added in-process
  std::filesystem::path file;  ///< shared object; empty if it was added in-process
  std::string licence;
  std::string version;
};

/// A defect of the plugins found that matters only when the plugin is asked for: a sidecar that
/// cannot be read, a folder that is refused, two plugins with one name.
struct PluginProblem {
  std::filesystem::path where;
  std::string message;
};

/// Where plugins are looked for, in this order.
struct PluginSearch {
  std::vector<std::filesystem::path> files;  ///< shared objects named by the user (`--plugin FILE`)
  bool environment = true;                   ///< folders of CAIRN_PLUGIN_PATH, separated by ':'
  bool user_folder = true;     ///< $XDG_DATA_HOME/cairn/plugins, or ~/.local/share/cairn/plugins
  bool default_folder = true;  ///< the folder `cairn` beside the core library
  std::vector<std::filesystem::path> folders = {};  ///< named by the program; after `files`
};

}  // namespace cairn
