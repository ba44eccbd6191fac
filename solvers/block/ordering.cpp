// SPDX-License-Identifier: BSD-3-Clause
#include "block/ordering.hpp"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <limits>
#include <new>
#include <numeric>

#include <amd.h>
#if defined(CAIRN_CAMD)
#include <camd.h>
#endif
#if defined(CAIRN_CCOLAMD)
#include <ccolamd.h>
#endif
#if defined(CAIRN_METIS)
#include <metis.h>
#endif

#include "block/block_graph.hpp"
#include "block/dissection.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/text/spelling.hpp"

namespace cairn::block {
namespace {

using Blocks = std::vector<std::int32_t>;
using Groups = std::span<const std::int32_t>;

Error bad_order(const std::string& message) { return {ErrorCode::usage, message}; }

/// The lower triangle of the block graph as SuiteSparse wants it.
struct Columns {
  Blocks begin, rows;

  explicit Columns(const BlockStructure& structure) {
    if (structure.entries() > std::numeric_limits<std::int32_t>::max()) {
      throw bad_order(
          "the block graph has more entries than minimum degree can take; use "
          "ordering=natural");
    }
    begin.assign(structure.column_begin().begin(), structure.column_begin().end());
    rows.assign(structure.rows().begin(), structure.rows().end());
  }
};

/// Group numbers from 0 without gaps, in the same order.
Blocks compact(Groups groups) {
  Blocks values(groups.begin(), groups.end());
  std::ranges::sort(values);
  values.erase(std::unique(values.begin(), values.end()), values.end());
  Blocks result;
  result.reserve(groups.size());
  for (const std::int32_t group : groups) {
    result.push_back(
        static_cast<std::int32_t>(std::ranges::lower_bound(values, group) - values.begin()));
  }
  return result;
}

Blocks natural(const BlockStructure& structure, Groups groups) {
  Blocks order(structure.blocks());
  std::iota(order.begin(), order.end(), 0);
  if (!groups.empty())
    std::ranges::stable_sort(order, {}, [&](std::int32_t block) { return groups[block]; });
  return order;
}

Blocks amd(const BlockStructure& structure) {
  const Columns graph(structure);
  Blocks order(structure.blocks());
  double control[AMD_CONTROL];
  amd_defaults(control);
  const int status = amd_order(structure.blocks(), graph.begin.data(), graph.rows.data(),
                               order.data(), control, nullptr);
  if (status == AMD_OUT_OF_MEMORY) throw std::bad_alloc();
  if (status != AMD_OK && status != AMD_OK_BUT_JUMBLED)
    throw bad_order("AMD refused the block graph");
  return order;
}

#if defined(CAIRN_CAMD)
Blocks camd(const BlockStructure& structure, Groups groups) {
  const Columns graph(structure);
  const Blocks compacted = compact(groups);
  Blocks order(structure.blocks());
  double control[CAMD_CONTROL];
  camd_defaults(control);
  const int status =
      camd_order(structure.blocks(), graph.begin.data(), graph.rows.data(), order.data(), control,
                 nullptr, groups.empty() ? nullptr : compacted.data());
  if (status == CAMD_OUT_OF_MEMORY) throw std::bad_alloc();
  if (status != CAMD_OK && status != CAMD_OK_BUT_JUMBLED)
    throw bad_order("CAMD refused the block graph");
  return order;
}
#endif

#if defined(CAIRN_CCOLAMD)
Blocks ccolamd(const BlockStructure& structure, Groups groups) {
  Columns graph(structure);
  Blocks compacted = compact(groups);
  Blocks order(structure.blocks() + 1);  // one more is its room to work in
  int stats[CCOLAMD_STATS];
  constexpr int kLowerTriangle = -1;
  if (!csymamd(structure.blocks(), graph.rows.data(), graph.begin.data(), order.data(), nullptr,
               stats, &std::calloc, &std::free, groups.empty() ? nullptr : compacted.data(),
               kLowerTriangle)) {
    if (stats[CCOLAMD_STATUS] == CCOLAMD_ERROR_out_of_memory) throw std::bad_alloc();
    throw bad_order("CCOLAMD refused the block graph (status " +
                    std::to_string(stats[CCOLAMD_STATUS]) + ")");
  }
  order.pop_back();
  return order;
}
#endif

#if defined(CAIRN_METIS)
Blocks metis(const BlockStructure& structure) {
  const BlockGraph graph(structure);
  if (graph.begin.back() > std::numeric_limits<idx_t>::max()) {
    throw bad_order("the block graph has more entries than METIS can take; use ordering=amd");
  }
  if (graph.neighbours.empty()) return natural(structure, {});  // METIS wants at least one edge
  std::vector<idx_t> begin(graph.begin.begin(), graph.begin.end());
  std::vector<idx_t> neighbours(graph.neighbours.begin(), graph.neighbours.end());
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = 1;  // the same ordering every time
  options[METIS_OPTION_NUMBERING] = 0;
  idx_t n = structure.blocks();
  std::vector<idx_t> permutation(n), inverse(n);
  const int status = METIS_NodeND(&n, begin.data(), neighbours.data(), nullptr, options,
                                  permutation.data(), inverse.data());
  if (status == METIS_ERROR_MEMORY) throw std::bad_alloc();
  if (status != METIS_OK) throw bad_order("METIS refused the block graph; use ordering=amd");
  return {permutation.begin(), permutation.end()};
}
#endif

#if defined(CAIRN_METIS) && defined(CAIRN_CAMD)
Blocks nesdis(const BlockStructure& structure, Groups groups) {
  if (2 * structure.entries() > std::numeric_limits<idx_t>::max()) {
    throw bad_order("the block graph has more entries than METIS can take; use ordering=amd");
  }
  return camd(structure, dissection(structure, groups.empty() ? Blocks() : compact(groups)));
}
#endif

}  // namespace

const std::vector<std::string>& ordering_names() {
  static const std::vector<std::string> names = {
    "amd",
#if defined(CAIRN_METIS) && defined(CAIRN_CAMD)
    "nesdis",
#endif
    "natural"
  };
  return names;
}

const std::vector<std::string>& every_ordering_name() {
  static const std::vector<std::string> names = {
    "amd",
    "auto",
#if defined(CAIRN_CAMD)
    "camd",
#endif
#if defined(CAIRN_CCOLAMD)
    "ccolamd",
#endif
#if defined(CAIRN_METIS)
    "metis",
#endif
    "natural",
#if defined(CAIRN_METIS) && defined(CAIRN_CAMD)
    "nesdis",
#endif
  };
  return names;
}

std::vector<std::int32_t> order(const BlockStructure& structure, std::string_view name,
                                std::span<const std::int32_t> groups) {
  if (structure.blocks() == 0) return {};
  if (name == "natural") return natural(structure, groups);
  if (name == "auto") return choose(structure, groups).order;
  if (name == "amd" && groups.empty()) return amd(structure);
#if defined(CAIRN_CAMD)
  if (name == "camd" || name == "amd") return camd(structure, groups);
#endif
#if defined(CAIRN_CCOLAMD)
  if (name == "ccolamd") return ccolamd(structure, groups);
#endif
#if defined(CAIRN_METIS)
  if (name == "metis" && groups.empty()) return metis(structure);
#endif
#if defined(CAIRN_METIS) && defined(CAIRN_CAMD)
  if (name == "nesdis") return nesdis(structure, groups);
#endif
  if (std::ranges::find(every_ordering_name(), name) != every_ordering_name().end()) {
    throw bad_order("ordering '" + std::string(name) +
                    "' cannot put some blocks last; use camd, ccolamd, nesdis or natural");
  }
  throw bad_order("no ordering '" + std::string(name) + "'" +
                  what_is_on_offer(name, every_ordering_name()));
}

std::vector<std::int32_t> order(const BlockStructure& structure, std::string_view name) {
  constexpr std::string_view kLast = ",last=";
  const std::size_t option = name.find(kLast);
  if (option == std::string_view::npos) return order(structure, name, {});
  const std::string_view text = name.substr(option + kLast.size());
  std::int64_t last = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), last);
  if (error != std::errc() || end != text.data() + text.size() || last < 0)
    throw bad_order("ordering '" + std::string(name) + "': last=N wants a number of blocks");
  std::vector<std::int32_t> groups(structure.blocks(), 0);
  for (std::int64_t b = std::max<std::int64_t>(0, structure.blocks() - last);
       b < structure.blocks(); ++b) {
    groups[b] = 1;
  }
  return order(structure, name.substr(0, option), last > 0 ? Groups(groups) : Groups());
}

Choice choose(const BlockStructure& structure, std::span<const std::int32_t> groups) {
  const auto choice = [&](std::string name, std::vector<std::int32_t> order) {
    Symbolic outline = Symbolic::outline(structure, order);
    return Choice{std::move(name), std::move(order), std::move(outline)};
  };
  Choice degree = choice(groups.empty() ? "amd" : "camd", order(structure, "amd", groups));
#if defined(CAIRN_METIS) && defined(CAIRN_CAMD)
  if (worth_dissecting(structure, degree.outline.factor_flops)) {
    Choice dissected = choice("nesdis", order(structure, "nesdis", groups));
    if (dissected.outline.factor_flops < degree.outline.factor_flops) return dissected;
  }
#endif
  return degree;
}

double factor_flops(const BlockStructure& structure, std::span<const std::int32_t> order) {
  return Symbolic::outline(structure, order).factor_flops;
}

bool worth_dissecting(const BlockStructure& structure, double flops) {
  // Rough figures of one core: what dissection takes a block, what it saves where it saves at all,
  // and the speed of a factorisation.
  constexpr double kSecondsPerBlock = 4e-6, kSaved = 0.25, kFlopsPerSecond = 4e10;
  constexpr double kFactorizations = 10.0;
  return kFactorizations * kSaved * flops / kFlopsPerSecond > kSecondsPerBlock * structure.blocks();
}

}  // namespace cairn::block
