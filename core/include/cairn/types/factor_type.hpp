// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "cairn/runtime/api.hpp"
#include "cairn/types/linearize_sink.hpp"

namespace cairn {

/// The view of a pool that a factor type is given: plain arrays, one entry per factor.
struct FactorView {
  std::size_t size = 0;
  /// size × arity: index of each variable's state within its type's array.
  const std::int32_t* slots = nullptr;
  /// size × measurement_size.
  const double* measurements = nullptr;
  /// n(n+1)/2 doubles each, n = residual size: U upper triangular with UᵀU = information, row by
  /// row.
  const double* sqrt_information = nullptr;
  /// size: which of these is a factor's; null: factor f has the f-th.
  const std::int32_t* noises = nullptr;
  /// arity arrays of states, one for each of the factor's variables in order (the same array twice
  /// if two variables are of one type).
  const double* const* states = nullptr;

  std::size_t noise(std::size_t f) const {
    return noises ? static_cast<std::size_t>(noises[f]) : f;
  }
};

/// A kind of factor (relative pose, landmark seen, prior, …). One object serves all graphs; it has
/// no state but its options. Every function but `evaluate` works on a range of a pool: one virtual
/// call per range, with a fixed-size, inlined loop inside it. Authors don't derive from this: see
/// `define_factor.hpp`.
///
/// Residuals are whitened: r = U e with e the error in the metric's units and UᵀU the information.
class CAIRN_API FactorType {
 public:
  virtual ~FactorType();

  /// The name in files and messages, such as EDGE_SE2.
  virtual std::string_view tag() const = 0;
  virtual int arity() const = 0;
  /// Tags of the variable types, `arity()` of them.
  virtual std::span<const std::string_view> variable_tags() const = 0;
  virtual int residual_size() const = 0;
  virtual int measurement_size() const = 0;  ///< doubles per measurement, in memory and in files
  virtual int tangent_size(int variable) const = 0;
  virtual int ambient_size(int variable) const = 0;

  /// Brings a measurement that was read into canonical form. Empty, or what is wrong with it.
  virtual std::string normalize(double* measurement) const = 0;

  /// out[f - begin] = ‖r_f‖² for f in [begin, end).
  virtual void squared_norms(const FactorView& pool, std::size_t begin, std::size_t end,
                             double* out) const = 0;

  /// Puts what factors [begin, end), in this order, contribute to H = Σ w JᵀJ and g = −Σ w Jᵀr at
  /// the targets of `sink`, each once. `weights` (null: all one): end - begin first derivatives of
  /// the loss. out_squared_norms, unless null, gets ‖r_f‖² as `squared_norms` gives it.
  virtual void linearize(const FactorView& pool, std::size_t begin, std::size_t end,
                         const double* weights, const LinearizeSink& sink,
                         double* out_squared_norms) const = 0;

  /// One factor by itself: the whitened residual (residual_size) and, for each variable whose
  /// pointer is not null, the whitened Jacobian dr/dδ (residual_size × tangent_size, column-major).
  /// For adapters and tests; jacobians itself may be null.
  virtual void evaluate(const double* const* x, const double* measurement,
                        const double* sqrt_information, double* residual,
                        double* const* jacobians) const = 0;

  /// Computes the state of variable `target` that makes the error zero, given the others. False if
  /// the measurement does not determine it. Spanning trees and odometry chains are built with it.
  virtual bool propagate(int target, const double* const* x, const double* measurement,
                         double* out) const = 0;

  /// Whether the measurement is a group element z of the variables' Lie group with x_1 ≈ x_0 z
  /// (both variables of one type): what composition and the chordal initial guess need.
  virtual bool is_relative() const = 0;

  /// Human-readable name of the error metric where there is a choice, else empty.
  virtual std::string_view metric() const { return {}; }

  /// How many degrees of freedom of its variables' absolute states it measures, as `resolve_gauge`
  /// counts them: all of a factor on one variable, none of a factor between variables.
  virtual int absolute_size() const { return arity() == 1 ? residual_size() : 0; }

  /// Whether a graph's robust loss applies. Not where losses are in the measurement already.
  virtual bool takes_loss() const { return true; }
};

}  // namespace cairn
