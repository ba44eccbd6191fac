// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/conformance/samples.hpp"

namespace cairn::conformance {

/// Whether all numbers are finite.
bool is_finite(const State& v);

/// What one call of `evaluate` gives.
struct Evaluation {
  State r;
  std::vector<Eigen::MatrixXd> J;
};

/// A factor type with the types of its variables, samples of both, and guarded calls.
class FactorSamples {
 public:
  FactorSamples(const Subject& subject, Checker& check);

  const FactorType& type() const { return *type_; }
  std::span<const VariableType* const> variables() const { return variables_; }
  std::size_t arity() const { return variables_.size(); }
  std::size_t residual_size() const { return static_cast<std::size_t>(type_->residual_size()); }
  std::size_t tangent(std::size_t v) const { return states_[v].tangent(); }

  /// Whether the declared sizes fit the variables; nothing else can be checked where they don't.
  bool fits() const;

  /// A measurement that `normalize` accepts; none if it refuses a thousand of them.
  std::optional<State> measurement();
  /// The last reason for which `normalize` refused one.
  const std::string& refusal() const { return refusal_; }

  /// Random states, measurement and information. `close`: a variable that the measurement
  /// determines is near where the error is zero, as in an optimised graph.
  std::optional<FactorSample> sample(bool close);

  // The functions of the type of a variable.
  State retract(std::size_t v, const State& x, const State& delta) const {
    return states_[v].retract(x, delta);
  }
  double apart(std::size_t v, const State& x, const State& y) const {
    return states_[v].apart(x, y);
  }

  // The type's own functions.
  /// The state of variable `target` at which the error is zero; none where it says that it knows
  /// none.
  std::optional<State> propagate(const FactorSample& s, std::size_t target) const;
  State residual(const FactorSample& s) const { return evaluate(s, false).r; }
  Evaluation evaluate(const FactorSample& s, bool with_jacobians = true) const;

 private:
  std::vector<Guarded> guarded(const FactorSample& s) const;
  static std::vector<const double*> pointers(std::vector<Guarded>& arrays);
  void examine(std::string_view callback, const std::vector<Guarded>& arrays) const;

  std::shared_ptr<const FactorType> type_;
  Checker& check_;
  RandomNumbers random_;
  std::vector<std::shared_ptr<const VariableType>> owners_;
  std::vector<const VariableType*> variables_;
  std::vector<VariableSamples> states_;
  std::string refusal_;
};

/// Calls body(samples, sample) for random factors, half of them close to a zero error.
template <class Body>
void for_factors(const Subject& subject, Checker& check, const Body& body) {
  FactorSamples samples(subject, check);
  if (!samples.fits()) return check.note("its sizes do not fit its variables (see sizes)");
  for (int k = 0; k < 2 * check.options().samples; ++k) {
    check.sample("", [&] {
      const std::optional<FactorSample> sample = samples.sample(k % 2 == 1);
      check.expect(sample.has_value(), "normalize accepts some measurement within ±2", [&] {
        return fmt::format("it refused 1000 of them, the last because: {}", samples.refusal());
      });
      if (!sample) return;
      check.describe(sample->text());
      body(samples, *sample);
    });
  }
}

/// So many random factors, every other one close to a zero error; fewer if the type accepts no
/// measurement.
std::vector<FactorSample> some_factors(FactorSamples& samples, std::size_t count);

}  // namespace cairn::conformance
