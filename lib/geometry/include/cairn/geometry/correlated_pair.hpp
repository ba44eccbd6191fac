// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/runtime/api.hpp"
#include "cairn/types/evaluated_factor.hpp"
#include "cairn/types/never_throws.hpp"

namespace cairn {

/// Two relative measurements between three poses whose errors are correlated: residual, measurement
/// and information are those of the two one after the other, the information one matrix (Mazuran,
/// Burgard and Tipaldi, IJRR 2016, use such pairs to approximate what marginalisation leaves).
///
/// It is on three variables; `first` and `second` say which two of them each measurement is
/// between, in its order. The whole of its kind is one factor type for each such pattern. It cannot
/// be written to files.
class CAIRN_API CorrelatedPair final : public EvaluatedFactorType, public NeverThrows {
 public:
  static constexpr std::string_view kTag = "CORRELATED_PAIR";

  /// `relative` is on two variables of one type. Throws `Error` (usage) if it is not, or if the two
  /// measurements are not between three variables.
  CorrelatedPair(std::shared_ptr<const FactorType> relative, std::array<int, 2> first,
                 std::array<int, 2> second);

  /// Which two of its variables each measurement is between.
  const std::array<std::array<int, 2>, 2>& between() const { return between_; }

  std::string_view tag() const override { return kTag; }
  int arity() const override { return 3; }
  std::span<const std::string_view> variable_tags() const override { return tags_; }
  int residual_size() const override { return 2 * relative_->residual_size(); }
  int measurement_size() const override { return 2 * relative_->measurement_size(); }
  int tangent_size(int) const override { return relative_->tangent_size(0); }
  int ambient_size(int) const override { return relative_->ambient_size(0); }
  std::string normalize(double* measurement) const override;
  void evaluate(const double* const* x, const double* measurement, const double* sqrt_information,
                double* residual, double* const* jacobians) const override;
  bool propagate(int target, const double* const* x, const double* measurement,
                 double* out) const override;
  bool is_relative() const override { return false; }

 private:
  std::shared_ptr<const FactorType> relative_;
  std::array<std::array<int, 2>, 2> between_;
  std::vector<std::string_view> tags_;
  std::vector<double> unit_;  ///< information of `relative_` that whitens nothing
};

}  // namespace cairn
