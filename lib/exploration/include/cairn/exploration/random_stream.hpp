// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <random>

namespace cairn {

/// Random numbers for one purpose of one run: streams of one seed are independent of each other, so
/// that methods that are compared at one seed meet the same noise. The integers are those of
/// std::mt19937_64, which the C++ standard fixes.
class RandomStream {
 public:
  enum class Purpose : std::uint64_t { odometry = 1, lidar, start, explorer };

  RandomStream(std::uint64_t seed, Purpose purpose)
      : engine_(mix(mix(seed) + static_cast<std::uint64_t>(purpose))) {}

  /// In [0, 1), a multiple of 2⁻⁵³.
  double uniform() { return static_cast<double>(engine_() >> 11U) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// 0 … count − 1.
  std::size_t below(std::size_t count) {
    return static_cast<std::size_t>(uniform() * static_cast<double>(count));
  }
  bool chance(double probability) { return uniform() < probability; }
  /// Normal with mean 0 and variance 1, by Marsaglia's polar method.
  double gaussian() {
    double u, v, s;
    do {
      u = uniform(-1.0, 1.0);
      v = uniform(-1.0, 1.0);
      s = u * u + v * v;
    } while (s >= 1.0 || s == 0.0);
    return u * std::sqrt(-2.0 * std::log(s) / s);
  }

 private:
  // splitmix64: neighbouring seeds give unrelated engines.
  static std::uint64_t mix(std::uint64_t z) {
    z += 0x9e3779b97f4a7c15U;
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
    return z ^ (z >> 31U);
  }

  std::mt19937_64 engine_;
};

}  // namespace cairn
