// SPDX-License-Identifier: BSD-3-Clause
#include "support/sample_matrices.hpp"

#include <algorithm>

#include <Eigen/Core>

namespace cairn::test {
namespace {

using Entries = std::vector<std::pair<std::int32_t, std::int32_t>>;

std::vector<std::int32_t> sizes(int blocks, std::vector<std::int32_t> pattern) {
  std::vector<std::int32_t> result;
  for (int k = 0; k < blocks; ++k) result.push_back(pattern[k % pattern.size()]);
  return result;
}

Entries chain(int blocks) {
  Entries entries;
  for (int k = 1; k < blocks; ++k) entries.emplace_back(k, k - 1);
  return entries;
}

Entries arrow(int blocks, int tip) {
  Entries entries;
  for (int k = 0; k < blocks; ++k) {
    if (k != tip) entries.emplace_back(tip, k);
  }
  return entries;
}

Entries grid(int rows, int columns) {
  Entries entries;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      if (c > 0) entries.emplace_back(r * columns + c, r * columns + c - 1);
      if (r > 0) entries.emplace_back(r * columns + c, (r - 1) * columns + c);
    }
  }
  return entries;
}

Entries complete(int blocks) {
  Entries entries;
  for (int i = 0; i < blocks; ++i) {
    for (int j = 0; j < i; ++j) entries.emplace_back(i, j);
  }
  return entries;
}

Entries random_graph(int blocks, int edges, std::uint64_t seed) {
  Random random(seed);
  Entries entries = chain(blocks);
  for (int k = 0; k < edges; ++k) entries.emplace_back(random.below(blocks), random.below(blocks));
  return entries;
}

}  // namespace

std::uint64_t Random::next() {  // splitmix64
  std::uint64_t z = state_ += 0x9E3779B97F4A7C15ULL;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31);
}
double Random::operator()() { return static_cast<double>(next() >> 11) * 0x1p-52 - 1.0; }
int Random::below(int bound) {
  return static_cast<int>(next() % static_cast<std::uint64_t>(bound));
}

std::vector<NamedStructure> sample_structures() {
  std::vector<NamedStructure> samples;
  samples.push_back({"one block of one", {{1}, {}}});
  samples.push_back({"one block of six", {{6}, {}}});
  samples.push_back({"blocks apart", {sizes(20, {1, 2, 3, 6}), {}}});
  samples.push_back({"chain of threes", {sizes(60, {3}), chain(60)}});
  samples.push_back({"chain of sixes", {sizes(40, {6}), chain(40)}});
  samples.push_back({"chain of twos", {sizes(50, {2}), chain(50)}});
  samples.push_back({"chain of scalars", {sizes(50, {1}), chain(50)}});
  samples.push_back({"arrow, tip first", {sizes(30, {3, 2}), arrow(30, 0)}});
  samples.push_back({"arrow, tip last", {sizes(30, {6, 3}), arrow(30, 29)}});
  samples.push_back({"grid of threes", {sizes(99, {3}), grid(9, 11)}});
  samples.push_back({"grid of sixes", {sizes(64, {6}), grid(8, 8)}});
  samples.push_back({"grid, mixed", {sizes(80, {1, 6, 3, 2, 3}), grid(8, 10)}});
  samples.push_back({"complete, mixed", {sizes(16, {2, 3, 6, 1}), complete(16)}});
  samples.push_back({"random, poses and points", {sizes(90, {3, 3, 2}), random_graph(90, 120, 3)}});
  samples.push_back({"random, odd sizes", {sizes(60, {4, 7, 1, 9}), random_graph(60, 60, 4)}});
  return samples;
}

void fill_positive_definite(BlockMatrix& H, std::uint64_t seed, double shift) {
  const BlockStructure& s = H.structure();
  Random random(seed);
  H.set_zero();
  const auto jacobian = [&](int block) {
    return Eigen::MatrixXd(
        Eigen::MatrixXd::NullaryExpr(3, s.block_size(block), [&] { return random(); }));
  };
  const auto add = [&](std::int64_t entry, const Eigen::MatrixXd& block) {
    Eigen::Map<Eigen::MatrixXd>(H.block(entry), block.rows(), block.cols()) += block;
  };
  for (int j = 0; j < s.blocks(); ++j) {
    const std::int64_t diagonal_j = s.column_begin()[j];
    add(diagonal_j, shift * Eigen::MatrixXd::Identity(s.block_size(j), s.block_size(j)));
    for (std::int64_t e = diagonal_j; e < s.column_begin()[j + 1]; ++e) {
      const int i = s.rows()[e];
      const Eigen::MatrixXd J_i = jacobian(i), J_j = jacobian(j);
      add(diagonal_j, J_j.transpose() * J_j);
      if (i == j) continue;
      add(s.column_begin()[i], J_i.transpose() * J_i);
      add(e, J_i.transpose() * J_j);
    }
  }
}

}  // namespace cairn::test
