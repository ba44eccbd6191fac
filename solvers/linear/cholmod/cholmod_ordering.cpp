// SPDX-License-Identifier: BSD-3-Clause
#include "cholmod_ordering.hpp"

#include <numeric>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

/// The lower triangle of the graph of the blocks in CHOLMOD's terms. Borrows `rows` and `columns`.
cholmod_sparse pattern_of_blocks(std::vector<int>& columns, std::vector<int>& rows) {
  cholmod_sparse pattern{};
  pattern.nrow = pattern.ncol = columns.size() - 1;
  pattern.nzmax = rows.size();
  pattern.p = columns.data();
  pattern.i = rows.data();
  pattern.stype = -1;  // lower
  pattern.itype = CHOLMOD_INT;
  pattern.xtype = CHOLMOD_PATTERN;
  pattern.dtype = CHOLMOD_DOUBLE;
  pattern.sorted = 1;
  pattern.packed = 1;
  return pattern;
}

bool order_blocks(cholmod_sparse& graph, const std::string& method, std::vector<int>& order,
                  cholmod_common& common) {
  if (method == "amd") return cholmod_amd(&graph, nullptr, 0, order.data(), &common);
  if (method == "csymamd") return cholmod_csymamd(&graph, nullptr, order.data(), &common);
  if (method == "metis") return cholmod_metis(&graph, nullptr, 0, 1, order.data(), &common);
  if (method == "nesdis") {
    std::vector<int> parent(order.size()), member(order.size());
    return cholmod_nested_dissection(&graph, nullptr, 0, order.data(), parent.data(), member.data(),
                                     &common) >= 0;
  }
  std::iota(order.begin(), order.end(), 0);
  return true;
}

}  // namespace

std::vector<int> order_scalars(const BlockStructure& structure, const std::string& method,
                               cholmod_common& common) {
  std::vector<int> columns(structure.column_begin().begin(), structure.column_begin().end());
  std::vector<int> rows(structure.rows().begin(), structure.rows().end());
  cholmod_sparse graph = pattern_of_blocks(columns, rows);
  std::vector<int> order(structure.blocks());
  if (!order_blocks(graph, method, order, common)) {
    throw Error(ErrorCode::usage, "linear_solver cholmod: ordering=" + method +
                                      " failed (CHOLMOD may have been built without it); "
                                      "ordering=amd is always there");
  }

  std::vector<int> scalars;
  scalars.reserve(structure.size());
  for (const int block : order) {
    for (int k = 0; k < structure.block_size(block); ++k) {
      scalars.push_back(static_cast<int>(structure.offsets()[block]) + k);
    }
  }
  return scalars;
}

}  // namespace cairn
