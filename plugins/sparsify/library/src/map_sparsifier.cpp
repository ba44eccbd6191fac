// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/map_sparsifier.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/graph/id_text.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/sparsification/topology.hpp"
#include "plain_loss.hpp"

namespace cairn {
namespace {

/// A node of a pose graph. A pose type of a plugin may have no position.
bool is_node(const VariableType& type) { return type.lie_group() && !is_point(type); }

int pose_count(const Graph& graph) {
  int count = 0;
  for (int v = 0; v < graph.variable_count(); ++v) count += is_node(graph.type(v));
  return count;
}

/// Poses that may leave: none that is fixed or anchored, none with a factor of `coming`, not the
/// newest.
std::vector<int> open_poses(const Graph& graph, const GraphUpdate& coming) {
  std::vector<bool> stays(graph.variable_count());
  for (const int v : resolve_gauge(graph).anchored) stays[v] = true;
  for (const Factor& factor : coming.factors) {
    for (const Id id : factor.variables) {
      if (const auto v = graph.find(id)) stays[*v] = true;
    }
  }
  std::vector<int> poses;
  int newest = -1;
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (!is_node(graph.type(v))) continue;
    newest = v;
    if (!graph.fixed(v) && !stays[v]) poses.push_back(v);
  }
  std::erase(poses, newest);
  return poses;
}

}  // namespace

void expect_savable(const ComponentSpec& sparsifier, Registry& registry) {
  const auto topology = sparsifier.values.find("topology");
  if (topology == sparsifier.values.end()) return;
  const auto made = registry.make<Topology>(topology->second);
  if (made->unwritable().empty()) return;
  throw Error(ErrorCode::usage,
              fmt::format("topology {} makes {}, which no format of graphs expresses: the map "
                          "could not be saved; choose another topology",
                          topology->second, made->unwritable()));
}

MapSparsifier::MapSparsifier(Registry& registry, ComponentSpec sparsifier, ComponentSpec selection)
    : registry_(registry),
      sparsifier_spec_(std::move(sparsifier)),
      selection_spec_(std::move(selection)) {}

MapSparsifier::~MapSparsifier() = default;

void MapSparsifier::prepare() {
  if (!sparsifier_) sparsifier_ = registry_.make<Sparsifier>(sparsifier_spec_);
  if (!selection_) selection_ = registry_.make<NodeSelection>(selection_spec_);
}

PoseRemover::Removal MapSparsifier::removal_of(const Sparsification& change, const Graph& graph,
                                               Estimator& estimator) {
  const std::vector<FactorId> ids = estimator.factors();  // by position in its graph
  if (std::ssize(ids) != graph.factor_count())
    throw std::logic_error("the graph of an estimator has other factors than it names");
  Removal removal{.update = {}, .kld = std::max(0.0, change.kld), .note = {}};
  for (const int f : change.removed_factors) removal.update.removed_factors.push_back(ids[f]);
  for (const int v : change.removed_variables)
    removal.update.removed_variables.push_back(graph.id(v));
  removal.update.factors = change.factors;
  for (Factor& factor : removal.update.factors) factor.loss = plain_loss();
  for (const SparsificationNote& note : change.notes) {
    if (said_.insert(note.text).second) removal.notes.push_back(note.text);
  }
  return removal;
}

PoseRemover::Removal MapSparsifier::remove(Estimator& estimator, std::span<const Id> poses) {
  prepare();
  const Graph graph = estimator.graph();
  std::vector<int> nodes;
  for (const Id id : poses) {
    const auto v = graph.find(id);
    if (!v)
      throw Error(ErrorCode::input,
                  fmt::format("there is no variable {} to be removed", id_text(id)));
    if (std::ranges::count(nodes, *v) > 0)
      throw Error(ErrorCode::input, fmt::format("variable {} is to leave twice", id_text(id)));
    nodes.push_back(*v);
  }
  const Sparsification change =
      call_plugin([&] { return fmt::format("sparsifier '{}'", sparsifier_spec_.name); },
                  [&] { return sparsifier_->remove(graph, nodes); });
  if (!change.refused.empty()) {
    const RefusedNode& first = change.refused.front();
    throw Error(ErrorCode::input,
                fmt::format("variable {} cannot be replaced by factors between its neighbours: {}; "
                            "marginalising it would leave a linear prior on them instead",
                            first.node, first.reason));
  }
  return removal_of(change, graph, estimator);
}

PoseRemover::Removal MapSparsifier::make_room(Estimator& estimator, int limit,
                                              const GraphUpdate& coming) {
  const auto more = std::ranges::count_if(
      coming.variables, [](const Variable& variable) { return is_node(*variable.type); });
  limit -= static_cast<int>(more);
  if (estimator.variable_count() <= limit) return {};
  prepare();
  const Graph graph = estimator.graph();
  const int wanted = pose_count(graph) - limit;
  if (wanted <= 0) return {};
  std::vector<int> open = open_poses(graph, coming);
  std::string reason = "all are fixed, anchored, or among the newest";
  Sparsification change;
  // What the sparsifier refuses is not offered to the selection again.
  while (!open.empty()) {
    const std::vector<int> chosen =
        call_plugin([&] { return fmt::format("node selection '{}'", selection_spec_.name); },
                    [&] { return selection_->choose(graph, open, *sparsifier_, wanted); });
    change = call_plugin([&] { return fmt::format("sparsifier '{}'", sparsifier_spec_.name); },
                         [&] { return sparsifier_->remove(graph, chosen); });
    if (chosen.empty()) reason = fmt::format("{} chooses none", selection_spec_.name);
    if (change.refused.empty()) break;
    reason = change.refused.front().reason;
    for (const RefusedNode& node : change.refused) std::erase(open, graph.find(node.node).value());
  }
  Removal removal = removal_of(change, graph, estimator);
  const auto removed = static_cast<int>(std::ssize(change.removed_variables));
  if (removed < wanted) {
    removal.note = fmt::format(
        "more poses stay than are to be kept, since they cannot be removed: {}", reason);
  }
  return removal;
}

}  // namespace cairn
