// SPDX-License-Identifier: BSD-3-Clause
#include "block/ordering.hpp"

#include <limits>
#include <numeric>

#include <amd.h>
#if defined(CAIRN_METIS)
#include <metis.h>
#endif

#include "cairn/error.hpp"
#include "cairn/spelling.hpp"

namespace cairn::block {
namespace {

Error bad_order(const std::string& message) { return {ErrorCode::usage, message}; }

std::vector<std::int32_t> natural(const BlockStructure& structure) {
  std::vector<std::int32_t> identity(structure.blocks());
  std::iota(identity.begin(), identity.end(), 0);
  return identity;
}

std::vector<std::int32_t> amd(const BlockStructure& structure) {
  if (structure.entries() > std::numeric_limits<std::int32_t>::max()) {
    throw bad_order("the block graph has more entries than AMD can take; use ordering=natural");
  }
  const std::vector<std::int32_t> begin(structure.column_begin().begin(),
                                        structure.column_begin().end());
  std::vector<std::int32_t> permutation(structure.blocks());
  double control[AMD_CONTROL];
  amd_defaults(control);
  const int status = amd_order(structure.blocks(), begin.data(), structure.rows().data(),
                               permutation.data(), control, nullptr);
  if (status == AMD_OUT_OF_MEMORY)
    throw bad_order("AMD ran out of memory while ordering the block graph");
  if (status != AMD_OK && status != AMD_OK_BUT_JUMBLED)
    throw bad_order("AMD refused the block graph");
  return permutation;
}

#if defined(CAIRN_METIS)
/// Both triangles of the block graph without its diagonal, as METIS wants it.
struct Adjacency {
  std::vector<idx_t> begin, neighbours;

  explicit Adjacency(const BlockStructure& structure) : begin(structure.blocks() + 1, 0) {
    const auto for_each_edge = [&](auto visit) {
      for (std::int32_t j = 0; j < structure.blocks(); ++j) {
        for (std::int64_t e = structure.column_begin()[j] + 1; e < structure.column_begin()[j + 1];
             ++e) {
          visit(structure.rows()[e], j);
        }
      }
    };
    for_each_edge([&](std::int32_t a, std::int32_t b) {
      ++begin[a + 1];
      ++begin[b + 1];
    });
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    neighbours.resize(begin.back());
    std::vector<idx_t> next(begin.begin(), begin.end() - 1);
    for_each_edge([&](std::int32_t a, std::int32_t b) {
      neighbours[next[a]++] = b;
      neighbours[next[b]++] = a;
    });
  }
};

std::vector<std::int32_t> metis(const BlockStructure& structure) {
  if (2 * structure.entries() > std::numeric_limits<idx_t>::max()) {
    throw bad_order("the block graph has more entries than METIS can take; use ordering=amd");
  }
  Adjacency graph(structure);
  if (graph.neighbours.empty())
    return natural(structure);  // METIS does not take a graph without edges
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = 1;  // the same ordering every time
  options[METIS_OPTION_NUMBERING] = 0;
  idx_t n = structure.blocks();
  std::vector<idx_t> permutation(n), inverse(n);
  if (METIS_NodeND(&n, graph.begin.data(), graph.neighbours.data(), nullptr, options,
                   permutation.data(), inverse.data()) != METIS_OK) {
    throw bad_order("METIS refused the block graph; use ordering=amd");
  }
  return {permutation.begin(), permutation.end()};
}
#endif

}  // namespace

const std::vector<std::string>& ordering_names() {
  static const std::vector<std::string> names = {
    "amd",
#if defined(CAIRN_METIS)
    "metis",
#endif
    "natural"
  };
  return names;
}

std::vector<std::int32_t> order(const BlockStructure& structure, std::string_view name) {
  if (name == "natural" || structure.blocks() == 0) return natural(structure);
  if (name == "amd") return amd(structure);
#if defined(CAIRN_METIS)
  if (name == "metis") return metis(structure);
#endif
  throw bad_order("no ordering '" + std::string(name) + "'" +
                  what_is_on_offer(name, ordering_names()));
}

}  // namespace cairn::block
