// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <random>

#include "portable_math.hpp"

namespace cairn::generate {

/// Random numbers that are the same on every machine: the integers of std::mt19937_64, which the
/// C++ standard fixes, and our own transforms of them (the standard's distributions are left to the
/// library). Streams of one seed are independent: the noise does not change which loops there are.
class Random {
 public:
  enum class Stream : std::uint64_t { path = 1, loops, noise, outliers, landmarks };

  Random(std::uint64_t seed, Stream stream)
      : engine_(mix(seed + 0x9e3779b97f4a7c15u * static_cast<std::uint64_t>(stream))) {}

  /// In [0, 1), a multiple of 2⁻⁵³.
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// 0 … n-1.
  std::int64_t below(std::int64_t n) {
    return static_cast<std::int64_t>(uniform() * static_cast<double>(n));
  }
  bool chance(double probability) { return uniform() < probability; }

  /// Normal with mean 0 and variance 1, by Marsaglia's polar method.
  double gaussian() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    double u, v, s;
    do {
      u = 2.0 * uniform() - 1.0;
      v = 2.0 * uniform() - 1.0;
      s = u * u + v * v;
    } while (s >= 1.0 || s == 0.0);
    const double factor = std::sqrt(-2.0 * natural_log(s) / s);
    spare_ = v * factor;
    has_spare_ = true;
    return u * factor;
  }

 private:
  // The finaliser of splitmix64: neighbouring seeds give unrelated engines.
  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }

  std::mt19937_64 engine_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace cairn::generate
