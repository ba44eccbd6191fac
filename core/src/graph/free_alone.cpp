// SPDX-License-Identifier: BSD-3-Clause
#include "free_alone.hpp"

#include <cstddef>
#include <cstdint>
#include <map>
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

/// The points that are seen from two places, by factors that measure a direction at least.
std::vector<char> seen_from_two_places(const Graph& graph, const Values& values) {
  std::vector<std::vector<Point>> at;
  for (std::size_t p = 0; p < graph.variable_pools().size(); ++p)
    at.push_back(positions(graph.variable_pools()[p], values.pools[p]));
  const auto count = static_cast<std::size_t>(graph.variable_count());
  std::vector<Point> rays(count, Point::Zero());
  std::vector<char> seen(count, false);
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
  if (rank == n) return MatrixXd(n, 0);
  MatrixXd basis = MatrixXd::Zero(n, n - rank);  // of R P⁻¹, the pivots last
  if (rank > 0) {
    const MatrixXd R = qr.matrixR().topRows(rank);
    basis.topRows(rank) =
        -R.leftCols(rank).triangularView<Eigen::Upper>().solve(R.rightCols(n - rank));
  }
  basis.bottomRows(n - rank).setIdentity();
  return scale.asDiagonal() * (qr.colsPermutation() * basis);
}

/// Rows on one variable, each factor's scaled to one.
struct Own {
  MatrixXd J;
  Eigen::Index used = 0;
  Eigen::Index look_at = 0;  ///< as soon as there are so many: mostly a few are enough
};

/// Goes through the factors of variables that are not settled yet.
class Alone {
 public:
  Alone(const Graph& graph, const LinearRows& rows, std::vector<char> settled)
      : graph_(graph), rows_(rows), settled_(std::move(settled)) {}

  /// False if a Jacobian is not finite.
  bool run() {
    for (const FactorPool& pool : graph_.factor_pools()) {
      const auto arity = static_cast<std::size_t>(pool.type->arity());
      for (std::size_t k = 0; k < pool.variables.size(); ++k) {
        const std::int32_t v = pool.variables[k];
        if (!settled_[static_cast<std::size_t>(v)] && !look_at(v, pool.sequence[k / arity]))
          return false;
      }
    }
    return true;
  }

  std::vector<FreeDirection> directions() const {
    std::vector<FreeDirection> all;
    for (const auto& [v, own] : own_) {
      const MatrixXd basis = null_space(own.J.topRows(own.used));
      for (Eigen::Index j = 0; j < basis.cols(); ++j) {
        const auto delta = basis.col(j);
        all.push_back({{{v, {delta.begin(), delta.end()}}}, v});
      }
    }
    return all;
  }

 private:
  bool look_at(std::int32_t v, int factor) {
    Own& own = own_[v];
    const Eigen::Index n = graph_.type(v).tangent_size();
    if (own.look_at == 0) own = {MatrixXd(2 * n, n), 0, n};
    if (!append(v, factor, own)) return false;
    if (own.used < own.look_at) return true;
    own.look_at *= 2;
    if (null_space(own.J.topRows(own.used)).cols() > 0) return true;
    settled_[static_cast<std::size_t>(v)] = true;
    own_.erase(v);
    return true;
  }

  bool append(std::int32_t variable, int factor, Own& own) {
    const int m = rows_.rows(factor);
    Eigen::Index columns = 0, first = 0;
    for (const std::int32_t v : rows_.variables(factor)) {
      if (v == variable) first = columns;
      columns += graph_.type(v).tangent_size();
    }
    J_.resize(m, columns);
    rows_.jacobian(factor, {J_.data(), static_cast<std::size_t>(J_.size())});
    if (!J_.allFinite()) return false;
    const auto block = J_.middleCols(first, own.J.cols());
    const double largest = block.cwiseAbs().maxCoeff();
    if (!(largest > 0.0)) return true;
    if (own.used + m > own.J.rows()) own.J.conservativeResize(2 * (own.used + m), Eigen::NoChange);
    own.J.middleRows(own.used, m) = block / largest;
    own.used += m;
    return true;
  }

  const Graph& graph_;
  const LinearRows& rows_;
  std::vector<char> settled_;        // by variable
  std::map<std::int32_t, Own> own_;  // of those that are not
  MatrixXd J_;
};

}  // namespace

FreeDirections free_alone(const Graph& graph, const Gauge& gauge, const Values& values,
                          const LinearRows& rows) {
  std::vector<char> settled = seen_from_two_places(graph, values);
  for (std::size_t v = 0; v < settled.size(); ++v) settled[v] = settled[v] || gauge.held[v];
  Alone alone(graph, rows, std::move(settled));
  FreeDirections found;
  found.complete = false;
  found.finite = alone.run();
  if (found.finite) found.directions = alone.directions();
  found.everywhere = found.empty();  // as they move, others hardly come to be
  return found;
}

}  // namespace cairn
