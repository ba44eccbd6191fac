// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "block/kernels.hpp"
#include "system.hpp"
#include "tree.hpp"

namespace cairn::incremental {

/// The names of the instruction sets that this machine has.
inline std::vector<const block::Kernels*> kernel_sets() {
  std::vector<const block::Kernels*> sets;
  for (const char* name : {"portable", "avx2", "avx512"}) {
    if (const block::Kernels* kernels = block::choose_kernels(name)) sets.push_back(kernels);
  }
  return sets;
}

/// H of the variables that are in a tree, whole. The rows of all others are those of the identity,
/// so that places are as in vectors such as g.
inline Eigen::MatrixXd dense(const System& system, const Tree& tree) {
  const Eigen::Index n = system.scalars();
  Eigen::MatrixXd H = Eigen::MatrixXd::Identity(n, n);
  for (std::int32_t v = 0; v < system.variables(); ++v) {
    if (tree.node_of(v) < 0) continue;
    const Eigen::Index at = system.offset(v), size = system.size(v);
    H.block(at, at, size, size) = Eigen::Map<const Eigen::MatrixXd>(system.diagonal(v), size, size);
    for (const System::Link& link : system.links(v)) {
      if (link.other < v) continue;
      const Eigen::Index to = system.offset(link.other), width = system.size(link.other);
      H.block(at, to, size, width) =
          Eigen::Map<const Eigen::MatrixXd>(system.block(link.entry), size, width);
      H.block(to, at, width, size) = H.block(at, to, size, width).transpose();
    }
  }
  return H;
}

}  // namespace cairn::incremental
