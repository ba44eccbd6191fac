// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/graph_files.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <optional>
#include <utility>

#include <fmt/core.h>

#include "cairn/geometry/pose.hpp"
#include "cairn/io/format_by_ending.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/graph_labels.hpp"
#include "cairn/program/other_input.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn::app {
namespace {

constexpr const char* kPipeFormat = "g2o";

LoadedGraph generate_graph(const std::string& name, Session& session) {
  ComponentSpec spec = parse_component(std::string_view(name).substr(1));
  Registry& registry = session.registry();
  const std::uint64_t seed = take_seed(spec, registry.options(Generator::kKind, spec.name));
  LoadedGraph loaded;
  Simulation simulation =
      call_plugin([&] { return "generator '" + spec.name + "'"; },
                  [&] { return registry.make<Generator>(spec)->generate(registry, seed); });
  loaded.graph = std::move(simulation.graph);
  loaded.truth = std::move(simulation.truth);
  loaded.report.format = "generated";
  return loaded;
}

LoadedGraph read_named_graph(const std::string& name, const InputOptions& options,
                             Session& session) {
  LoadedGraph loaded;
  const std::string file = name == "-" ? "/dev/stdin" : name;
  try {
    loaded.graph =
        read_graph(file, session.registry(), options.read, loaded.report, options.format);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::input || !options.format.empty()) throw;
    throw no_graph(name, error, session);
  }
  return loaded;
}

void check_named_format(const std::string& file, const std::string& format, Registry& registry) {
  if (registry.make<Format>(format)->can_write()) return;
  throw Error(ErrorCode::usage, fmt::format("{}: format '{}' only reads", file, format));
}

/// The endings of formats that `use`, by name. A broken plugin is no reason not to use another:
/// `broken` is what the first one said.
template <class Use>
std::vector<std::string> endings(Registry& registry, const Use& use, std::optional<Error>& broken) {
  std::vector<std::string> all;
  for (const std::string& name : registry.names(Format::kKind)) {
    try {
      const auto format = registry.make<Format>(name);
      if (!use(*format)) continue;
      for (const std::string& known : format->extensions()) all.push_back(known);
    } catch (const Error& error) {
      if (!broken) broken = error;
    }
  }
  return all;
}

void check_ending(const std::string& file, Registry& registry) {
  std::optional<Error> broken;
  const std::vector<std::string> writable = endings(
      registry, [](const Format& format) { return format.can_write(); }, broken);
  if (std::find(writable.begin(), writable.end(), file_ending(file)) != writable.end()) return;
  if (writable.empty() && broken) throw Error(*broken);
  if (writable.empty()) throw Error(ErrorCode::usage, file + ": " + no_plugin_of_formats(registry));
  throw Error(
      ErrorCode::usage,
      fmt::format("{}: no format writes files of that name; endings on offer: .{}; or name a "
                  "format with --to",
                  file, joined(writable, ", .")));
}

}  // namespace

std::uint64_t take_seed(ComponentSpec& spec, const OptionTable& table) {
  const auto given = spec.values.find("seed");
  if (given == spec.values.end() || table.find("seed")) return 0;
  const std::string text = given->second;
  std::uint64_t seed = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seed);
  if (error != std::errc() || end != text.data() + text.size()) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: seed is '{}', expected an integer from 0", spec.name, text));
  }
  spec.values.erase(given);
  return seed;
}

bool has_graph_ending(const std::string& file, Registry& registry) {
  std::optional<Error> broken;
  const std::vector<std::string> known = endings(
      registry, [](const Format&) { return true; }, broken);
  return std::find(known.begin(), known.end(), file_ending(file)) != known.end();
}

OptionFields<InputOptions> InputOptions::fields() {
  return OptionFields<InputOptions>()
      .component("from", &InputOptions::format, {"format"},
                 "format of the input, instead of by content")
      .placeholder("FORMAT")
      .part(&InputOptions::read,
            OptionFields<ReadOptions>()
                .boolean("skip_unknown", &ReadOptions::skip_unknown,
                         "skip and count lines with unknown tags, and what is on skipped vertices")
                .boolean("repair_information", &ReadOptions::repair_information,
                         "repair known mistakes in information matrices")
                .boolean("unit_information", &ReadOptions::unit_information,
                         "take factors without information as of unit information, counted")
                .boolean("skip_dangling", &ReadOptions::skip_dangling,
                         "leave out and count factors on vertices that the file does not have"));
}

std::string output_format(const std::string& file, const std::string& named) {
  return named.empty() && file == "-" ? kPipeFormat : named;
}

namespace {

LoadedGraph load(const std::string& name, const InputOptions& options, Session& session) {
  const auto start = std::chrono::steady_clock::now();
  LoadedGraph loaded = name.starts_with('@') ? generate_graph(name, session)
                                             : read_named_graph(name, options, session);
  if (loaded.report.truth) loaded.truth = std::exchange(loaded.report.truth, std::nullopt);
  loaded.seconds = seconds_since(start);
  loaded.name = name;
  loaded.label = graph_label(name);
  for (const std::string& sentence : sentences(loaded.report)) {
    session.note(fmt::format("{}: {}", name, sentence));
  }
  return loaded;
}

}  // namespace

LoadedGraph load_graph(const std::string& name, const InputOptions& options, Session& session) {
  session.files.add_graph(name);
  return load(name, options, session);
}

LoadedGraph load_ground_truth(const std::string& name, InputOptions options, Session& session,
                              bool with_factors) {
  session.files.add_input(name);
  options.read.skip_unknown = options.read.skip_unknown || !with_factors;
  LoadedGraph loaded = load(name, options, session);
  if (loaded.truth) loaded.graph = std::move(*loaded.truth);
  loaded.truth.reset();
  return loaded;
}

Simulation simulate(const std::string& spec, std::uint64_t seed, Session& session) {
  Registry& registry = session.registry();
  return call_plugin([&] { return "generator '" + spec + "'"; },
                     [&] { return registry.make<Generator>(spec)->generate(registry, seed); });
}

void check_output(const std::string& file, const std::string& format, Session& session,
                  bool may_replace_graph) {
  if (file.empty()) return;
  Registry& registry = session.registry();
  const std::string chosen = output_format(file, format);
  if (chosen.empty()) {
    check_ending(file, registry);
  } else {
    check_named_format(file, chosen, registry);
  }
  if (file == "-") session.write_file_to_stdout();
  may_replace_graph ? session.files.add_result(file) : session.files.add_output(file);
  check_writable(file);
}

std::int64_t pose_count(const Graph& graph) {
  std::int64_t poses = 0;
  for (const VariablePool& pool : graph.variable_pools()) {
    if (has_orientation(*pool.type)) poses += std::ssize(pool.variables);
  }
  return poses;
}

bool note_poses_alone(const Graph& graph, const std::string& file, const std::string& format,
                      Session& session) {
  if (!writes_poses_alone(file, session.registry(), format)) return false;
  std::vector<std::string> left_out;
  for (const VariablePool& pool : graph.variable_pools()) {
    if (has_orientation(*pool.type) || pool.variables.empty()) continue;
    left_out.push_back(fmt::format("{} {}", pool.variables.size(), pool.type->tag()));
  }
  if (!left_out.empty()) {
    session.note(fmt::format("{}: a trajectory has poses alone; left out: {}",
                             file == "-" ? "standard output" : file, joined(left_out, ", ")));
  }
  return true;
}

void check_file(const std::string& file, Session& session) {
  if (file.empty()) return;
  if (file == "-") session.write_file_to_stdout();
  session.files.add_output(file);
  check_writable(file);
}

std::vector<std::string> sentences(const ReadReport& report) {
  std::vector<std::string> all = report.notes;
  for (const auto& [tag, lines] : report.skipped) {
    all.push_back(fmt::format("skipped {} with unknown tag '{}'", plural(lines, "line"), tag));
  }
  if (report.repaired > 0) {
    all.push_back(fmt::format("repaired {} information {}", report.repaired,
                              report.repaired == 1 ? "matrix" : "matrices"));
  }
  return all;
}

}  // namespace cairn::app
