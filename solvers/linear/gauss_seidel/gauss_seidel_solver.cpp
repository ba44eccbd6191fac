// SPDX-License-Identifier: BSD-3-Clause
#include "gauss_seidel_solver.hpp"

#include <algorithm>

#include <fmt/core.h>

#include "iterative/small_blocks.hpp"

namespace cairn {

GaussSeidelSolver::GaussSeidelSolver(const GaussSeidelOptions& options)
    : Relaxation("gauss_seidel", options.relaxation), omega_(options.omega) {}

void GaussSeidelSolver::relax(int block, std::span<const double> g, std::span<double> x) {
  const BlockStructure& s = H().structure();
  const std::int64_t first = s.offsets()[block];
  const std::int32_t size = s.block_size(block);
  const auto room = static_cast<std::size_t>(size);
  if (right_.size() < room) right_.resize(room);
  std::copy_n(g.begin() + first, size, right_.begin());
  H().subtract_neighbours(block, x.data(), right_.data());
  answer_.assign(room, 0.0);
  iterative::add_product(diagonal().inverse(block), size, size, right_.data(), answer_.data());
  for (std::int32_t k = 0; k < size; ++k) x[first + k] += omega_ * (answer_[k] - x[first + k]);
}

void GaussSeidelSolver::sweep(std::span<const double> g, std::span<double> x) {
  const int blocks = H().structure().blocks();
  for (int i = 0; i < blocks; ++i) relax(i, g, x);
  for (int i = blocks - 1; i >= 0; --i) relax(i, g, x);
}

std::string GaussSeidelSolver::note() const {
  return fmt::format("symmetric block Gauss-Seidel, omega {:.3g}", omega_);
}

}  // namespace cairn
