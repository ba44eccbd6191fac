// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/album.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/core.h>
#include <boost/json/parse.hpp>
#include <boost/json/serialize.hpp>

#include "cairn/plugin/registry.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/table.hpp"
#include "cairn/program/trajectory_axes.hpp"
#include "cairn/report/recording.hpp"
#include "cairn/report/run_report.hpp"
#include "cairn/report/scene_source.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/initial_guess.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

bool is_json(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  return first != std::string_view::npos && text[first] == '{';
}

/// Whether the text of a CSV file is a trajectory with time stamps, which formats of graphs read.
bool is_trajectory(std::string_view text, Registry& registry) {
  constexpr const char* kFormat = "euroc";
  return registry.has(Format::kKind, kFormat) && registry.make<Format>(kFormat)->detect(text) > 50;
}

/// A graph that a report names, if it can be read.
std::optional<Graph> load_named(const std::string& file, const AlbumOptions& options,
                                Session& session) {
  std::error_code error;
  const bool readable =
      file.starts_with('@') || (file != "-" && std::filesystem::is_regular_file(file, error));
  if (!readable) return std::nullopt;
  return load_graph(file, options.input, session).graph;
}

/// What a subject has for a recording that begins so; null: none has, or it is of an optimisation.
std::unique_ptr<SceneSource> source_of(std::string_view head, Registry& registry) {
  if (!is_recording(head)) return nullptr;
  for (const std::string& name : registry.names(SceneSource::kKind)) {
    auto source = registry.make<SceneSource>(name);
    if (source->knows(head)) return source;
  }
  return nullptr;
}

bool has_number(const NumberTable::Column& column) {
  return std::ranges::any_of(column.values, [](double value) { return std::isfinite(value); });
}

/// Without columns of text where the first is one, which would be the horizontal axis.
NumberTable numbers_only(NumberTable table, const AlbumOptions& options, Session& session) {
  if (!options.curves || has_number(table.columns.front())) return table;
  std::vector<std::string> left_out;
  for (const NumberTable::Column& column : table.columns) {
    if (!has_number(column)) left_out.push_back(column.name);
  }
  if (left_out.size() == table.columns.size()) return table;  // refused where it is drawn
  session.note(
      fmt::format("{}: without the columns that have no numbers, {}; --x COLUMN and --y "
                  "COLUMNS choose among the others",
                  table.name, joined(left_out, ", ")));
  std::erase_if(table.columns, [](const auto& column) { return !has_number(column); });
  return table;
}

/// Whether it is the JSON of `cairn explore`.
bool is_of_explore(const std::string& text) {
  json::error_code error;
  const json::value value = json::parse(text, error);
  if (error || !value.is_object()) return false;
  const json::value* command = value.get_object().if_contains("command");
  return command && *command == "explore";
}

auto report_of(const std::string& text, const std::string& file) {
  try {
    return read_report(text, file);
  } catch (const Error&) {
    if (!is_of_explore(text)) throw;
    throw Error(ErrorCode::input,
                fmt::format("{}: the JSON of cairn explore has nothing to draw: give the run that "
                            "--record FILE.jsonl has written, or plot the CSV of --steps or "
                            "--curves",
                            file));
  }
}

/// Trajectories lie over graphs by id; one without ids by its rows.
void note_rows(const LoadedGraph& loaded, const AlbumOptions& options, const Session& session) {
  const bool alone = options.files.size() == 1 && options.truth.empty();
  if (alone || !loaded.report.row_ids) return;
  session.note(fmt::format("{}: has no ids, so that over a graph its row k is pose k{}",
                           loaded.name, loaded.report.stamps.empty() ? "" : ", whatever its time"));
}

void add_file(const std::string& file, const std::string& name, const AlbumOptions& options,
              AlbumBuilder& builder, Session& session) {
  const bool named = file == "-" || file.starts_with('@');
  const std::string text = named ? std::string() : read_file(file);
  const bool is_table = is_csv(file) && !is_trajectory(text, session.registry());
  if (!named && (is_table || is_recording(text) || is_json(text))) session.files.add_input(file);
  if (is_table) {
    builder.add_table(numbers_only(read_number_table(text, file), options, session), name);
  } else if (const auto source = source_of(text, session.registry())) {
    source->add(
        file, name, text,
        {.whole = !options.curves || options.maps, .most_bytes = options.maps ? 0 : kMostOfAPage},
        builder);
  } else if (is_recording(text)) {
    Scene recording = read_recording(text, file);
    if (name != short_name(file)) recording.recordings.front().name = name;
    builder.add_recording(std::move(recording));
  } else if (is_json(text)) {
    builder.add_report(file, report_of(text, file));
  } else {
    LoadedGraph loaded = load_graph(file, options.input, session);
    show_in_robot_axes(loaded, options.axes, session);
    note_rows(loaded, options, session);
    builder.add_graph(file, name, std::move(loaded.graph));
  }
}

/// "2026-11-01T12:00:00Z"
std::string utc_now() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  return {text.data(), std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc)};
}

std::string title_of(const AlbumOptions& options) {
  if (!options.title.empty()) return options.title;
  const std::string first = short_name(options.files.front());
  return options.files.size() == 1 ? first
                                   : fmt::format("{} and {} more", first, options.files.size() - 1);
}

}  // namespace

bool is_csv(const std::string& file) { return file.ends_with(".csv") || file.ends_with(".csv.gz"); }

bool has_columns(const std::string& file, Registry& registry) {
  if (is_csv(file)) return true;
  std::error_code error;
  return std::filesystem::is_regular_file(file, error) && source_of(read_file(file), registry);
}

OptionFields<AlbumOptions> AlbumOptions::fields(const char* what) {
  using O = AlbumOptions;
  return OptionFields<O>()
      .text("files", &O::files, what)
      .positional()
      .placeholder("FILE")
      .or_generated_by({"generator"})
      .required()
      .text("name", &O::names, "what to call the first FILE, the second … [its name]")
      .text("truth", &O::truth, "the ground truth, by id; estimates are aligned as by evaluate")
      .placeholder("FILE")
      .choice("axes", &O::axes, {"robot", "camera"},
              "of trajectories, shown as a robot's: robot, camera [camera for KITTI]")
      .placeholder("AXES")
      .optional()
      .component("initial", &O::initial, {"initial_guess"},
                 "initial estimate to show too: kind initial_guess")
      .text("title", &O::title, "title [name of the first FILE]")
      .part(&O::input);
}

Album begin_album(const std::string& title, const std::string& command) {
  Album album;
  album.title = title;
  album.command = command;
  album.created = utc_now();
  json::object context;
  end_report(context);
  album.machine = json::serialize(context.at("machine"));
  album.build = json::serialize(context.at("build"));
  return album;
}

Album load_album(const AlbumOptions& options, const std::string& command, Session& session) {
  if (options.names.size() > options.files.size()) {
    throw Error(ErrorCode::usage,
                fmt::format("--name is given {} times for {}", options.names.size(),
                            plural(std::ssize(options.files), "file")));
  }
  AlbumBuilder builder([&](const std::string& file) { return load_named(file, options, session); },
                       [&](const std::string& sentence) { session.note(sentence); });
  if (options.apart) builder.keep_apart();
  builder.align_to_truth();
  for (std::size_t k = 0; k < options.files.size(); ++k) {
    const std::string& file = options.files[k];
    const std::string name = k < options.names.size() ? options.names[k] : short_name(file);
    add_file(file, name, options, builder, session);
  }
  if (!options.truth.empty()) {
    LoadedGraph truth = load_ground_truth(options.truth, options.input, session);
    show_in_robot_axes(truth, options.axes, session);
    note_rows(truth, options, session);
    builder.set_truth(options.truth, std::move(truth.graph));
  }
  std::unique_ptr<InitialGuess> initial;
  if (!options.initial.empty()) {
    initial = session.registry().make<InitialGuess>(options.initial);
    builder.show_initial(options.initial, *initial);
  }
  Album album = begin_album(title_of(options), command);
  builder.finish(album);
  return album;
}

}  // namespace cairn::app
