// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "cairn/types/loss.hpp"
#include "cairn/types/wrapped_factor.hpp"
#include "support/planar_graph.hpp"

namespace cairn::test {

/// Burns down with each evaluation, and throws once when it has burnt; not lit it only counts.
/// Stuck it throws each time.
struct Fuse {
  bool stuck = false;
  std::atomic<int> left{0};
  std::atomic<int> evaluations{0};

  void light(int after) { left = after; }
  bool burns() const { return left > 0; }
  void evaluate() {
    ++evaluations;
    if (stuck || (left > 0 && --left == 0)) throw std::runtime_error("burnt");
  }
};

/// A factor type as another one, whose evaluations burn a fuse.
class ThrowingFactor final : public WrappedFactorType {
 public:
  ThrowingFactor(std::shared_ptr<const FactorType> type, std::shared_ptr<Fuse> fuse)
      : WrappedFactorType(std::move(type)), fuse_(std::move(fuse)) {}

  void evaluate(const double* const* x, const double* measurement, const double* sqrt_information,
                double* residual, double* const* jacobians) const override {
    fuse_->evaluate();
    WrappedFactorType::evaluate(x, measurement, sqrt_information, residual, jacobians);
  }
  bool propagate(int target, const double* const* x, const double* measurement,
                 double* out) const override {
    fuse_->evaluate();
    return WrappedFactorType::propagate(target, x, measurement, out);
  }

 private:
  std::shared_ptr<Fuse> fuse_;
};

/// ρ(s) = 2 (√(1 + s) − 1), whose evaluations burn a fuse.
class ThrowingLoss final : public Loss {
 public:
  explicit ThrowingLoss(std::shared_ptr<Fuse> fuse) : fuse_(std::move(fuse)) {}
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override;
  double second_derivative(double s) const override;

 private:
  std::shared_ptr<Fuse> fuse_;
};

/// The types of the plane, all factors with one fuse.
struct ThrowingTypes {
  std::shared_ptr<Fuse> fuse = std::make_shared<Fuse>();
  PlanarTypes plain;
  std::shared_ptr<const FactorType> relative_pose = throwing(plain.relative_pose),
                                    prior = throwing(plain.prior),
                                    point_seen = throwing(plain.point_seen);
  std::shared_ptr<const Loss> loss = std::make_shared<const ThrowingLoss>(fuse);

 private:
  std::shared_ptr<const FactorType> throwing(std::shared_ptr<const FactorType> type) const {
    return std::make_shared<const ThrowingFactor>(std::move(type), fuse);
  }
};

}  // namespace cairn::test
