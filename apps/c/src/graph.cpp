// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "cairn/graph/packed.hpp"
#include "cairn/io/format.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/loss.hpp"
#include "calls.hpp"
#include "objects.hpp"

using namespace cairn::c;

namespace cairn::c {

Variable variable_of(Registry& registry, const char* tag, Id id, std::span<const double> state,
                     bool fixed) {
  auto type = registry.variable_type(&given(tag, "tag"));
  if (id < 0) {
    throw Error(ErrorCode::usage,
                fmt::format("the id {} is below 0: ids are from 0, as in files", id));
  }
  if (!state.empty())
    expect_size(state.size(), static_cast<std::size_t>(type->ambient_size()), "the state");
  return {std::move(type), id, {state.begin(), state.end()}, fixed};
}

Factor factor_of(Registry& registry, const char* tag, std::span<const Id> ids,
                 std::span<const double> measurement, std::span<const double> information) {
  auto type = registry.factor_type(&given(tag, "tag"));
  expect_size(ids.size(), static_cast<std::size_t>(type->arity()), "the ids");
  expect_size(measurement.size(), static_cast<std::size_t>(type->measurement_size()),
              "the measurement");
  expect_size(information.size(), packed_size(type->residual_size()), "the information");
  return {std::move(type),
          {ids.begin(), ids.end()},
          {measurement.begin(), measurement.end()},
          {information.begin(), information.end()}};
}

std::vector<int> variables_of(const Graph& graph, const Id* ids, std::size_t count) {
  std::vector<int> variables;
  if (!ids && count == 0) {
    for (int v = 0; v < graph.variable_count(); ++v) variables.push_back(v);
    return variables;
  }
  for (const Id id : array(ids, count, "ids")) {
    const std::optional<int> variable = graph.find(id);
    if (!variable)
      throw Error(ErrorCode::usage, fmt::format("there is no variable {} in the graph", id));
    variables.push_back(*variable);
  }
  return variables;
}

}  // namespace cairn::c

namespace {

using cairn::Graph;

int variable_by_id(const Graph& graph, int64_t id) { return variables_of(graph, &id, 1).front(); }

std::size_t states_size(const Graph& graph, std::span<const int> variables) {
  std::size_t size = 0;
  for (const int v : variables) size += static_cast<std::size_t>(graph.type(v).ambient_size());
  return size;
}

void set_states(Graph& graph, std::span<const int> variables, std::span<const double> states) {
  cairn::Values before = graph.values();
  try {
    for (const int v : variables) {
      const auto size = static_cast<std::size_t>(graph.type(v).ambient_size());
      graph.set_state(v, states.first(size));
      states = states.subspan(size);
    }
  } catch (...) {
    graph.set_values(std::move(before));
    throw;
  }
}

/// What reading did besides.
std::string notes_of(const cairn::ReadReport& report) {
  std::string notes;
  for (const auto& [tag, lines] : report.skipped)
    notes += fmt::format("{} lines with the unknown tag {} were left out\n", lines, tag);
  return notes + joined(report.notes);
}

}  // namespace

cairn_code cairn_graph_new(cairn_registry* registry, cairn_graph** graph) {
  return guarded([&] {
    given(graph, "graph");
    hand_out(graph, std::make_unique<cairn_graph>(
                        cairn_graph{given(registry, "registry").registry, Graph()}));
  });
}

cairn_code cairn_graph_read(cairn_registry* registry, const char* file, const char* format,
                            cairn_graph** graph) {
  return guarded([&] {
    given(graph, "graph");
    const auto& from = given(registry, "registry").registry;
    cairn::ReadReport report;
    Graph read = cairn::read_graph(&given(file, "file"), *from, {}, report, name_or(format, ""));
    hand_out(graph,
             std::make_unique<cairn_graph>(cairn_graph{from, std::move(read), notes_of(report)}));
  });
}

cairn_code cairn_graph_write(cairn_graph* graph, const char* file, const char* format) {
  return guarded([&] {
    const cairn_graph& from = given(graph, "graph");
    cairn::write_graph(from.graph, &given(file, "file"), *from.registry, name_or(format, ""));
  });
}

cairn_code cairn_graph_clone(cairn_graph* graph, cairn_graph** copy) {
  return guarded([&] {
    given(copy, "copy");
    const cairn_graph& from = given(graph, "graph");
    hand_out(copy, std::make_unique<cairn_graph>(
                       cairn_graph{from.registry, from.graph.clone(), from.notes, from.doubts}));
  });
}

void cairn_graph_free(cairn_graph* graph) { delete graph; }

const char* cairn_graph_notes(const cairn_graph* graph) {
  return graph ? graph->notes.c_str() : "";
}

const char* cairn_graph_doubts(const cairn_graph* graph) {
  return graph ? graph->doubts.c_str() : "";
}

cairn_code cairn_graph_add_variable(cairn_graph* graph, const char* tag, int64_t id,
                                    const double* state, size_t state_size, int fixed) {
  return guarded([&] {
    cairn_graph& to = given(graph, "graph");
    to.graph.add(variable_of(*to.registry, tag, id, array(state, state_size, "state"), fixed != 0));
  });
}

cairn_code cairn_graph_add_factor(cairn_graph* graph, const char* tag, const int64_t* ids,
                                  size_t id_count, const double* measurement,
                                  size_t measurement_size, const double* information,
                                  size_t information_size) {
  return guarded([&] {
    cairn_graph& to = given(graph, "graph");
    const auto on = array(ids, id_count, "ids");
    for (const cairn::Id id : on) (void)variable_by_id(to.graph, id);
    to.graph.add(factor_of(*to.registry, tag, on,
                           array(measurement, measurement_size, "measurement"),
                           array(information, information_size, "information")));
  });
}

cairn_code cairn_graph_set_fixed(cairn_graph* graph, int64_t id, int fixed) {
  return guarded([&] {
    Graph& to = given(graph, "graph").graph;
    to.set_fixed(variable_by_id(to, id), fixed != 0);
  });
}

cairn_code cairn_graph_set_loss(cairn_graph* graph, const char* spec) {
  return guarded([&] {
    cairn_graph& to = given(graph, "graph");
    std::shared_ptr<const cairn::Loss> loss;
    if (spec) loss = to.registry->make<cairn::Loss>(spec);
    to.graph.set_loss(loss);
  });
}

size_t cairn_graph_variable_count(const cairn_graph* graph) {
  return graph ? static_cast<size_t>(graph->graph.variable_count()) : 0;
}

size_t cairn_graph_factor_count(const cairn_graph* graph) {
  return graph ? static_cast<size_t>(graph->graph.factor_count()) : 0;
}

cairn_code cairn_graph_ids(cairn_graph* graph, int64_t* ids, size_t count) {
  return guarded([&] {
    const Graph& from = given(graph, "graph").graph;
    expect_size(count, static_cast<size_t>(from.variable_count()), "the ids of all variables");
    const std::span<int64_t> out = array(ids, count, "ids");
    for (int v = 0; v < from.variable_count(); ++v) out[static_cast<size_t>(v)] = from.id(v);
  });
}

cairn_code cairn_graph_variable(cairn_graph* graph, int64_t id, const char** tag,
                                size_t* state_size, size_t* tangent_size) {
  return guarded([&] {
    cairn_graph& from = given(graph, "graph");
    const cairn::VariableType& type = from.graph.type(variable_by_id(from.graph, id));
    from.text = type.tag();
    if (tag) *tag = from.text.c_str();
    if (state_size) *state_size = static_cast<size_t>(type.ambient_size());
    if (tangent_size) *tangent_size = static_cast<size_t>(type.tangent_size());
  });
}

cairn_code cairn_graph_sizes(cairn_graph* graph, const int64_t* ids, size_t id_count,
                             size_t* states, size_t* marginals) {
  return guarded([&] {
    const Graph& from = given(graph, "graph").graph;
    const std::vector<int> variables = variables_of(from, ids, id_count);
    if (states) *states = states_size(from, variables);
    if (!marginals) return;
    *marginals = 0;
    for (const int v : variables) {
      const auto size = static_cast<size_t>(from.type(v).tangent_size());
      *marginals += size * size;
    }
  });
}

cairn_code cairn_graph_states(cairn_graph* graph, const int64_t* ids, size_t id_count,
                              double* states, size_t size) {
  return guarded([&] {
    const Graph& from = given(graph, "graph").graph;
    const std::vector<int> variables = variables_of(from, ids, id_count);
    expect_size(size, states_size(from, variables), "the states");
    std::span<double> out = array(states, size, "states");
    for (const int v : variables) {
      std::ranges::copy(from.state(v), out.begin());
      out = out.subspan(from.state(v).size());
    }
  });
}

cairn_code cairn_graph_set_states(cairn_graph* graph, const int64_t* ids, size_t id_count,
                                  const double* states, size_t size) {
  return guarded([&] {
    Graph& to = given(graph, "graph").graph;
    const std::vector<int> variables = variables_of(to, ids, id_count);
    expect_size(size, states_size(to, variables), "the states");
    set_states(to, variables, array(states, size, "states"));
  });
}

cairn_code cairn_graph_chi2(cairn_graph* graph, double* chi2) {
  return guarded([&] {
    const double value = cairn::chi2(given(graph, "graph").graph);
    if (!std::isfinite(value)) {
      throw cairn::Error(cairn::ErrorCode::numerical,
                         "chi2 is not finite: a residual overflows, or is not a number");
    }
    given(chi2, "chi2") = value;
  });
}
