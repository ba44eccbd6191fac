// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/linear/block_matrix.hpp"

namespace cairn::test {

struct NamedStructure {
  std::string name;
  BlockStructure structure;
};

/// Chains, arrows, grids, a complete graph, blocks apart, and random graphs; blocks of 1, 2, 3, 6
/// and mixed.
std::vector<NamedStructure> sample_structures();

/// Values that make a structure positive definite: Σ JᵀJ over its blocks with random J, plus
/// `shift` on the diagonal. The same seed gives the same values.
void fill_positive_definite(BlockMatrix& H, std::uint64_t seed, double shift = 0.1);

/// Reproducible numbers in [-1, 1].
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15ULL + 1) {}
  double operator()();
  int below(int bound);

 private:
  std::uint64_t next();
  std::uint64_t state_;
};

}  // namespace cairn::test
