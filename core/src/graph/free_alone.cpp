// SPDX-License-Identifier: BSD-3-Clause
#include "free_alone.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/QR>

namespace cairn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Point = Eigen::Vector3d;

/// Of scaled rows, what is smaller is rounding.
constexpr double kRounding = 1e-10;
/// Sines of angles between rays that are no matter of rounding.
constexpr double kApart = 1e-6;
/// Where the variables of a pool are in space, by slot. Empty if they have no place there.
std::vector<Point> positions(const VariablePool& pool, std::span<const double> states) {
  const Placement* placement = pool.type->placement();
  if (!placement || placement->dimension() != 3) return {};
  const auto size = static_cast<std::size_t>(pool.type->ambient_size());
  std::vector<Point> all(states.size() / size);
  Eigen::Matrix3d R;
  for (std::size_t k = 0; k < all.size(); ++k)
    placement->split(states.data() + k * size, R.data(), all[k].data());
  return all;
}

/// Whether a type is that of a point, and no more.
bool is_point(const VariableType& type) {
  const Placement* placement = type.placement();
  return placement && !placement->has_orientation() &&
         type.tangent_size() == placement->dimension();
}

/// The points that are seen from two places, by factors that tell a direction at least.
std::vector<bool> seen_from_two_places(const Graph& graph, const Values& values) {
  std::vector<std::vector<Point>> at;
  for (std::size_t p = 0; p < graph.variable_pools().size(); ++p)
    at.push_back(positions(graph.variable_pools()[p], values.pools[p]));
  const auto count = static_cast<std::size_t>(graph.variable_count());
  std::vector<Point> rays(count, Point::Zero());
  std::vector<bool> seen(count, false);
  for (const FactorPool& pool : graph.factor_pools()) {
    if (pool.type->arity() != 2) continue;
    for (const std::size_t side : {0U, 1U}) {
      const auto of = static_cast<std::size_t>(pool.variable_pools[side]);
      const std::vector<Point>& here = at[of];
      const std::vector<Point>& there = at[static_cast<std::size_t>(pool.variable_pools[1 - side])];
      if (here.empty() || there.empty() || !is_point(*graph.variable_pools()[of].type)) continue;
      for (std::size_t f = 0; f < pool.size(); ++f) {
        const auto v = static_cast<std::size_t>(pool.variables[2 * f + side]);
        if (seen[v] || pool.losses[f] != 0 ||
            pool.ranks[static_cast<std::size_t>(pool.noises[f])] < 2)
          continue;
        const Point ray = here[static_cast<std::size_t>(pool.slots[2 * f + side])] -
                          there[static_cast<std::size_t>(pool.slots[2 * f + 1 - side])];
        Point& before = rays[v];
        seen[v] = ray.cross(before).squaredNorm() >
                  kApart * kApart * ray.squaredNorm() * before.squaredNorm();
        if (before.isZero(0.0)) before = ray;
      }
    }
  }
  return seen;
}

/// Columns δ with J δ = 0 to rounding.
MatrixXd null_space(MatrixXd J) {
  const Eigen::Index n = J.cols();
  if (J.rows() == 0) return MatrixXd::Identity(n, n);
  VectorXd scale = J.colwise().norm();
  scale = scale.unaryExpr([](double c) { return c > 0.0 ? 1.0 / c : 1.0; });
  J *= scale.asDiagonal();
  Eigen::ColPivHouseholderQR<MatrixXd> qr(J);
  qr.setThreshold(kRounding);
  const Eigen::Index rank = qr.rank();
  MatrixXd basis = MatrixXd::Zero(n, n - rank);  // of R P⁻¹, the pivots last
  if (rank > 0 && rank < n) {
    const MatrixXd R = qr.matrixR().topRows(rank);
    basis.topRows(rank) =
        -R.leftCols(rank).triangularView<Eigen::Upper>().solve(R.rightCols(n - rank));
  }
  basis.bottomRows(n - rank).setIdentity();
  return scale.asDiagonal() * (qr.colsPermutation() * basis);
}

class Alone {
 public:
  Alone(const Graph& graph, const LinearRows& rows) : graph_(graph), rows_(rows) {}

  /// What these factors leave free of a variable. Nothing if a Jacobian is not finite.
  std::optional<MatrixXd> free(int variable, std::span<const std::int32_t> factors) {
    const Eigen::Index n = graph_.type(variable).tangent_size();
    Eigen::Index most = 0, looked_at = n;
    for (const std::int32_t f : factors) most += rows_.rows(f);
    J_.resize(most, n);
    used_ = 0;
    for (const std::int32_t f : factors) {
      if (!append(f, variable)) return std::nullopt;
      if (used_ < looked_at) continue;
      if (null_space(J_.topRows(used_)).cols() == 0) return MatrixXd(n, 0);
      looked_at *= 2;  // mostly a few are enough
    }
    return null_space(J_.topRows(used_));
  }

 private:
  bool append(int factor, int variable) {
    const int m = rows_.rows(factor);
    Eigen::Index columns = 0, first = 0;
    for (const std::int32_t v : rows_.variables(factor)) {
      if (v == variable) first = columns;
      columns += graph_.type(v).tangent_size();
    }
    of_factor_.resize(m, columns);
    rows_.jacobian(factor, {of_factor_.data(), static_cast<std::size_t>(of_factor_.size())});
    if (!of_factor_.allFinite()) return false;
    const auto own = of_factor_.middleCols(first, J_.cols());
    const double largest = own.cwiseAbs().maxCoeff();
    if (!(largest > 0.0)) return true;
    J_.middleRows(used_, m) = own / largest;
    used_ += m;
    return true;
  }

  const Graph& graph_;
  const LinearRows& rows_;
  MatrixXd J_, of_factor_;
  Eigen::Index used_ = 0;  // rows of J
};

}  // namespace

FreeDirections free_alone(const Graph& graph, const Gauge& gauge, const Values& values,
                          const LinearRows& rows) {
  const std::vector<bool> seen = seen_from_two_places(graph, values);
  std::vector<std::vector<std::int32_t>> factors(seen.size());
  for (const FactorPool& pool : graph.factor_pools()) {
    const auto arity = static_cast<std::size_t>(pool.type->arity());
    for (std::size_t k = 0; k < pool.variables.size(); ++k) {
      const auto v = static_cast<std::size_t>(pool.variables[k]);
      if (!seen[v] && !gauge.held[v]) factors[v].push_back(pool.sequence[k / arity]);
    }
  }
  FreeDirections found;
  Alone alone(graph, rows);
  for (std::size_t v = 0; v < factors.size(); ++v) {
    if (factors[v].empty()) continue;
    const std::optional<MatrixXd> basis = alone.free(static_cast<int>(v), factors[v]);
    found.finite = found.finite && basis;
    if (!found.finite) break;
    for (Eigen::Index j = 0; j < basis->cols(); ++j) {
      const auto delta = basis->col(j);
      found.directions.push_back(
          {{{static_cast<int>(v), {delta.begin(), delta.end()}}}, static_cast<int>(v)});
    }
  }
  found.complete = false;
  found.everywhere = found.empty();  // as they move, others hardly come to be
  return found;
}

}  // namespace cairn
