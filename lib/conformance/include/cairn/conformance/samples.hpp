// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "cairn/conformance/checker.hpp"
#include "cairn/io/random_numbers.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/types/factor_type.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn::conformance {

using State = std::vector<double>;

/// Euclidean.
CAIRN_API double norm(std::span<const double> v);
CAIRN_API State difference(State a, const State& b);

/// Random states and tangent vectors of any type, and calls of its functions in guarded arrays.
class CAIRN_API VariableSamples {
 public:
  VariableSamples(const VariableType& type, Checker& check, std::uint64_t seed)
      : type_(type), check_(check), random_(RandomNumbers::mixed(seed)) {}

  const VariableType& type() const { return type_; }
  std::size_t ambient() const { return static_cast<std::size_t>(type_.ambient_size()); }
  std::size_t tangent() const { return static_cast<std::size_t>(type_.tangent_size()); }

  /// The norms of the steps on which laws are checked: zero, tiny, …; below π for poses, and not
  /// above one where nothing is known of the type's charts.
  std::vector<double> norms() const;
  /// A step of that norm in a random direction.
  State step(double norm);
  /// A state some steps away from the identity.
  State state();

  // The type's own functions.
  State identity() const;
  State retract(const State& x, const State& delta) const;
  State local(const State& x, const State& y) const;
  /// ‖local(x, y)‖
  double apart(const State& x, const State& y) const { return norm(local(x, y)); }

 private:
  const VariableType& type_;
  Checker& check_;
  RandomNumbers random_;
};

/// One factor: states of its variables, a measurement, and U packed.
struct CAIRN_API FactorSample {
  std::vector<State> x;
  State z, U;

  std::string text() const;
};

}  // namespace cairn::conformance
