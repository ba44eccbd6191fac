// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/picture_files.hpp"

#include <algorithm>
#include <filesystem>

#include <fmt/core.h>

#include "cairn/io/format.hpp"
#include "cairn/plugin/plugin_search.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"

namespace cairn::app {

namespace {

/// What is wrong with plugins says, where none was found, where they were looked for.
Error with_problems(std::string text, Session& session) {
  for (const PluginProblem& problem : session.registry().problems())
    text += fmt::format("\n  note: {}", problem.message);
  return {ErrorCode::plugin, text};
}

}  // namespace

std::string default_picture(const std::string& file, const std::string& ending) {
  if (file == "-" || file.starts_with('@')) return "cairn." + ending;
  std::filesystem::path name = std::filesystem::path(file).filename();
  if (name.extension() == ".gz") name.replace_extension();
  return name.replace_extension(ending).string();
}

std::string picture_format(const std::string& file, Session& session) {
  std::string ending = file_ending(file);
  const std::vector<std::string> names = session.registry().names(Picture::kKind);
  if (names.empty()) {
    throw with_problems(
        "no plugin draws reports or plots: neither 'plot' nor 'report', the page, was found",
        session);
  }
  if (std::find(names.begin(), names.end(), ending) == names.end()) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: nothing draws files of that name; endings on offer: .{}", file,
                            joined(names, ", .")));
  }
  return ending;
}

void check_makes_pages(const std::string& remedy, Session& session) {
  if (session.registry().has(Picture::kKind, "html")) return;
  if (session.registry().offers().empty())
    throw with_problems("no plugin makes reports: none was found", session);
  throw Error(ErrorCode::plugin,
              "no plugin makes reports here: cairn was built without apps/report/dist and without "
              "npm; " +
                  remedy);
}

void check_picture(const std::string& file, Session& session) {
  session.registry().make<Picture>(ComponentSpec{picture_format(file, session), {}});
  check_file(file, session);
}

std::string draw_picture(const Album& album, const ComponentSpec& picture, Session& session) {
  return call_plugin([&] { return fmt::format("picture '{}'", picture.name); },
                     [&] { return session.registry().make<Picture>(picture)->draw(album); });
}

std::size_t write_picture(const Album& album, const ComponentSpec& picture, const std::string& file,
                          Session& session) {
  const std::string bytes = draw_picture(album, picture, session);
  write_file(file, bytes);
  return bytes.size();
}

}  // namespace cairn::app
