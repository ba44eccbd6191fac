// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/runtime/api.hpp"
#include "cairn/types/evaluated_factor.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn {

/// Base of factor types that are evaluated for many factors at once, because a call costs much more
/// than a factor: those written in another language, or on another device. All factors of a pool
/// are evaluated in one call, whose results serve the ranges that the linearizer asks for, until a
/// number of the states or measurements changes. So `residuals` and `jacobians` must depend on
/// their arguments alone. Types of fixed size in C++ are much faster by `define_factor.hpp`.
///
/// Calls may come from any thread of the arena, one at a time.
class CAIRN_API BatchedFactorType : public EvaluatedFactorType {
 public:
  /// What there is to know of the type besides its residual.
  struct Description {
    std::string tag;
    std::vector<std::shared_ptr<const VariableType>> variables;
    int residual_size = 0;
    int measurement_size = 0;
  };
  /// Throws `Error` (usage) for an empty tag, no variables, or a size below 1 (a measurement may
  /// have none).
  explicit BatchedFactorType(Description description);
  ~BatchedFactorType() override;

  /// The errors e of `count` factors, not whitened: count × residual size. states[k]: count ×
  /// ambient size, the state of variable k of each factor; measurements: count × measurement size.
  /// All row by row.
  virtual void residuals(std::size_t count, std::span<const double* const> states,
                         const double* measurements, double* out) const = 0;
  /// de/dδ of each variable k: out[k] is count × residual size × tangent size, each matrix row by
  /// row. Unless overridden, central differences of `residuals`, two calls for each number of δ,
  /// with steps of 6e-6 m or rad: right to some 1e-9 where states are not far beyond 1e3.
  virtual void jacobians(std::size_t count, std::span<const double* const> states,
                         const double* measurements, double* const* out) const;

  const std::vector<std::shared_ptr<const VariableType>>& variables() const {
    return description_.variables;
  }

  std::string_view tag() const override { return description_.tag; }
  int arity() const override { return static_cast<int>(description_.variables.size()); }
  std::span<const std::string_view> variable_tags() const override { return tags_; }
  int residual_size() const override { return description_.residual_size; }
  int measurement_size() const override { return description_.measurement_size; }
  int tangent_size(int variable) const override;
  int ambient_size(int variable) const override;
  std::string normalize(double*) const override { return {}; }
  bool propagate(int, const double* const*, const double*, double*) const override { return false; }
  bool is_relative() const override { return false; }

  void squared_norms(const FactorView& pool, std::size_t begin, std::size_t end,
                     double* out) const override;
  void linearize(const FactorView& pool, std::size_t begin, std::size_t end, const double* weights,
                 const LinearizeSink& sink, double* out_squared_norms) const override;
  void evaluate(const double* const* x, const double* measurement, const double* sqrt_information,
                double* residual, double* const* jacobians) const override;

 private:
  struct Batch;
  class Evaluated;
  std::shared_ptr<const Batch> batch(const FactorView& pool, std::size_t begin, std::size_t end,
                                     bool with_jacobians) const;

  Description description_;
  std::vector<std::string_view> tags_;
  mutable std::mutex mutex_;
  mutable std::shared_ptr<const Batch> latest_;  // of the pool that was evaluated last
};

}  // namespace cairn
