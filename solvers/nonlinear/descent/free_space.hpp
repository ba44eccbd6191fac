// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/free_directions.hpp"
#include "cairn/linear/linearizer.hpp"

namespace cairn {

/// The null space of H as the steps of an optimizer need it: H δ = g has a solution in all other
/// directions, and in these the estimate is to stay.
class FreeSpace {
 public:
  FreeSpace() = default;
  /// `diagonal`: that of H, size of the linearizer's structure.
  FreeSpace(const Graph& graph, const FreeDirections& free, const Linearizer& linearizer,
            std::span<const double> diagonal);

  bool empty() const { return parts_.empty(); }
  /// What makes H regular when it is added to its diagonal: a number at as many unknowns as the
  /// space has dimensions, zero elsewhere.
  std::span<const double> pins() const { return pins_; }
  /// Takes out of a step what lies in the space, in a metric that weighs all numbers of a variable
  /// in one unit by the largest of them on H's diagonal, so that a landmark moves along what is
  /// measured of it alone, and rotations of poses far more, so that a map with one altitude is
  /// shifted and not tilted. What factors see of the step stays the same.
  void project(std::span<double> step) const;

 private:
  /// Directions that share variables: V orthonormal in that metric.
  struct Part {
    std::vector<std::int64_t> rows;
    Eigen::VectorXd root;   ///< of the metric
    Eigen::VectorXd least;  ///< of pins
    Eigen::MatrixXd V;
  };
  void pin(const Part& part, std::span<const double> diagonal);

  std::vector<Part> parts_;
  std::vector<double> pins_;
};

}  // namespace cairn
