// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "cairn/types/evaluated_factor.hpp"

namespace cairn {

/// Base of factor types that are another one but for what they override: to count evaluations, or
/// to fail on purpose.
class WrappedFactorType : public EvaluatedFactorType {
 public:
  explicit WrappedFactorType(std::shared_ptr<const FactorType> type) : type_(std::move(type)) {}

  std::string_view tag() const override { return type_->tag(); }
  int arity() const override { return type_->arity(); }
  std::span<const std::string_view> variable_tags() const override {
    return type_->variable_tags();
  }
  int residual_size() const override { return type_->residual_size(); }
  int measurement_size() const override { return type_->measurement_size(); }
  int tangent_size(int variable) const override { return type_->tangent_size(variable); }
  int ambient_size(int variable) const override { return type_->ambient_size(variable); }
  std::string normalize(double* measurement) const override {
    return type_->normalize(measurement);
  }
  void evaluate(const double* const* x, const double* measurement, const double* sqrt_information,
                double* residual, double* const* jacobians) const override {
    type_->evaluate(x, measurement, sqrt_information, residual, jacobians);
  }
  bool propagate(int target, const double* const* x, const double* measurement,
                 double* out) const override {
    return type_->propagate(target, x, measurement, out);
  }
  bool is_relative() const override { return type_->is_relative(); }

 private:
  std::shared_ptr<const FactorType> type_;
};

}  // namespace cairn
