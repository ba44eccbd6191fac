// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <span>

#include "cairn/exploration/explorer.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/enum_names.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// From which matrix D-optimality is computed: `exact` is the information matrix of the graph;
/// `laplacian` is the Laplacian of its edges with the weights |Ω|^{1/3}.
enum class OptimalityForm { exact, laplacian };
constexpr auto enum_names(OptimalityForm) {
  return std::to_array<EnumName<OptimalityForm>>(
      {{OptimalityForm::exact, "exact"}, {OptimalityForm::laplacian, "laplacian"}});
}

struct PathOptimalityOptions {
  OptimalityForm by = OptimalityForm::exact;
  /// Which a loop closure must exceed to be made [nats]; negative: `MatchModel::loop_gain`.
  double loop_gain = -1.0;

  static auto fields() {
    using O = PathOptimalityOptions;
    return OptionFields<O>()
        .choice("by", &O::by,
                "D-optimality of the information matrix, or of the Laplacian of the graph whose "
                "edges weigh |Ω|^(1/3), as published")
        .real("loop_gain", &O::loop_gain, -1.0, 1e9,
              "information gain that a loop closure on a path must exceed to be expected [nats]; "
              "negative: that of the policy");
  }
};

/// The D-optimality of a graph with the poses and loop closures of a path.
struct PathOptimality {
  /// ln |Λ| / size, or (ln n + ln |L|) / n: the logarithm of D-optimality.
  double log_optimality = 0.0;
  double log_determinant = 0.0;  ///< ln |Λ|, or ln |L| of the reduced Laplacian
  int size = 0;                  ///< rows of Λ, or n, the poses
  int loops = 0;                 ///< closed on the path
  double length = 0.0;           ///< [m]
};

/// D-optimality of the graphs that paths would lead to, by the determinants of sparse factors (J.
/// A. Placed and J. A. Castellanos, Fast Autonomous Robotic Exploration Using the Underlying Graph
/// Structure, IROS 2021):
///
///     D-opt = |Λ|^{1/size},    and in its place    (n |L|)^{1/n},
///
/// Λ the information matrix of `size` coordinates, L the Laplacian of n poses without the row and
/// column of one that is fixed. Since each is a mean, paths of different lengths can be compared.
///
/// The graph's matrix is factorised once. Each motion of a path adds a pose by odometry, with the
/// determinant of its information. A loop is closed as in `PathInformation` (exact: that of least
/// |Σ| with more than `loop_gain`; Laplacian: that of most gain, 3/2 ln(1 + w R) in place of
/// ½ ln(|S| / |Q|), R the effective resistance between the two poses), from which no known obstacle
/// hides the pose; it multiplies the determinant by what the matrix determinant lemma has for it,
/// with all that the path has closed before.
class CAIRN_API PathOptimalities {
 public:
  /// `solver` must have the ability `LogDeterminant` (block_cholesky has it), outlive this object
  /// and, with `by=laplacian`, serve no other in between; so must what the situation refers to.
  /// Throws `Error` (usage) without poses or that ability, (numerical) where the graph's matrix is
  /// singular.
  PathOptimalities(const Situation& situation, const PathOptimalityOptions& options,
                   LinearSolver& solver);
  PathOptimalities(PathOptimalities&&) noexcept;
  PathOptimalities& operator=(PathOptimalities&&) noexcept;
  ~PathOptimalities();

  /// Of the graph as it is, with a pose where the robot is.
  const PathOptimality& now() const;
  /// Of that after these motions, each in the frame of the pose before.
  PathOptimality along(std::span<const Pose2> motions);

  class Model;

 private:
  std::unique_ptr<Model> model_;
};

}  // namespace cairn
