// SPDX-License-Identifier: BSD-3-Clause
#include "lower_minimum.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include <fmt/core.h>
#include <Eigen/Core>

#include "cairn/graph/gauge.hpp"
#include "cairn/linear/linearizer.hpp"
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostUnknowns = 100;
constexpr int kDirections = 3;
constexpr double kGauge = 1e-12;    // of the eigenvalues of H, scaled to unit diagonal
constexpr double kLower = 1e-6;     // of chi2
constexpr double kSettled = 1e-12;  // of chi2, in one step
constexpr double kExact = 1e-12;    // chi2 per measured number: what is left is rounding

std::span<const double> numbers(const VectorXd& v) {
  return {v.data(), static_cast<std::size_t>(v.size())};
}

/// Whether cameras and points are few, with less than twice as many measurements as unknowns, which
/// do not fit exactly.
bool is_poor(const Graph& graph, const Gauge& gauge, double chi2) {
  std::int64_t unknowns = 0, measured = 0;
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (!gauge.held[v]) unknowns += graph.type(v).tangent_size();
  }
  for (int f = 0; f < graph.factor_count(); ++f) measured += graph.information_rank(f);
  return unknowns > 0 && unknowns <= kMostUnknowns && measured < 2 * unknowns &&
         chi2 > kExact * static_cast<double>(measured);
}

/// The same normal equations as those of a large graph, as dense matrices.
class DenseDescent {
 public:
  DenseDescent(const Graph& graph, const Gauge& gauge)
      : linearizer_(graph, gauge.held),
        blocks_(linearizer_.structure()),
        g_(linearizer_.structure().size()),
        H_(g_.size(), g_.size()) {}

  void linearize(const Values& values) {
    chi2_ =
        linearizer_.linearize(values, blocks_, {g_.data(), static_cast<std::size_t>(g_.size())});
    VectorXd unit = VectorXd::Zero(g_.size()), column(g_.size());
    for (Eigen::Index k = 0; k < g_.size(); ++k) {
      unit[k] = 1.0;
      blocks_.multiply(numbers(unit), {column.data(), static_cast<std::size_t>(column.size())});
      H_.col(k) = column;
      unit[k] = 0.0;
    }
  }
  /// One standard deviation along each of the directions that are determined worst.
  MatrixXd worst_determined() const {
    VectorXd scale = H_.diagonal().cwiseSqrt();
    for (double& s : scale) s = s > 0.0 ? 1.0 / s : 0.0;
    const Eigen::SelfAdjointEigenSolver<MatrixXd> of(
        MatrixXd(scale.asDiagonal() * H_ * scale.asDiagonal()));
    const VectorXd& values = of.eigenvalues();
    const auto first = std::ranges::find_if(
        values, [&](double value) { return value > kGauge * values[values.size() - 1]; });
    const Eigen::Index free = first - values.begin();
    const Eigen::Index count = std::min<Eigen::Index>(kDirections, values.size() - free);
    MatrixXd steps(g_.size(), count);
    for (Eigen::Index k = 0; k < count; ++k)
      steps.col(k) =
          scale.asDiagonal() * of.eigenvectors().col(free + k) / std::sqrt(values[free + k]);
    return steps;
  }
  Values moved(const Values& from, const VectorXd& step) const {
    Values to = from;
    linearizer_.retract(from, numbers(step), to);
    return to;
  }

  /// Levenberg-Marquardt, until chi2 is below that, or settles.
  double minimize(Values values, double enough) {
    constexpr int kMostIterations = 500;
    constexpr double kMostDamping = 1e12;
    linearize(values);
    double lambda = 1e-4;
    for (int k = 0; k < kMostIterations && !(chi2_ < enough) && lambda < kMostDamping; ++k) {
      MatrixXd damped = H_;
      damped.diagonal() += lambda * H_.diagonal();
      const Eigen::LLT<MatrixXd> llt(damped);
      Values trial = values;
      double chi2 = chi2_;
      if (llt.info() == Eigen::Success) {
        trial = moved(values, VectorXd(llt.solve(g_)));
        chi2 = linearizer_.chi2(trial);
      }
      if (!(chi2 < chi2_)) {
        lambda *= 10.0;
        continue;
      }
      const bool settled = chi2_ - chi2 <= kSettled * chi2_;
      values = std::move(trial);
      lambda *= 0.1;
      linearize(values);
      if (settled) break;
    }
    return chi2_;
  }

 private:
  Linearizer linearizer_;
  BlockMatrix blocks_;
  VectorXd g_;
  MatrixXd H_;
  double chi2_ = 0.0;
};

}  // namespace

std::string lower_minimum_nearby(const Graph& graph, double chi2) {
  if (graph.variable_count() > kMostUnknowns || !std::isfinite(chi2)) return {};
  const Gauge gauge = resolve_gauge(graph);
  if (gauge.left_free.empty() || !is_poor(graph, gauge, chi2)) return {};
  DenseDescent descent(graph, gauge);
  descent.linearize(graph.values());
  const MatrixXd steps = descent.worst_determined();
  const double enough = (1.0 - kLower) * chi2;
  for (Eigen::Index k = 0; k < steps.cols(); ++k) {
    for (const double sigmas : {-1.0, 1.0, -3.0, 3.0}) {
      const double other =
          descent.minimize(descent.moved(graph.values(), sigmas * steps.col(k)), enough);
      if (!(other < enough)) continue;
      return fmt::format(
          "there is another minimum, whose chi2 is at most {:.6g} instead of {:.6g}, within what "
          "the measurements leave uncertain: they are too few to distinguish the two; more of "
          "them, or priors on the cameras, can",
          other, chi2);
    }
  }
  return {};
}

}  // namespace cairn
