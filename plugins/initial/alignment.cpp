// SPDX-License-Identifier: BSD-3-Clause
#include "alignment.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/update/placement.hpp"

namespace cairn::initial {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Of iterated closest points; one is enough where positions are measured wholly.
constexpr int kIterations = 100;
constexpr std::size_t kMostFixes = 200;
/// Of a motion that is none, and of an orientation that does not change.
constexpr double kSmall = 1e-9;
/// How much the rotation that changes least is preferred, of the spread of the positions.
constexpr double kLeastTurn = 1e-9;

std::vector<double> moved(const VariableType& type, std::span<const double> x, const Pose& motion) {
  const Placement& placement = *type.placement();
  const auto n = static_cast<std::size_t>(placement.dimension());
  std::vector<double> R(n * n), t(n), y(x.begin(), x.end());
  placement.split(x.data(), R.data(), t.data());
  const auto d = placement.dimension();
  const Eigen::MatrixXd Q = motion.R.topLeftCorner(d, d);
  Eigen::Map<Eigen::MatrixXd> turned(R.data(), d, d);
  Eigen::Map<Eigen::VectorXd> shifted(t.data(), d);
  turned = (Q * turned).eval();
  shifted = (Q * shifted).eval() + motion.t.head(d);
  placement.join(placement.has_orientation() ? R.data() : nullptr, t.data(), y.data());
  return y;
}

/// An absolute measurement of a part of a position, or of all of it.
struct Fix {
  int factor = 0, variable = 0;
};

/// The state nearest to x that meets the measurement.
std::optional<std::vector<double>> met(const Graph& graph, const Fix& fix,
                                       std::span<const double> x) {
  std::vector<double> state(x.begin(), x.end());
  const double* const states[] = {state.data()};
  if (!place_in_part(graph.factor_type(fix.factor), graph.type(fix.variable),
                     graph.sqrt_information(fix.factor), 0, states,
                     graph.measurement(fix.factor).data(), state))
    return std::nullopt;
  return state;
}

/// Whether it measures something of the position, and nothing of the orientation.
bool is_of_position(const Graph& graph, const Fix& fix) {
  const VariableType& type = graph.type(fix.variable);
  const Pose aside{Matrix3d::Identity(), type.placement()->dimension() == 2
                                             ? Vector3d(0.6, 0.7, 0.0)
                                             : Vector3d(0.5, 0.6, 0.7)};
  const auto from = met(graph, fix, graph.state(fix.variable));
  if (!from) return false;
  const std::vector<double> beside = moved(type, *from, aside);
  const auto back = met(graph, fix, beside);
  if (!back) return false;
  const Pose a = pose_of(type, beside), b = pose_of(type, *back);
  return (a.R - b.R).norm() < kSmall && (a.t - b.t).norm() > kSmall;
}

/// The rigid motion that takes points to others with the least sum of squares (Horn 1987); of
/// several, the one that turns least.
Pose best_motion(const std::vector<Vector3d>& from, const std::vector<Vector3d>& to, bool planar) {
  Vector3d a = Vector3d::Zero(), b = Vector3d::Zero();
  for (std::size_t k = 0; k < from.size(); ++k) {
    a += from[k];
    b += to[k];
  }
  a /= static_cast<double>(from.size());
  b /= static_cast<double>(from.size());
  Matrix3d M = Matrix3d::Zero();
  double spread = 0.0;
  for (std::size_t k = 0; k < from.size(); ++k) {
    M += (to[k] - b) * (from[k] - a).transpose();
    spread += (from[k] - a).squaredNorm() + (to[k] - b).squaredNorm();
  }
  Pose motion;
  if (spread > 0.0) {
    M += kLeastTurn * spread * Matrix3d::Identity();
    if (planar) {  // no turn over
      const double angle = std::atan2(M(1, 0) - M(0, 1), M(0, 0) + M(1, 1));
      motion.R.topLeftCorner<2, 2>() << std::cos(angle), -std::sin(angle), std::sin(angle),
          std::cos(angle);
    } else {
      const Eigen::JacobiSVD<Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
      Matrix3d U = svd.matrixU();
      if ((U * svd.matrixV().transpose()).determinant() < 0.0) U.col(2) = -U.col(2);
      motion.R = U * svd.matrixV().transpose();
    }
  }
  motion.t = b - motion.R * a;
  return motion;
}

Pose after(const Pose& later, const Pose& first) {
  return {later.R * first.R, later.R * first.t + later.t};
}

/// Nothing: a measurement cannot be met.
std::optional<Pose> alignment(const Graph& graph, const std::vector<Fix>& fixes) {
  Pose all;
  const bool planar = graph.type(fixes.front().variable).placement()->dimension() == 2;
  for (int k = 0; k < kIterations; ++k) {
    std::vector<Vector3d> from, to;
    for (const Fix& fix : fixes) {
      const VariableType& type = graph.type(fix.variable);
      const std::vector<double> here = moved(type, graph.state(fix.variable), all);
      const auto there = met(graph, fix, here);
      if (!there) return std::nullopt;
      from.push_back(position(type, here));
      to.push_back(position(type, *there));
    }
    const Pose step = best_motion(from, to, planar);
    all = after(step, all);
    const double size = 1.0 + all.t.norm();
    if ((step.R - Matrix3d::Identity()).norm() < kSmall && step.t.norm() < kSmall * size) break;
  }
  return all;
}

/// Σ ‖r‖² of the factors on single variables, at their states after a motion.
double absolute_chi2(const Graph& graph, std::span<const int> factors, const Pose& motion) {
  double sum = 0.0;
  for (const int f : factors) {
    const int v = graph.factor_variables(f)[0];
    const std::vector<double> x = moved(graph.type(v), graph.state(v), motion);
    const double* const states[] = {x.data()};
    Eigen::VectorXd r(graph.factor_type(f).residual_size());
    graph.factor_type(f).evaluate(states, graph.measurement(f).data(),
                                  graph.sqrt_information(f).data(), r.data(), nullptr);
    sum += r.squaredNorm();
  }
  return sum;
}

/// What is known of where a part of the graph is.
struct Part {
  bool held = false;          ///< by a constant variable, or a prior that measures a pose wholly
  std::vector<int> absolute;  ///< factors on single variables
};

bool measures_pose(const Graph& graph, int factor) {
  const int v = graph.factor_variables(factor)[0];
  return has_orientation(graph.type(v)) &&
         graph.information_rank(factor) >= graph.type(v).tangent_size();
}

bool is_absolute(const FactorPool& pool) {
  return pool.type->arity() == 1 && pool.type->absolute_size() > 0 && pool.size() > 0;
}

std::vector<Part> parts(const Graph& graph, const Gauge& gauge) {
  std::vector<Part> all(static_cast<std::size_t>(gauge.components));
  for (std::size_t v = 0; v < gauge.held.size(); ++v)
    if (gauge.held[v]) all[static_cast<std::size_t>(gauge.component[v])].held = true;
  for (const FactorPool& pool : graph.factor_pools()) {
    if (!is_absolute(pool)) continue;
    for (std::size_t k = 0; k < pool.size(); ++k) {
      const int f = pool.sequence[k], v = pool.variables[k];
      if (!has_position(graph.type(v))) continue;
      Part& part = all[static_cast<std::size_t>(gauge.component[static_cast<std::size_t>(v)])];
      part.held = part.held || measures_pose(graph, f);
      part.absolute.push_back(f);
    }
  }
  return all;
}

/// Of so many at most, spread over all: more determine six numbers hardly better.
std::vector<Fix> fixes_of(const Graph& graph, const Part& part) {
  const std::size_t count = part.absolute.size(), step = (count + kMostFixes - 1) / kMostFixes;
  std::vector<Fix> fixes;
  for (std::size_t k = 0; k < count; k += step) {
    const int f = part.absolute[k];
    const Fix fix{f, graph.factor_variables(f)[0]};
    if (is_of_position(graph, fix)) fixes.push_back(fix);
  }
  return fixes;
}

}  // namespace

void align_with_positions(Graph& graph) {
  if (std::ranges::none_of(graph.factor_pools(), is_absolute)) return;
  const Gauge gauge = resolve_gauge(graph);
  const std::vector<Part> all = parts(graph, gauge);
  std::vector<std::optional<Pose>> motions(all.size());
  for (std::size_t c = 0; c < all.size(); ++c) {
    const Part& part = all[c];
    if (part.held || part.absolute.empty()) continue;
    const std::vector<Fix> fixes = fixes_of(graph, part);
    if (fixes.empty()) continue;
    const std::optional<Pose> motion = alignment(graph, fixes);
    if (motion &&
        absolute_chi2(graph, part.absolute, *motion) < absolute_chi2(graph, part.absolute, Pose()))
      motions[c] = motion;
  }
  for (int v = 0; v < graph.variable_count(); ++v) {
    const auto& motion =
        motions[static_cast<std::size_t>(gauge.component[static_cast<std::size_t>(v)])];
    if (!motion || !has_position(graph.type(v))) continue;
    graph.set_state(v, moved(graph.type(v), graph.state(v), *motion));
  }
}

}  // namespace cairn::initial
