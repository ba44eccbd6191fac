// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/conformance/samples.hpp"

#include <cmath>
#include <cstdint>

namespace cairn::conformance {

double norm(std::span<const double> v) {
  double sum = 0.0;
  for (const double x : v) sum += x * x;
  return std::sqrt(sum);
}

State difference(State a, const State& b) {
  for (std::size_t k = 0; k < a.size(); ++k) a[k] -= b[k];
  return a;
}

std::vector<double> VariableSamples::norms() const {
  std::vector<double> all{0.0, 1e-9, 1e-5, 1e-2, 0.5, 1.0};
  const Placement* placement = type_.placement();
  if (placement) all.push_back(placement->has_orientation() ? 3.0 : 100.0);
  return all;
}

State VariableSamples::step(double length) {
  State direction(tangent());
  double size = 0.0;
  while (!(size > 0.1)) {
    for (double& x : direction) x = random_.uniform(-1.0, 1.0);
    size = norm(direction);
  }
  for (double& x : direction) x *= length / size;
  return direction;
}

State VariableSamples::state() {
  State x = identity();
  for (int k = 0; k < 4; ++k) x = retract(x, step(random_.uniform(0.2, 1.0)));
  return x;
}

State VariableSamples::identity() const {
  Guarded out("x", ambient());
  check_.call("identity", {&out}, [&] { type_.identity(out.data()); });
  return out.values();
}

State VariableSamples::retract(const State& x, const State& delta) const {
  Guarded from("x", x), step("delta", delta), out("out", ambient());
  const std::int64_t offset = 0;
  check_.call("retract", {&from, &step, &out},
              [&] { type_.retract(1, from.data(), &offset, step.data(), out.data()); });
  return out.values();
}

State VariableSamples::local(const State& x, const State& y) const {
  Guarded from("x", x), to("y", y), out("delta", tangent());
  check_.call("local", {&from, &to, &out},
              [&] { type_.local(1, from.data(), to.data(), out.data()); });
  return out.values();
}

std::string FactorSample::text() const {
  std::string text;
  for (std::size_t v = 0; v < x.size(); ++v) text += fmt::format("x{} = {}, ", v, text_of(x[v]));
  return text + "z = " + text_of(z) + ", U = " + text_of(U);
}

}  // namespace cairn::conformance
