// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/io/format.hpp"

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/io/format_by_ending.hpp"
#include "cairn/io/trajectory_writer.hpp"
#include "cairn/plugin/plugin_search.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/text/spelling.hpp"

namespace cairn {

Format::~Format() = default;
namespace {

struct NamedFormat {
  std::string name;
  std::unique_ptr<Format> format;
};

/// All formats on offer. One plugin that is broken must not keep a user from a file that another
/// one reads: its error goes to `problems`, to be told if nothing else fits.
std::vector<NamedFormat> all_formats(Registry& registry, std::vector<std::string>& problems) {
  std::vector<NamedFormat> formats;
  for (const std::string& name : registry.names(Format::kKind)) {
    try {
      formats.push_back({name, registry.make<Format>(name)});
    } catch (const Error& error) {
      problems.push_back(error.what());
    }
  }
  return formats;
}

bool has_ending(const Format& format, const std::string& wanted) {
  const std::vector<std::string> endings = format.extensions();
  return std::find(endings.begin(), endings.end(), wanted) != endings.end();
}

/// The first characters of a text, made fit for a message.
std::string beginning(std::string_view text) {
  std::string shown;
  for (const char c : text.substr(0, 40)) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte == '\n') break;
    shown += byte >= 0x20 && byte < 0x7f ? std::string(1, c) : fmt::format("\\x{:02x}", byte);
  }
  return shown;
}

/// Nothing fits. Where formats could not be loaded, that is the likely cause and decides the code.
Error nothing_fits(ErrorCode code, std::string message, const std::vector<std::string>& problems) {
  if (problems.empty()) return {code, message};
  message += "\n  and " + problems.front();
  if (problems.size() > 1) {
    message += fmt::format("\n  and {} more formats could not be loaded", problems.size() - 1);
  }
  return {ErrorCode::plugin, message};
}

/// "formats on offer: a, b", or that there is nothing.
std::string on_offer(const char* what, const std::vector<std::string>& names,
                     const Registry& registry) {
  return names.empty() ? no_plugin_of_formats(registry)
                       : fmt::format("{} on offer: {}", what, fmt::join(names, ", "));
}

/// Chooses by content; where two are equally sure, the file's ending decides. Those with the ending
/// are asked first: if one is certain, no other can be chosen, and none looks at the text again.
NamedFormat detect(const std::filesystem::path& file, std::string_view text, Registry& registry) {
  constexpr std::pair<int, bool> kCertain{100, true};
  std::vector<std::string> problems;
  std::vector<NamedFormat> formats = all_formats(registry, problems);
  const std::string wanted = file_ending(file);
  std::stable_partition(formats.begin(), formats.end(), [&](const NamedFormat& candidate) {
    return has_ending(*candidate.format, wanted);
  });
  std::pair<int, bool> best{0, false};
  NamedFormat* chosen = nullptr;
  for (NamedFormat& candidate : formats) {
    if (!candidate.format->can_read()) continue;
    const std::pair<int, bool> score{candidate.format->detect(text),
                                     has_ending(*candidate.format, wanted)};
    if (score.first > 0 && score > best) {
      best = score;
      chosen = &candidate;
    }
    if (best >= kCertain) break;
  }
  if (!chosen) {
    std::vector<std::string> readers;
    for (const NamedFormat& f : formats) {
      if (f.format->can_read()) readers.push_back(f.name);
    }
    throw nothing_fits(
        ErrorCode::input,
        fmt::format("{}: no format knows this content, which begins with '{}'; {}", file.string(),
                    beginning(text), on_offer("formats", readers, registry)),
        problems);
  }
  return std::move(*chosen);
}

NamedFormat writer_by_ending(const std::filesystem::path& file, Registry& registry) {
  std::vector<std::string> problems;
  const std::string wanted = file_ending(file);
  std::vector<std::string> endings;
  for (NamedFormat& candidate : all_formats(registry, problems)) {
    if (!candidate.format->can_write()) continue;
    if (has_ending(*candidate.format, wanted)) return std::move(candidate);
    for (const std::string& e : candidate.format->extensions()) endings.push_back("." + e);
  }
  const std::string found =
      file == "-"
          ? "standard output has no ending that determines the format"
          : (wanted.empty() ? "the name has no ending that determines the format"
                            : fmt::format("no format that writes has the ending '.{}'", wanted));
  throw nothing_fits(ErrorCode::usage,
                     fmt::format("{}: {}; {}; or name the format", file.string(), found,
                                 on_offer("endings", endings, registry)),
                     problems);
}

/// "g2o" of "g2o:option=1".
std::string bare_name(std::string_view spec) { return std::string(spec.substr(0, spec.find(':'))); }

}  // namespace

std::string no_plugin_of_formats(const Registry& registry, std::string_view what) {
  std::vector<std::string> folders;
  for (const Offer& offer : registry.offers()) {
    const std::string folder = offer.file.parent_path().string();
    if (!folder.empty() && std::ranges::find(folders, folder) == folders.end())
      folders.push_back(folder);
  }
  const char* path = std::getenv("CAIRN_PLUGIN_PATH");
  const std::string set = path && *path != '\0' ? fmt::format("'{}'", path) : "not set";
  // Without any plugin the registry's problems say where it looked.
  std::string text = fmt::format(
      "no plugin of formats{}{} is on offer; {}", what.empty() ? "" : " of ", what,
      folders.empty()
          ? fmt::format("no plugin at all was found (CAIRN_PLUGIN_PATH is {})", set)
          : fmt::format(
                "plugins of other kinds were found in {}. Plugins are looked for in the folders of "
                "CAIRN_PLUGIN_PATH, which is {}, in $XDG_DATA_HOME/cairn/plugins or "
                "~/.local/share/cairn/plugins, and in the folder cairn beside the library "
                "libcairn.so",
                fmt::join(folders, ", "), set));
  for (const PluginProblem& problem : registry.problems())
    text += fmt::format("\n  note: {}", problem.message);
  return text;
}

std::string file_ending(std::filesystem::path file) {
  if (file.extension() == ".gz") file.replace_extension();
  std::string text = file.extension().string();
  if (!text.empty()) text.erase(0, 1);
  std::transform(text.begin(), text.end(), text.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return text;
}

Graph read_graph(const std::filesystem::path& file, Registry& registry, const ReadOptions& options,
                 ReadReport& report, std::string_view format) {
  const std::string text = read_file(file);
  if (text.find_first_not_of(" \t\r\n") == std::string::npos) {
    throw Error(ErrorCode::input, fmt::format("{}: the file is empty", file.string()));
  }
  NamedFormat reader = format.empty()
                           ? detect(file, text, registry)
                           : NamedFormat{bare_name(format), registry.make<Format>(format)};
  if (!reader.format->can_read()) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: format '{}' only writes", file.string(), reader.name));
  }
  report.format = reader.name;
  return call_plugin(
      [&] { return fmt::format("{}: format '{}'", file.string(), reader.name); },
      [&] { return reader.format->read(text, file.string(), registry, options, report); });
}

Graph read_graph(const std::filesystem::path& file, Registry& registry) {
  ReadReport report;
  return read_graph(file, registry, ReadOptions{}, report);
}

namespace {

NamedFormat writer_of(const std::filesystem::path& file, Registry& registry,
                      std::string_view format) {
  NamedFormat writer = format.empty()
                           ? writer_by_ending(file, registry)
                           : NamedFormat{bare_name(format), registry.make<Format>(format)};
  if (!writer.format->can_write()) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: format '{}' only reads", file.string(), writer.name));
  }
  return writer;
}

}  // namespace

void write_graph(const Graph& graph, const std::filesystem::path& file, Registry& registry,
                 std::string_view format, std::span<const double> stamps) {
  const NamedFormat writer = writer_of(file, registry, format);
  write_file(file, call_plugin([&] { return fmt::format("format '{}'", writer.name); },
                               [&] {
                                 auto* poses = query<TrajectoryWriter>(*writer.format);
                                 return poses ? poses->write_poses(graph, stamps)
                                              : writer.format->write(graph);
                               }));
}

bool writes_poses_alone(const std::filesystem::path& file, Registry& registry,
                        std::string_view format) {
  return query<TrajectoryWriter>(*writer_of(file, registry, format).format) != nullptr;
}

}  // namespace cairn
