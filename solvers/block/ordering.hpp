// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "block/symbolic.hpp"
#include "cairn/linear/block_matrix.hpp"

namespace cairn::block {

/// The orderings that differ in kind: those that `auto` compares (amd, and nesdis where the library
/// was built with METIS and CAMD), and natural.
const std::vector<std::string>& ordering_names();

/// Every name that `order` takes in this build:
/// - amd: approximate minimum degree (Amestoy, Davis, Duff 1996); camd: the same with groups;
/// - ccolamd: approximate minimum degree by columns (CSYMAMD), with groups;
/// - metis: nested dissection by METIS down to small pieces;
/// - nesdis: nested dissection by METIS's separators, and minimum degree within pieces and
///   separators, which knows of what surrounds them: mostly better than metis, and faster;
/// - natural: as the blocks are numbered;
/// - auto: see `choose`.
const std::vector<std::string>& every_ordering_name();

/// A fill-reducing ordering of the block graph: element k is the block eliminated k-th. The same
/// structure gives the same ordering every time.
///
/// `groups`, if not empty: a number for each block; blocks with smaller numbers come first,
/// whatever it costs in fill. So an incremental solver keeps its newest variables at the end, where
/// a change touches little. `amd` with groups is `camd`; `metis` takes none. `Symbolic` postorders
/// what it is given: after that a block still comes after all blocks of smaller groups below it in
/// the elimination tree, though not after those in other branches.
///
/// Throws `Error` (usage) for a name that it does not know, and for groups where it takes none.
std::vector<std::int32_t> order(const BlockStructure& structure, std::string_view name,
                                std::span<const std::int32_t> groups);
/// The same, for a name with options as in `camd,last=100`: the last 100 blocks make a second
/// group.
std::vector<std::int32_t> order(const BlockStructure& structure, std::string_view name);

/// What `auto` comes to: amd (camd with groups), and where it is likely to be repaid, nesdis as
/// well; of these the one with fewer flops.
struct Choice {
  std::string name;
  std::vector<std::int32_t> order;
  Symbolic outline;
};
Choice choose(const BlockStructure& structure, std::span<const std::int32_t> groups = {});

/// Σ (column count)² over the scalar columns of the factor in that order: what a factorisation
/// costs in multiplications and additions.
double factor_flops(const BlockStructure& structure, std::span<const std::int32_t> order);

/// Whether nested dissection is likely to save in ten factorisations what it takes longer than
/// minimum degree, given the flops of the latter.
bool worth_dissecting(const BlockStructure& structure, double flops);

}  // namespace cairn::block
