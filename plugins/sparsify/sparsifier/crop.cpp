// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/core.h>

#include "cairn/geometry/pose.hpp"
#include "local_problem.hpp"

namespace cairn::sparsify {
namespace {

/// Of the nodes of a problem: poses are of one type, and so are landmarks.
struct Kinds {
  const VariableType* pose = nullptr;
  const VariableType* landmark = nullptr;
};

/// Takes a node in; why nodes cannot leave because of it, or nothing.
std::string refuse(const Graph& graph, Kinds& kinds, int leaving, int node) {
  const VariableType& type = graph.type(node);
  const VariableType*& kind = is_point(type) ? kinds.landmark : kinds.pose;
  if (type.lie_group() && (!kind || kind->tag() == type.tag())) {
    kind = &type;
    return {};
  }
  if (node == leaving) {
    return fmt::format("{} is not a pose of a Lie group, and new factors relate only such",
                       graph.describe_variable(leaving));
  }
  return fmt::format(
      "{} has a factor with {}, and new factors relate poses of one kind and their landmarks only",
      graph.describe_variable(leaving), graph.describe_variable(node));
}

/// Whether a factor type measures a whole relative pose of two variables of that type.
bool relates(const FactorType& type, const VariableType& pose) {
  return type.arity() == 2 && type.is_relative() && type.residual_size() == pose.tangent_size() &&
         type.variable_tags()[0] == pose.tag() && type.variable_tags()[1] == pose.tag();
}

/// Whether it measures a whole pose in the world: the measurement is the state itself.
bool places(const FactorType& type, const VariableType& pose) {
  if (type.arity() != 1 || type.variable_tags()[0] != pose.tag() ||
      type.residual_size() != pose.tangent_size() || type.measurement_size() != pose.ambient_size())
    return false;
  std::vector<double> z(pose.ambient_size()), x(z.size());
  pose.identity(z.data());
  const double* states[] = {z.data()};
  return type.propagate(0, states, z.data(), x.data()) && x == z;
}

/// Where a factor type has a landmark that is seen from the origin with the measurement z; empty
/// unless it measures as many numbers as a landmark has.
std::vector<double> seen_at(const FactorType& type, const VariableType& pose,
                            const VariableType& landmark, const std::vector<double>& z) {
  const int n = landmark.ambient_size();
  if (type.arity() != 2 || type.variable_tags()[0] != pose.tag() ||
      type.variable_tags()[1] != landmark.tag() ||
      type.residual_size() != landmark.tangent_size() || type.measurement_size() != n)
    return {};
  std::vector<double> world(pose.ambient_size()), seen(n);
  pose.identity(world.data());
  const double* states[] = {world.data(), z.data()};
  return type.propagate(1, states, z.data(), seen.data()) ? seen : std::vector<double>();
}

/// Whether it measures the position of a landmark in the frame of a pose.
bool observes(const FactorType& type, const VariableType& pose, const VariableType& landmark) {
  std::vector<double> z(landmark.ambient_size());
  for (std::size_t k = 0; k < z.size(); ++k) z[k] = 0.5 - 0.75 * static_cast<double>(k);
  return seen_at(type, pose, landmark, z) == z;
}

/// Whether it measures a bearing [rad] and a range in the plane.
bool measures_bearing_and_range(const FactorType& type, const VariableType& pose,
                                const VariableType& landmark) {
  if (landmark.ambient_size() != 2) return false;
  const std::vector<double> z{0.5, 2.0}, seen = seen_at(type, pose, landmark, z);
  return !seen.empty() && std::abs(seen[0] - z[1] * std::cos(z[0])) < 1e-12 &&
         std::abs(seen[1] - z[1] * std::sin(z[0])) < 1e-12;
}

/// A type that the factors on the nodes that leave have, or another factor of the graph: these may
/// have none where only pairs of correlated factors are left, for instance.
template <class Fits>
std::shared_ptr<const FactorType> find_type(const WorkGraph& work, const LocalProblem& local,
                                            const Fits& fits) {
  for (const int v : local.removed) {
    for (const int f : work.on(v)) {
      if (fits(*work.factor(f).type)) return work.factor(f).type;
    }
  }
  for (const FactorPool& pool : work.graph().factor_pools()) {
    if (fits(*pool.type)) return pool.type;
  }
  return nullptr;
}

/// Finds the types that new factors need, of which one on the whole blanket can do without some;
/// why there is none, or nothing.
std::string find_types(const WorkGraph& work, const Kinds& kinds, bool whole, LocalProblem& local) {
  const Graph& graph = work.graph();
  const std::string leaving = graph.describe_variable(local.removed.front());
  const auto landmarks = std::ssize(local.blanket) - local.poses;
  if (landmarks > 0 && local.poses == 0) {
    return fmt::format("{} has only landmarks as neighbours, and new factors are on a pose each",
                       leaving);
  }
  if (local.poses > 1) {
    local.types.relative =
        find_type(work, local, [&](const FactorType& type) { return relates(type, *kinds.pose); });
    if (!local.types.relative && !whole) {
      return fmt::format(
          "{}: no factor of the graph measures a whole relative pose, as new ones do", leaving);
    }
  }
  if (landmarks > 0) {
    local.types.observation = find_type(work, local, [&](const FactorType& type) {
      return observes(type, *kinds.pose, *kinds.landmark);
    });
    if (!local.types.observation) {
      local.types.observation = find_type(work, local, [&](const FactorType& type) {
        return measures_bearing_and_range(type, *kinds.pose, *kinds.landmark);
      });
      local.types.bearing_range = local.types.observation != nullptr;
    }
    if (!local.types.observation) {
      return fmt::format(
          "{}: no factor of the graph measures the position of a landmark in the frame of a pose, "
          "or its bearing and range, as new ones do",
          leaving);
    }
  }
  if (!local.absolute) return {};
  local.types.prior =
      find_type(work, local, [&](const FactorType& type) { return places(type, *kinds.pose); });
  if (local.types.prior || whole) return {};
  return fmt::format(
      "{} has an absolute measurement, and no factor of the graph measures a whole pose in the "
      "world, as a new one does",
      leaving);
}

}  // namespace

LocalProblem crop(const WorkGraph& work, std::vector<int> removed, bool whole) {
  const Graph& graph = work.graph();
  LocalProblem local;
  local.removed = std::move(removed);
  local.blanket = work.blanket(local.removed);
  Kinds kinds;
  for (const std::vector<int>* nodes : {&local.removed, &local.blanket}) {
    for (const int v : *nodes) {
      if (local.refusal.empty()) local.refusal = refuse(graph, kinds, local.removed.front(), v);
    }
  }
  const auto landmarks = std::stable_partition(local.blanket.begin(), local.blanket.end(),
                                               [&](int v) { return !is_point(graph.type(v)); });
  local.poses = static_cast<int>(landmarks - local.blanket.begin());
  for (const int v : local.removed) {
    if (graph.fixed(v)) local.refusal = fmt::format("{} is held", graph.describe_variable(v));
    for (const int f : work.on(v)) {
      local.factors.push_back(f);
      local.absolute_size +=
          std::min(work.factor(f).type->absolute_size(), graph.type(v).tangent_size());
    }
  }
  // Where all poses are fixed an absolute measurement has nothing left to determine.
  local.absolute = local.absolute_size > 0 && std::any_of(local.blanket.begin(), landmarks,
                                                          [&](int v) { return !graph.fixed(v); });
  if (local.refusal.empty()) local.refusal = find_types(work, kinds, whole, local);
  if (!local.refusal.empty()) return local;
  // Within the blanket: what determines only how its nodes lie to each other. Such a factor is on
  // two of them at least, so that the one with most factors, as the middle of a star, is left out.
  const auto most =
      std::ranges::max_element(local.blanket, {}, [&](int v) { return work.on(v).size(); });
  for (const int v : local.blanket) {
    if (v == *most) continue;
    for (const int f : work.on(v)) {
      const WorkFactor& factor = work.factor(f);
      const bool within = std::ranges::all_of(factor.variables, [&](int other) {
        return std::ranges::find(local.blanket, other) != local.blanket.end();
      });
      if (within && factor.variables.size() > 1 && factor.type->absolute_size() == 0)
        local.factors.push_back(f);
    }
  }
  std::ranges::sort(local.factors);
  local.factors.erase(std::unique(local.factors.begin(), local.factors.end()), local.factors.end());
  return local;
}

}  // namespace cairn::sparsify
