// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "cairn/linear/block_matrix.hpp"

namespace cairn {

/// Powell's dogleg path at one linearisation: from zero to the Cauchy point (the minimum of the
/// model along the steepest descent), from there to the Gauss-Newton point. Lengths are measured in
/// the norm ‖δ‖_D = √(δᵀDδ) with D the diagonal of H, so that radians and metres go together.
class DoglegPath {
 public:
  explicit DoglegPath(std::size_t size) : cauchy_(size), product_(size), newton_(size), D_(size) {}

  /// Room for the Gauss-Newton step H⁻¹g, to be filled before `prepare`.
  std::span<double> newton() { return newton_; }
  void prepare(const BlockMatrix& H, std::span<const double> g, std::span<const double> diagonal,
               std::span<const double> min_diagonal);

  struct Step {
    double length;   ///< in the norm of D
    double promise;  ///< by how much the model says that chi2 falls
  };
  /// The point of the path at distance `radius`, or its end if that is nearer.
  Step at(double radius, std::span<double> out) const;
  /// The end of the path, the Gauss-Newton step.
  Step end(std::span<double> out) const;

 private:
  Step combine(double a, double b, std::span<double> out) const;
  double norm(std::span<const double> v) const;

  std::vector<double> cauchy_;
  std::vector<double> product_;  // H times the steepest descent
  std::vector<double> newton_;
  std::vector<double> D_;
  double cauchy_length_ = 0.0, newton_length_ = 0.0;
  double cauchy_slope_ = 0.0, newton_slope_ = 0.0;  // gᵀ times the step
};

}  // namespace cairn
