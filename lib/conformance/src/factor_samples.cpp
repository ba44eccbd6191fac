// SPDX-License-Identifier: BSD-3-Clause
#include "factor_samples.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn::conformance {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;

bool is_finite(const State& v) {
  return std::ranges::all_of(v, [](double x) { return std::isfinite(x); });
}

FactorSamples::FactorSamples(const Subject& subject, Checker& check)
    : type_(subject.registry.factor_type(subject.name)),
      check_(check),
      random_(RandomNumbers::mixed(check.options().seed + 17)) {
  for (const std::string_view tag : type_->variable_tags()) {
    owners_.push_back(subject.registry.variable_type(tag));
    variables_.push_back(owners_.back().get());
    states_.emplace_back(*owners_.back(), check, check.options().seed + owners_.size());
  }
}

bool FactorSamples::fits() const {
  if (type_->arity() != static_cast<int>(arity()) || arity() == 0) return false;
  for (std::size_t v = 0; v < arity(); ++v) {
    const int k = static_cast<int>(v);
    if (type_->tangent_size(k) != variables_[v]->tangent_size() ||
        type_->ambient_size(k) != variables_[v]->ambient_size())
      return false;
  }
  return type_->residual_size() > 0 && type_->measurement_size() >= 0;
}

std::optional<State> FactorSamples::measurement() {
  const auto size = static_cast<std::size_t>(type_->measurement_size());
  for (int attempt = 0; attempt < 1000; ++attempt) {
    State z(size);
    for (double& number : z) number = random_.uniform(attempt % 2 == 0 ? -2.0 : 0.1, 2.0);
    Guarded in = Guarded::in_place("measurement", z);
    refusal_ = check_.call("normalize", {&in}, [&] { return type_->normalize(in.data()); });
    if (refusal_.empty()) return in.values();
  }
  return {};
}

std::optional<FactorSample> FactorSamples::sample(bool close) {
  FactorSample s;
  for (VariableSamples& samples : states_) s.x.push_back(samples.state());
  std::optional<State> z = measurement();
  if (!z) return {};
  s.z = std::move(*z);
  for (int row = 0; row < type_->residual_size(); ++row) {
    s.U.push_back(random_.uniform(0.5, 3.0));
    for (int column = row + 1; column < type_->residual_size(); ++column)
      s.U.push_back(random_.uniform(-1.0, 1.0));
  }
  for (std::size_t v = arity(); close && v-- > 0;) {
    const std::optional<State> at = propagate(s, v);
    if (!at) continue;
    s.x[v] = states_[v].retract(*at, states_[v].step(0.01));
    break;
  }
  return s;
}

std::optional<State> FactorSamples::propagate(const FactorSample& s, std::size_t target) const {
  std::vector<Guarded> in = guarded(s);
  Guarded z("measurement", s.z), out("out", states_[target].ambient());
  std::vector<const double*> x = pointers(in);
  x[target] = nullptr;  // it must not read what it computes
  const bool done = check_.call("propagate", {&z, &out}, [&] {
    return type_->propagate(static_cast<int>(target), x.data(), z.data(), out.data());
  });
  if (!done) return {};
  return out.values();
}

Evaluation FactorSamples::evaluate(const FactorSample& s, bool with_jacobians) const {
  std::vector<Guarded> in = guarded(s);
  Guarded z("measurement", s.z), U("sqrt_information", s.U), r("residual", residual_size());
  std::vector<Guarded> J;
  std::vector<double*> J_pointers;
  for (std::size_t v = 0; v < arity(); ++v)
    J.emplace_back(fmt::format("jacobians[{}]", v), residual_size() * tangent(v));
  for (Guarded& one : J) J_pointers.push_back(one.data());
  const std::vector<const double*> x = pointers(in);
  check_.call("evaluate", {&z, &U, &r}, [&] {
    type_->evaluate(x.data(), z.data(), U.data(), r.data(),
                    with_jacobians ? J_pointers.data() : nullptr);
  });
  examine("evaluate", in);
  examine("evaluate", J);
  Evaluation result{r.values(), {}};
  for (std::size_t v = 0; v < arity() && with_jacobians; ++v) {
    const State values = J[v].values();
    result.J.emplace_back(Map<const MatrixXd>(values.data(), static_cast<Index>(residual_size()),
                                              static_cast<Index>(tangent(v))));
  }
  return result;
}

std::vector<Guarded> FactorSamples::guarded(const FactorSample& s) const {
  std::vector<Guarded> all;
  for (std::size_t v = 0; v < s.x.size(); ++v) all.emplace_back(fmt::format("x[{}]", v), s.x[v]);
  return all;
}

std::vector<const double*> FactorSamples::pointers(std::vector<Guarded>& arrays) {
  std::vector<const double*> all;
  for (Guarded& array : arrays) all.push_back(array.data());
  return all;
}

void FactorSamples::examine(std::string_view callback, const std::vector<Guarded>& arrays) const {
  for (const Guarded& array : arrays) {
    const std::string damage = array.damage();
    check_.expect(damage.empty(), fmt::format("{} writes to its output alone", callback),
                  [&] { return damage; });
  }
}

std::vector<FactorSample> some_factors(FactorSamples& samples, std::size_t count) {
  std::vector<FactorSample> factors;
  while (factors.size() < count) {
    std::optional<FactorSample> one = samples.sample(factors.size() % 2 == 1);
    if (!one) break;
    factors.push_back(std::move(*one));
  }
  return factors;
}

}  // namespace cairn::conformance
