// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/scene_json.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/io/packed_array.hpp"
#include "cairn/runtime/error.hpp"
#include "json_reading.hpp"

namespace cairn {
namespace {

constexpr std::int64_t kMost = std::numeric_limits<std::int32_t>::max();
constexpr auto kStatuses = {Status::converged, Status::max_iterations, Status::diverged,
                            Status::not_positive_definite, Status::interrupted};

std::string deflated(std::span<const std::int32_t> numbers) {
  return packed_json(numbers, Packing::deflate);
}
std::string deflated(const std::vector<std::uint8_t>& numbers) {
  return packed_json(std::span<const std::uint8_t>(numbers), Packing::deflate);
}

std::string ids_json(const std::vector<Id>& ids) {
  for (std::size_t k = 0; k < ids.size(); ++k) {
    if (ids[k] != static_cast<Id>(k)) {
      return packed_json(std::span<const std::int64_t>(ids), Packing::deflate);
    }
  }
  return "\"sequence\"";
}

std::string variables_json(const Scene& scene) {
  std::vector<std::string> types;
  for (const SceneVariableType& type : scene.variable_types) {
    types.push_back(fmt::format(R"({{"name":{},"role":"{}","tangent_size":{}}})",
                                json_string(type.tag), type.pose ? "pose" : "landmark",
                                type.tangent_size));
  }
  return fmt::format(R"({{"count":{},"ids":{},"types":[{}],"type":{},"fixed":[{}]}})",
                     scene.ids.size(), ids_json(scene.ids), fmt::join(types, ","),
                     deflated(scene.variable_type), fmt::join(scene.fixed, ","));
}

std::string edges_json(const Scene& scene) {
  std::vector<std::string> types;
  for (const SceneEdgeType& type : scene.edge_types) {
    types.push_back(fmt::format(R"({{"name":{},"residual_size":{}}})", json_string(type.tag),
                                type.residual_size));
  }
  std::vector<std::uint8_t> classes;
  for (const EdgeClass edge_class : scene.edge_class) {
    classes.push_back(static_cast<std::uint8_t>(edge_class));
  }
  return fmt::format(
      R"({{"count":{},"factors":{},"a":{},"b":{},"class":{},"types":[{}],"type":{}{}}})",
      scene.a.size(), scene.factors, deflated(scene.a), deflated(scene.b), deflated(classes),
      fmt::join(types, ","), deflated(scene.edge_type),
      scene.factor.empty() ? "" : ",\"factor\":" + deflated(scene.factor));
}

std::string iterations_json(const Summary& summary) {
  std::string text;
  for (const Iteration& it : summary.iterations) {
    text += fmt::format(R"({}{{"chi2":{},"step_norm":{},"lambda":{},"accepted":{},"seconds":{}}})",
                        text.empty() ? "" : ",", json_number(it.chi2), json_number(it.step_norm),
                        json_number(it.lambda), it.accepted, json_number(it.seconds));
  }
  return text;
}

std::string notes_json(const std::vector<std::string>& notes) {
  std::vector<std::string> literals;
  for (const std::string& note : notes) literals.push_back(json_string(note));
  return fmt::format("[{}]", fmt::join(literals, ","));
}

Status status_of(const std::string& name, const JsonReader& json) {
  const auto* const found = std::find_if(kStatuses.begin(), kStatuses.end(),
                                         [&](Status status) { return to_string(status) == name; });
  if (found == kStatuses.end()) json.fail(fmt::format("'{}' is not a status of a run", name));
  return *found;
}

Iteration read_iteration(const JsonReader& json) {
  Iteration it;
  it.chi2 = json.number("chi2");
  it.step_norm = json.number("step_norm", 0.0);
  it.lambda = json.number("lambda", 0.0);
  it.accepted = json.boolean("accepted", true);
  it.seconds = json.number("seconds", 0.0);
  return it;
}

template <class Number>
std::vector<Number> read_array(const JsonReader& json, const char* member, std::size_t count,
                               double low, double high) {
  std::vector<Number> numbers;
  numbers.reserve(count);
  for (const double number : json.numbers(member, count)) {
    if (!(number >= low && number <= high)) {
      json.fail(fmt::format("'{}' holds {}, expected {} to {}", member, number, low, high));
    }
    numbers.push_back(static_cast<Number>(number));
  }
  return numbers;
}

std::vector<Id> read_ids(const JsonReader& json, std::size_t count, bool sequence) {
  std::vector<Id> ids(count);
  std::iota(ids.begin(), ids.end(), Id{0});
  if (!sequence) ids = read_array<Id>(json, "ids", count, -9.2e18, 9.2e18);
  return ids;
}

/// "ids" is a text ("sequence") or an array.
bool is_sequence(const JsonReader& json) {
  try {
    return json.text("ids") == "sequence";
  } catch (const Error&) {
    return false;
  }
}

void read_variables(const JsonReader& json, Scene& scene) {
  const auto count = static_cast<std::size_t>(json.whole("count", -1, 0, kMost));
  for (const JsonReader& type : json.objects("types")) {
    scene.variable_types.push_back({type.text("name"), type.text("role") != "landmark",
                                    static_cast<int>(type.whole("tangent_size", 0, 0, 1000))});
  }
  scene.ids = read_ids(json, count, is_sequence(json));
  scene.variable_type = read_array<std::uint8_t>(
      json, "type", count, 0, static_cast<double>(scene.variable_types.size()) - 1);
  scene.held.assign(count, false);
  if (!json.has("fixed")) return;
  // How many there are is known only from the list itself.
  for (const std::int32_t v : json.indices("fixed", static_cast<std::int64_t>(count) - 1)) {
    scene.fixed.push_back(v);
    scene.held[static_cast<std::size_t>(v)] = true;
  }
}

void read_edges(const JsonReader& json, Scene& scene) {
  const auto count = static_cast<std::size_t>(json.whole("count", -1, 0, kMost));
  const double last = static_cast<double>(scene.ids.size()) - 1;
  scene.factors = static_cast<int>(json.whole("factors", 0, 0, kMost));
  for (const JsonReader& type : json.objects("types")) {
    scene.edge_types.push_back(
        {type.text("name"), static_cast<int>(type.whole("residual_size", 0, 0, 1000))});
  }
  scene.a = read_array<std::int32_t>(json, "a", count, 0, last);
  scene.b = read_array<std::int32_t>(json, "b", count, -1, last);
  scene.edge_class = read_array<EdgeClass>(json, "class", count, 0, 5);
  scene.edge_type = read_array<std::uint8_t>(json, "type", count, 0,
                                             static_cast<double>(scene.edge_types.size()) - 1);
  if (json.has("factor")) {
    scene.factor =
        read_array<std::int32_t>(json, "factor", count, 0, static_cast<double>(scene.factors) - 1);
  }
}

}  // namespace

std::string structure_json(const Scene& scene) {
  return fmt::format(R"("dimension":{},"origin":[{},{},{}],"variables":{},"edges":{})",
                     scene.dimension, json_number(scene.origin[0]), json_number(scene.origin[1]),
                     json_number(scene.origin[2]), variables_json(scene), edges_json(scene));
}

Scene read_structure(std::string_view text, std::string_view where) {
  const JsonReader json(text, where);
  Scene scene;
  scene.dimension = static_cast<int>(json.whole("dimension", 0, 2, 3));
  const std::vector<double> origin = json.numbers("origin", 3);
  std::copy(origin.begin(), origin.end(), scene.origin.begin());
  read_variables(json.object("variables"), scene);
  read_edges(json.object("edges"), scene);
  return scene;
}

std::string run_json(const SceneRun& run) {
  const Summary& summary = run.summary;
  const Seconds& s = summary.seconds;
  std::string text = fmt::format(R"({{"name":{},"optimizer":{},"linear_solver":{},"status":"{}",)",
                                 json_string(run.name), json_string(summary.optimizer),
                                 json_string(summary.linear_solver), to_string(summary.status));
  if (run.threads > 0) text += fmt::format(R"("threads":{},)", run.threads);
  if (run.peak_memory_bytes > 0) {
    text += fmt::format(R"("peak_memory_bytes":{},)", run.peak_memory_bytes);
  }
  text += fmt::format(R"("chi2":{{"initial":{},"final":{}}},"iterations":[{}],)",
                      json_number(summary.initial_chi2), json_number(summary.final_chi2),
                      iterations_json(summary));
  text += fmt::format(
      R"("seconds":{{"total":{},"linearize":{},"analyze":{},"factorize":{},"solve":{},"update":{}}},)",
      json_number(s.total), json_number(s.linearize), json_number(s.analyze),
      json_number(s.factorize), json_number(s.solve), json_number(s.update));
  return text +
         fmt::format(
             R"("solver":{{"ordering":{},"factor_nonzeros":{},"factor_flops":{}}},"notes":{}}})",
             json_string(summary.solver.ordering), summary.solver.factor_nonzeros,
             json_number(summary.solver.factor_flops), notes_json(summary.notes));
}

SceneRun read_run(std::string_view text, std::string_view where) {
  const JsonReader json(text, where);
  if (!json.has("iterations") || !json.has("chi2")) json.fail("is not a report of cairn optimize");
  SceneRun run;
  run.name = json.text("name");
  run.threads = static_cast<int>(json.whole("threads", 0, 0, kMost));
  run.peak_memory_bytes = json.whole("peak_memory_bytes", 0, 0, std::int64_t{1} << 52);
  Summary& summary = run.summary;
  summary.optimizer = json.text("optimizer");
  summary.linear_solver = json.text("linear_solver");
  if (json.has("status")) summary.status = status_of(json.text("status"), json);
  const JsonReader chi2 = json.object("chi2");
  summary.initial_chi2 = chi2.number("initial");
  summary.final_chi2 = chi2.number("final");
  for (const JsonReader& iteration : json.objects("iterations")) {
    summary.iterations.push_back(read_iteration(iteration));
    summary.iterations.back().number = static_cast<int>(summary.iterations.size());
  }
  const JsonReader seconds = json.object("seconds");
  summary.seconds = {seconds.number("total", 0),   seconds.number("linearize", 0),
                     seconds.number("analyze", 0), seconds.number("factorize", 0),
                     seconds.number("solve", 0),   seconds.number("update", 0)};
  const JsonReader solver = json.object("solver");
  summary.solver.ordering = solver.text("ordering");
  summary.solver.factor_nonzeros = solver.whole("factor_nonzeros", 0, 0, std::int64_t{1} << 52);
  summary.solver.factor_flops = solver.number("factor_flops", 0.0);
  summary.notes = json.texts("notes");
  if (run.name.empty()) {
    run.name = summary.linear_solver.empty()
                   ? summary.optimizer
                   : fmt::format("{}, {}", summary.optimizer, summary.linear_solver);
  }
  return run;
}

}  // namespace cairn
