// SPDX-License-Identifier: BSD-3-Clause
#include "support/sampling.hpp"

#include <cmath>
#include <numbers>

namespace cairn::test {

const std::vector<Regime>& regimes() {
  static const std::vector<Regime> all = {
      {"identity", 0.0, 0.0},
      {"tiny", 1e-9, 1e-9},
      {"small", 1e-5},
      {"below the switch of a series", 0.0199},
      {"above the switch of a series", 0.0201},
      {"below the second switch", 0.0999},
      {"above the second switch", 0.1001},
      {"random", -1.0},
      {"far away", -1.0, 1e3},
      {"nearly pi", std::numbers::pi - 1e-3},
      {"almost pi", std::numbers::pi - 1e-6},
  };
  return all;
}

std::vector<double> Sampler::vector(int size, double range) {
  std::vector<double> v(size);
  for (double& x : v) x = uniform(-range, range);
  return v;
}

std::vector<double> Sampler::direction(int count, double norm) {
  std::vector<double> v;
  double length = 0.0;
  while (length < 0.1) {
    v = vector(count, 1.0);
    length = 0.0;
    for (const double x : v) length += x * x;
    length = std::sqrt(length);
  }
  for (double& x : v) x *= norm / length;
  return v;
}

std::vector<double> Sampler::tangent(const VariableType& type, const Regime& regime) {
  const Placement* placement = type.placement();
  const bool turns = placement && placement->has_orientation();
  const int rotation = !turns ? 0 : placement->dimension() == 2 ? 1 : 3;
  std::vector<double> delta = vector(type.tangent_size() - rotation, regime.distance);
  if (rotation > 0) {
    const double angle = regime.angle < 0 ? uniform(0.0, 3.0) : regime.angle;
    for (const double x : direction(rotation, angle)) delta.push_back(x);
  }
  return delta;
}

std::vector<double> Sampler::state(const VariableType& type, const Regime& regime) {
  std::vector<double> x(type.ambient_size());
  type.identity(x.data());
  return retracted(type, x, tangent(type, regime));
}

std::vector<double> Sampler::measurement(const FactorType& type) {
  for (;;) {
    std::vector<double> z = vector(type.measurement_size(), 2.0);
    if (type.normalize(z.data()).empty()) return z;
  }
}

std::vector<double> Sampler::sqrt_information(int size) {
  std::vector<double> packed;
  for (int row = 0; row < size; ++row) {
    packed.push_back(uniform(0.5, 3.0));
    for (int column = row + 1; column < size; ++column) packed.push_back(uniform(-1.0, 1.0));
  }
  return packed;
}

std::vector<double> Sampler::retracted(const VariableType& type, const std::vector<double>& x,
                                       const std::vector<double>& delta) {
  std::vector<double> out(x.size());
  const std::int64_t offset = 0;
  type.retract(1, x.data(), &offset, delta.data(), out.data());
  return out;
}

double norm(const std::vector<double>& v) {
  double sum = 0.0;
  for (const double x : v) sum += x * x;
  return std::sqrt(sum);
}

}  // namespace cairn::test
