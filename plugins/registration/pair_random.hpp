// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>

#include "cairn/graph/graph.hpp"

namespace cairn::registration {

/// Random numbers of one pair of poses: the same in either order of the two, whenever they are
/// asked for, and unrelated to those of any other pair. The integers are those of std::mt19937_64,
/// which the C++ standard fixes, and so the same on every machine; so is every `chance`. (Normal
/// numbers are, but for the last bit of the C library's logarithm.)
class PairRandom {
 public:
  PairRandom(std::uint64_t seed, Id a, Id b)
      : engine_(mix(mix(mix(seed) + static_cast<std::uint64_t>(std::min(a, b))) +
                    static_cast<std::uint64_t>(std::max(a, b)))) {}

  /// In [0, 1), a multiple of 2⁻⁵³.
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  bool chance(double probability) { return uniform() < probability; }

  /// Normal with mean 0 and variance 1, by Marsaglia's polar method; the second number that it
  /// gives goes to waste.
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
  // splitmix64: neighbouring seeds and ids give unrelated engines.
  static std::uint64_t mix(std::uint64_t z) {
    z += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }

  std::mt19937_64 engine_;
};

}  // namespace cairn::registration
