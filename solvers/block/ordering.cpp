// SPDX-License-Identifier: BSD-3-Clause
#include "block/ordering.hpp"

#include <numeric>
#include <string>

#include <amd.h>

#include "cairn/error.hpp"

namespace cairn::block {
namespace {

std::vector<std::int32_t> amd(const BlockStructure& structure) {
  const int n = structure.blocks();
  if (structure.entries() > INT32_MAX) {
    throw Error(ErrorCode::usage,
                "the block graph has more entries than AMD can take; use ordering=natural");
  }
  std::vector<std::int32_t> begin(structure.column_begin().begin(), structure.column_begin().end());
  std::vector<std::int32_t> permutation(n);
  double control[AMD_CONTROL];
  amd_defaults(control);
  const int status =
      amd_order(n, begin.data(), structure.rows().data(), permutation.data(), control, nullptr);
  if (status != AMD_OK && status != AMD_OK_BUT_JUMBLED) {
    throw Error(ErrorCode::usage, status == AMD_OUT_OF_MEMORY
                                      ? "AMD ran out of memory while ordering the block graph"
                                      : "AMD refused the block graph");
  }
  return permutation;
}

}  // namespace

std::vector<std::int32_t> order(const BlockStructure& structure, std::string_view name) {
  if (structure.blocks() == 0) return {};
  if (name == "amd") return amd(structure);
  if (name == "natural") {
    std::vector<std::int32_t> identity(structure.blocks());
    std::iota(identity.begin(), identity.end(), 0);
    return identity;
  }
  throw Error(ErrorCode::usage, "no ordering '" + std::string(name) + "'; on offer: amd, natural");
}

}  // namespace cairn::block
