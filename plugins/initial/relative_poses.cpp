// SPDX-License-Identifier: BSD-3-Clause
#include "relative_poses.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/update/placement.hpp"

namespace cairn::initial {
namespace {

/// Links in the order in which their factors were added to the graph.
void append(const FactorPool& pool, std::vector<Link>& links) {
  for (std::size_t f = 0; f < pool.size(); ++f) {
    links.push_back({pool.variables[2 * f], pool.variables[2 * f + 1], pool.sequence[f]});
  }
}

void sort_by_factor(std::vector<Link>& links) {
  std::sort(links.begin(), links.end(),
            [](const Link& a, const Link& b) { return a.factor < b.factor; });
}

bool is_cartesian(const FactorType& factor, const VariableType& pose, const VariableType& point) {
  if (!has_position(pose) || !is_point(point)) return false;
  const int d = pose.placement()->dimension();
  if (point.placement()->dimension() != d || factor.measurement_size() != d ||
      factor.residual_size() != d) {
    return false;
  }
  const std::array<double, 3> z{0.3, -0.7, 1.1};
  std::vector<double> origin(static_cast<std::size_t>(pose.ambient_size()));
  std::vector<double> seen(static_cast<std::size_t>(point.ambient_size()));
  pose.identity(origin.data());
  point.identity(seen.data());
  const std::array<const double*, 2> x{origin.data(), seen.data()};
  std::vector<double> out(seen.size());
  if (!factor.propagate(1, x.data(), z.data(), out.data())) return false;
  const Eigen::Vector3d t = position(point, out);
  return std::equal(t.begin(), t.begin() + d, z.begin(),
                    [](double a, double b) { return std::abs(a - b) < 1e-12; });
}

/// Whether a relative pose has information on all of the orientation, which is the end of its
/// residual; of one whose residual is of another size, on all. In the triangular root of the
/// information these rows are what the orientation has beside the translation.
bool measures_orientation(const Graph& graph, int factor, int angles) {
  const FactorType& type = graph.factor_type(factor);
  const std::span<const double> root = graph.sqrt_information(factor);
  if (type.residual_size() != type.tangent_size(0)) return measures_all(type, root);
  std::size_t row = root.size();
  for (int k = 0; k < angles; ++k) {
    row -= static_cast<std::size_t>(k + 1);
    if (!(root[row] > 0.0)) return false;
  }
  return true;
}

}  // namespace

std::vector<Link> relative_links(const Graph& graph, int variable_pool, int angles) {
  std::vector<Link> links;
  for (const FactorPool& pool : graph.factor_pools()) {
    if (pool.type->is_relative() && pool.variable_pools[0] == variable_pool &&
        pool.type->measurement_size() == pool.type->ambient_size(0)) {
      append(pool, links);
    }
  }
  std::erase_if(
      links, [&](const Link& link) { return !measures_orientation(graph, link.factor, angles); });
  sort_by_factor(links);
  return links;
}

std::vector<Link> cartesian_links(const Graph& graph, int pose_pool) {
  std::vector<Link> links;
  for (const FactorPool& pool : graph.factor_pools()) {
    if (pool.type->arity() != 2 || pool.variable_pools[0] != pose_pool) continue;
    const auto& pools = graph.variable_pools();
    if (is_cartesian(*pool.type, *pools[pose_pool].type, *pools[pool.variable_pools[1]].type)) {
      append(pool, links);
    }
  }
  sort_by_factor(links);
  return links;
}

Eigen::MatrixXd information_matrix(const Graph& graph, int factor) {
  return unpack(graph.information(factor), graph.factor_type(factor).residual_size());
}

}  // namespace cairn::initial
