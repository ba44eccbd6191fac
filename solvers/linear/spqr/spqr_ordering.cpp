// SPDX-License-Identifier: BSD-3-Clause
#include "spqr_ordering.hpp"

#include <new>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

int cholmod_ordering(const std::string& method) {
  if (method == "amd") return CHOLMOD_AMD;
  if (method == "metis") return CHOLMOD_METIS;
  if (method == "nesdis") return CHOLMOD_NESDIS;
  if (method == "colamd") return CHOLMOD_COLAMD;
  return CHOLMOD_NATURAL;
}

/// The block pattern of Jᵀ, of which CHOLMOD takes the product with its transpose as the graph.
/// Borrows `begin` and `rows`.
cholmod_sparse transposed_pattern(const JacobianStructure& structure,
                                  std::vector<SuiteSparse_long>& begin,
                                  std::vector<SuiteSparse_long>& rows) {
  cholmod_sparse pattern{};
  pattern.nrow = static_cast<std::size_t>(structure.block_columns());
  pattern.ncol = static_cast<std::size_t>(structure.block_rows());
  pattern.nzmax = rows.size();
  pattern.p = begin.data();
  pattern.i = rows.data();
  pattern.stype = 0;
  pattern.itype = CHOLMOD_LONG;
  pattern.xtype = CHOLMOD_PATTERN;
  pattern.dtype = CHOLMOD_DOUBLE;
  pattern.sorted = 0;
  pattern.packed = 1;
  return pattern;
}

}  // namespace

std::vector<std::int32_t> order_columns(const JacobianStructure& structure,
                                        const std::string& method, cholmod_common& common) {
  std::vector<SuiteSparse_long> begin(structure.row_begin().begin(), structure.row_begin().end());
  std::vector<SuiteSparse_long> rows(structure.columns().begin(), structure.columns().end());
  cholmod_sparse pattern = transposed_pattern(structure, begin, rows);

  const int given = common.method[0].ordering;
  common.method[0].ordering = cholmod_ordering(method);
  cholmod_factor* analysis = cholmod_l_analyze(&pattern, &common);
  common.method[0].ordering = given;
  if (!analysis) {
    if (common.status == CHOLMOD_OUT_OF_MEMORY) throw std::bad_alloc();
    throw Error(ErrorCode::usage, "linear_solver spqr: ordering=" + method +
                                      " failed (SuiteSparse may have been built without it); "
                                      "ordering=amd is always there");
  }
  const auto* order = static_cast<const SuiteSparse_long*>(analysis->Perm);
  std::vector<std::int32_t> result(order, order + structure.block_columns());
  cholmod_l_free_factor(&analysis, &common);
  return result;
}

}  // namespace cairn
