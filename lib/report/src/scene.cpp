// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/scene.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kMostTypes = 255;

int dimension_of(const Graph& graph, const std::string& name) {
  int dimension = 0;
  for (const VariablePool& pool : graph.variable_pools()) {
    if (has_position(*pool.type) && !pool.variables.empty()) {
      dimension = std::max(dimension, pool.type->placement()->dimension());
    }
  }
  if (dimension == 0) {
    throw Error(ErrorCode::input,
                fmt::format("{}: none of its variables has a position, so there is nothing to "
                            "draw",
                            name));
  }
  return dimension;
}

/// The middle of the bounding box, in whole metres so that it reads well.
std::array<double, 3> middle(const Graph& graph) {
  Eigen::AlignedBox3d box;
  for (int v = 0; v < graph.variable_count(); ++v) {
    const Eigen::Vector3d t = position(graph.type(v), graph.state(v));
    if (t.allFinite()) box.extend(t);
  }
  if (box.isEmpty()) return {};
  const Eigen::Vector3d center = box.center();
  return {std::round(center[0]), std::round(center[1]), std::round(center[2])};
}

void add_variables(const Graph& graph, Scene& scene) {
  if (graph.variable_pools().size() > kMostTypes || graph.factor_pools().size() > kMostTypes) {
    throw Error(ErrorCode::input, fmt::format("{}: more than {} types of variables or factors",
                                              scene.name, kMostTypes));
  }
  for (const VariablePool& pool : graph.variable_pools()) {
    scene.variable_types.push_back(
        {std::string(pool.type->tag()), has_orientation(*pool.type), pool.type->tangent_size()});
  }
  for (int v = 0; v < graph.variable_count(); ++v) {
    scene.ids.push_back(graph.id(v));
    scene.variable_type.push_back(static_cast<std::uint8_t>(graph.pool(v)));
    if (graph.fixed(v)) scene.fixed.push_back(v);
  }
  scene.held = resolve_gauge(graph).held;
}

/// Two variables that a factor is drawn between; b = -1 where there is one alone to draw it at.
struct Ends {
  std::int32_t a, b;
};

/// A factor on many variables joins the first that is somewhere to each other that is. What has no
/// position, such as a velocity, travels with its pose and has no edge.
std::vector<Ends> ends_of(const Graph& graph, int factor) {
  const auto variables = graph.factor_variables(factor);
  std::vector<std::int32_t> placed;
  for (const std::int32_t v : variables) {
    if (has_position(graph.type(v))) placed.push_back(v);
  }
  if (placed.size() < 2) return {{placed.empty() ? variables[0] : placed[0], -1}};
  std::vector<Ends> ends;
  for (std::size_t k = 1; k < placed.size(); ++k) ends.push_back({placed[0], placed[k]});
  return ends;
}

/// Of each variable among those of its type, by id.
std::vector<std::int32_t> ranks(const Graph& graph) {
  std::vector<std::int32_t> rank(static_cast<std::size_t>(graph.variable_count()));
  for (const VariablePool& pool : graph.variable_pools()) {
    std::vector<std::int32_t> order(pool.variables.begin(), pool.variables.end());
    std::ranges::sort(order, {}, [&](std::int32_t v) { return graph.id(v); });
    for (std::size_t k = 0; k < order.size(); ++k) rank[order[k]] = static_cast<std::int32_t>(k);
  }
  return rank;
}

EdgeClass class_of(const Graph& graph, int factor, const Ends& ends,
                   const std::vector<std::int32_t>& rank) {
  if (ends.b < 0)
    return graph.factor_variables(factor).size() == 1 ? EdgeClass::prior : EdgeClass::other;
  const bool first = has_orientation(graph.type(ends.a));
  if (first != has_orientation(graph.type(ends.b))) return EdgeClass::landmark;
  if (!first) return EdgeClass::other;
  // As `loop_closures` of factor_selector.hpp, for factors on more than two variables as well.
  const bool follow =
      graph.pool(ends.a) != graph.pool(ends.b) || std::abs(rank[ends.a] - rank[ends.b]) == 1;
  return follow ? EdgeClass::odometry : EdgeClass::loop;
}

void add_edges(const Graph& graph, Scene& scene) {
  for (const FactorPool& pool : graph.factor_pools()) {
    scene.edge_types.push_back({std::string(pool.type->tag()), pool.type->residual_size()});
  }
  const std::vector<std::int32_t> rank = ranks(graph);
  scene.factors = graph.factor_count();
  for (int f = 0; f < graph.factor_count(); ++f) {
    for (const Ends& ends : ends_of(graph, f)) {
      scene.a.push_back(ends.a);
      scene.b.push_back(ends.b);
      scene.edge_class.push_back(class_of(graph, f, ends, rank));
      scene.edge_type.push_back(static_cast<std::uint8_t>(graph.ref(f).pool));
      scene.factor.push_back(f);
    }
  }
  if (std::ssize(scene.factor) == scene.factors) scene.factor.clear();
}

/// A file without factors shows as a line through its poses, by rising id.
void add_path(const Graph& graph, Scene& scene) {
  std::vector<std::int32_t> poses;
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (has_orientation(graph.type(v))) poses.push_back(v);
  }
  std::sort(poses.begin(), poses.end(), [&](int x, int y) { return graph.id(x) < graph.id(y); });
  scene.edge_types.push_back({"path", 0});
  for (std::size_t k = 1; k < poses.size(); ++k) {
    scene.a.push_back(poses[k - 1]);
    scene.b.push_back(poses[k]);
    scene.edge_class.push_back(EdgeClass::path);
    scene.edge_type.push_back(0);
  }
}

void set_place(SceneEstimate& estimate, const Scene& scene, std::size_t variable,
               const VariableType& type, std::span<const double> x) {
  if (!has_position(type)) return;
  const Pose pose = pose_of(type, x);
  const auto d = static_cast<std::size_t>(scene.dimension);
  for (std::size_t k = 0; k < d; ++k) estimate.positions[d * variable + k] = pose.t[int(k)];
  if (!has_orientation(type)) return;
  if (d == 2) {
    estimate.orientation[variable] = static_cast<float>(std::atan2(pose.R(1, 0), pose.R(0, 0)));
  } else {
    const Eigen::Quaterniond q(pose.R);
    const Eigen::Vector4f xyzw = q.coeffs().cast<float>();
    std::copy_n(xyzw.data(), 4, estimate.orientation.begin() + std::ptrdiff_t(4 * variable));
  }
}

SceneEstimate nowhere(const Scene& scene, std::string name, EstimateRole role) {
  SceneEstimate estimate;
  estimate.name = std::move(name);
  estimate.role = role;
  estimate.positions.assign(scene.ids.size() * std::size_t(scene.dimension), kNone);
  estimate.orientation.assign(scene.ids.size() * (scene.dimension == 2 ? 1 : 4),
                              std::numeric_limits<float>::quiet_NaN());
  return estimate;
}

}  // namespace

Picture::~Picture() = default;

std::string_view to_string(EstimateRole role) {
  switch (role) {
    case EstimateRole::initial:
      return "initial";
    case EstimateRole::estimate:
      return "estimate";
    case EstimateRole::truth:
      return "truth";
    case EstimateRole::peer:
      break;
  }
  return "peer";
}

Scene scene_of(const Graph& graph, std::string name) {
  Scene scene;
  scene.name = std::move(name);
  scene.dimension = dimension_of(graph, scene.name);
  scene.origin = middle(graph);
  add_variables(graph, scene);
  if (graph.factor_count() > 0) {
    add_edges(graph, scene);
  } else {
    add_path(graph, scene);
  }
  return scene;
}

SceneEstimate place(const Graph& graph, const Scene& scene, std::string name, EstimateRole role) {
  SceneEstimate estimate = nowhere(scene, std::move(name), role);
  for (int v = 0; v < graph.variable_count(); ++v) {
    set_place(estimate, scene, std::size_t(v), graph.type(v), graph.state(v));
  }
  if (graph.factor_count() == 0) return estimate;
  const std::vector<double> norms = squared_norms(graph);
  estimate.chi2 = 0.0;
  for (const double norm : norms) estimate.chi2 += norm;
  estimate.edge_chi2.resize(scene.a.size());
  for (std::size_t e = 0; e < scene.a.size(); ++e) {
    estimate.edge_chi2[e] =
        static_cast<float>(norms[scene.factor.empty() ? e : std::size_t(scene.factor[e])]);
  }
  return estimate;
}

SceneEstimate place_by_id(const Graph& other, const Scene& scene, std::string name,
                          EstimateRole role, int& matched) {
  SceneEstimate estimate = nowhere(scene, std::move(name), role);
  matched = 0;
  for (std::size_t v = 0; v < scene.ids.size(); ++v) {
    const std::optional<int> found = other.find(scene.ids[v]);
    if (!found) continue;
    const VariableType& type = other.type(*found);
    // A landmark of one file is not a pose of another that happens to have its number.
    if (!has_position(type) ||
        has_orientation(type) != scene.variable_types[scene.variable_type[v]].pose) {
      continue;
    }
    set_place(estimate, scene, v, type, other.state(*found));
    ++matched;
  }
  return estimate;
}

void copy_positions(const Graph& graph, const Values& values, int dimension,
                    const std::array<double, 3>& origin, std::vector<float>& out) {
  const auto d = static_cast<std::size_t>(dimension);
  out.resize(d * std::size_t(graph.variable_count()));
  for (std::size_t p = 0; p < graph.variable_pools().size(); ++p) {
    const VariablePool& pool = graph.variable_pools()[p];
    const auto size = static_cast<std::size_t>(pool.type->ambient_size());
    for (std::size_t slot = 0; slot < pool.variables.size(); ++slot) {
      const Eigen::Vector3d t = position(*pool.type, {values.pools[p].data() + slot * size, size});
      for (std::size_t k = 0; k < d; ++k) {
        out[d * std::size_t(pool.variables[slot]) + k] = static_cast<float>(t[int(k)] - origin[k]);
      }
    }
  }
}

}  // namespace cairn
