// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/io/format.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"

// Formats of files that are not graphs, found by the file's ending, with options behind the name:
// "plan.png:resolution=0.05".
namespace cairn {

/// A file and the options of its format.
struct NamedFile {
  std::filesystem::path file;
  OptionValues options;
};

/// What stands behind the last ':' is options if it holds '=', unless there is a file of the whole
/// name.
inline NamedFile parse_named_file(std::string_view name) {
  const std::size_t colon = name.rfind(':');
  std::error_code ignored;
  if (colon == std::string_view::npos || name.find('=', colon) == std::string_view::npos ||
      std::filesystem::exists(std::filesystem::path(name), ignored))
    return {std::filesystem::path(name), {}};
  const std::string options = "file" + std::string(name.substr(colon));
  return {std::filesystem::path(name.substr(0, colon)), parse_component(options).values};
}

struct FormatOfEnding {
  std::string name;  ///< of the format, empty: none
  std::vector<std::string> endings;
  std::optional<Error> broken;  ///< a plugin's, which is no reason not to use another
};

template <class Format>
FormatOfEnding format_of_ending(const std::string& wanted, Registry& registry) {
  FormatOfEnding found;
  for (const std::string& name : registry.names(Format::kKind)) {
    try {
      for (const std::string& known : registry.make<Format>(name)->extensions()) {
        if (known == wanted && found.name.empty()) found.name = name;
        found.endings.push_back(known);
      }
    } catch (const Error& error) {
      if (!found.broken) found.broken = error;
    }
  }
  return found;
}

/// "no plugin of formats is on offer", and where plugins were found and looked for; `what`: of
/// files that hold this ("grids"), else of graphs.
CAIRN_API std::string no_plugin_of_formats(const Registry& registry, std::string_view what = {});

/// What is wrong with a file that no format goes by.
inline std::string no_format_text(std::string_view name, const std::filesystem::path& file,
                                  std::string_view what, const std::vector<std::string>& endings,
                                  const Registry& registry) {
  if (endings.empty()) return std::string(name) + ": " + no_plugin_of_formats(registry, what);
  std::string text =
      file.string() + ": no format of " + std::string(what) + " goes by that ending; on offer: ";
  for (const std::string& ending : endings)
    text += (&ending == &endings.front() ? "." : ", .") + ending;
  return text;
}

/// Calls `use` with the format of a named file and the file. `what` is in such a file ("grids").
template <class Format, class Use>
auto with_format(std::string_view name, std::string_view what, Registry& registry, const Use& use) {
  NamedFile named = parse_named_file(name);
  const auto found = format_of_ending<Format>(file_ending(named.file), registry);
  if (found.name.empty() && found.broken) throw Error(*found.broken);
  if (found.name.empty())
    throw Error(ErrorCode::usage, no_format_text(name, named.file, what, found.endings, registry));
  const auto format = registry.make<Format>(ComponentSpec{found.name, std::move(named.options)});
  return call_plugin([&] { return "format '" + found.name + "' of " + std::string(what); },
                     [&] { return use(*format, named.file); });
}

}  // namespace cairn
