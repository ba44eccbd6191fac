// SPDX-License-Identifier: BSD-3-Clause
#include "support/block_systems.hpp"

#include <utility>

namespace cairn::test {

BlockStructure random_structure(std::mt19937& rng, int blocks, int extra,
                                const std::vector<std::int32_t>& sizes_to_mix) {
  std::vector<std::int32_t> sizes;
  for (int k = 0; k < blocks; ++k) sizes.push_back(sizes_to_mix[rng() % sizes_to_mix.size()]);
  std::vector<std::pair<std::int32_t, std::int32_t>> entries;
  for (int k = 1; k < blocks; ++k) entries.emplace_back(k, k - 1);
  for (int k = 0; k < extra; ++k) entries.emplace_back(rng() % blocks, rng() % blocks);
  return BlockStructure(std::move(sizes), std::move(entries));
}

BlockStructure solid_grid(int side, std::int32_t size) {
  std::vector<std::pair<std::int32_t, std::int32_t>> entries;
  const auto index = [&](int x, int y, int z) { return (z * side + y) * side + x; };
  for (int z = 0; z < side; ++z) {
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        if (x > 0) entries.emplace_back(index(x, y, z), index(x - 1, y, z));
        if (y > 0) entries.emplace_back(index(x, y, z), index(x, y - 1, z));
        if (z > 0) entries.emplace_back(index(x, y, z), index(x, y, z - 1));
      }
    }
  }
  return {std::vector<std::int32_t>(side * side * side, size), std::move(entries)};
}

void fill_positive_definite(std::mt19937& rng, BlockMatrix& H) {
  const BlockStructure& s = H.structure();
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (double& value : H.values()) value = uniform(rng);
  for (int j = 0; j < s.blocks(); ++j) {
    const int n = s.block_size(j);
    Eigen::Map<Eigen::MatrixXd> block(H.block(s.column_begin()[j]), n, n);
    block = (block * block.transpose()).eval();
    block.diagonal().array() += 2.0 * static_cast<double>(s.size());
  }
}

Eigen::MatrixXd dense(const BlockMatrix& H) {
  const BlockStructure& s = H.structure();
  Eigen::MatrixXd D = Eigen::MatrixXd::Zero(s.size(), s.size());
  for (int j = 0; j < s.blocks(); ++j) {
    for (std::int64_t e = s.column_begin()[j]; e < s.column_begin()[j + 1]; ++e) {
      const int i = s.rows()[e], rows = s.block_size(i), columns = s.block_size(j);
      const Eigen::Map<const Eigen::MatrixXd> block(H.block(e), rows, columns);
      D.block(s.offsets()[i], s.offsets()[j], rows, columns) = block;
      if (i != j) D.block(s.offsets()[j], s.offsets()[i], columns, rows) = block.transpose();
    }
  }
  return D;
}

}  // namespace cairn::test
