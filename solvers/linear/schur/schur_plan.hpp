// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "cairn/linear/block_matrix.hpp"
#include "kernels.hpp"

namespace cairn::schur {

/// An eliminated block.
struct Eliminated {
  std::int64_t diagonal;                         ///< its diagonal block, in the values of H
  std::int64_t factor;                           ///< its L, in all of them
  std::int64_t vector;                           ///< its first scalar row in H
  std::int64_t part;                             ///< its first scalar row among the eliminated
  std::int64_t first_neighbour, last_neighbour;  ///< in `SchurPlan::neighbours`, by rising block
  std::int32_t size;
  std::int32_t block;  ///< in H
};

/// Products of blocks of Y with one inner size that are taken off one block of the reduced system.
struct Group {
  Product product;
  std::int64_t first_pair, last_pair;
  std::int32_t inner;
};

/// A block of the reduced system: what H has there, less its groups of products.
struct Target {
  std::int64_t source;  ///< in the values of H, -1 where H has nothing
  std::int64_t value;   ///< in the values of the reduced system
  std::int64_t first_group, last_group;
  std::int32_t rows, columns;
};

/// A stretch of elements that one task works off.
struct Stretch {
  std::int64_t begin, end;
};

/// Everything about S = H_RR − H_RE H_EE⁻¹ H_ER that depends on the structure alone, for a set E of
/// blocks no two of which are joined: with H_ee = L Lᵀ and Y_re = H_re L⁻ᵀ, each block of S is
/// S_ij = H_ij − Σ_e Y_ie Y_jeᵀ, e by rising order. R keeps its order, so a block that H has stands
/// in S as it stands in H. Y is laid out by remaining blocks, since S is made block column by block
/// column: what meets there then lies together.
struct SchurPlan {
  SchurPlan() = default;
  /// Throws `Error` (usage) where Y has more doubles than its index type can count.
  SchurPlan(const BlockStructure& structure, std::string_view eliminate, const Kernels& kernels);

  std::vector<Eliminated> eliminated;
  std::vector<std::int32_t> remaining;  ///< block of S → block of H
  BlockStructure reduced;               ///< where S has blocks, fill included
  std::vector<Neighbour> neighbours;    ///< of each eliminated block, and kLookahead more
  std::vector<std::int64_t> incidence_begin;
  std::vector<Incidence> incidences;  ///< of each remaining block, by rising eliminated block
  std::vector<Target> targets;        ///< as the entries of `reduced`
  std::vector<Group> groups;
  std::vector<Pair> pairs;
  std::vector<Stretch> elimination_tasks, target_tasks;

  std::int64_t y_values = 0;       ///< doubles of Y, without room for reading over its end
  std::int64_t l_values = 0;       ///< doubles of all L
  std::int64_t parts = 0;          ///< scalar rows of E
  std::int64_t nonzeros = 0;       ///< of the eliminated columns of the factor of H
  double flops = 0.0;              ///< Σ (column count)² over them
  std::int32_t largest_block = 0;  ///< rows of the largest remaining block

 private:
  void find_neighbours(const BlockStructure& structure, const std::vector<std::int32_t>& place);
  void lay_out_y(const BlockStructure& structure);
  void find_reduced(const BlockStructure& structure, const std::vector<std::int32_t>& place);
  void find_products(const BlockStructure& structure, const Kernels& kernels);
  void add_products_of_column(std::int32_t column, const Kernels& kernels,
                              std::vector<std::int64_t>& entry_of,
                              std::vector<std::int64_t>& count);
  void count_work();
  void cut_into_tasks();
};

}  // namespace cairn::schur
