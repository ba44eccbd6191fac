// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "cairn/types/factor_type.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn::test {

/// How far from the identity the rotation of a sample is.
struct Regime {
  const char* name;
  double angle;         // norm of the rotation vector [rad]; negative: random within (0, 3)
  double distance = 2;  // range of the other coordinates
};

/// Where closed forms break, where series take over, and the general case.
const std::vector<Regime>& regimes();

/// Reproducible random numbers, and states and measurements of any type made of them.
class Sampler {
 public:
  explicit Sampler(std::uint64_t seed) : engine_(seed) {}

  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  /// Within ±range each.
  std::vector<double> vector(int size, double range);
  /// `count` numbers of that Euclidean norm, in a random direction.
  std::vector<double> direction(int count, double norm);
  /// Numbers in the tangent space of `type`, in that regime; the rotation comes last in it.
  std::vector<double> tangent(const VariableType& type, const Regime& regime);
  std::vector<double> state(const VariableType& type, const Regime& regime);
  /// A measurement that the factor type takes for good.
  std::vector<double> measurement(const FactorType& type);
  /// Upper triangular with a positive diagonal, packed row by row.
  std::vector<double> sqrt_information(int size);

  static std::vector<double> retracted(const VariableType& type, const std::vector<double>& x,
                                       const std::vector<double>& delta);

 private:
  std::mt19937_64 engine_;
};

/// Euclidean.
double norm(const std::vector<double>& v);

}  // namespace cairn::test
