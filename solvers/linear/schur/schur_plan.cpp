// SPDX-License-Identifier: BSD-3-Clause
#include "schur_plan.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include "cairn/runtime/error.hpp"
#include "elimination_set.hpp"

namespace cairn::schur {
namespace {

/// Multiplications of one task, roughly: some tens of microseconds.
constexpr double kTaskWork = 3e5;
/// What it costs to begin with another block, in multiplications.
constexpr double kBlockWork = 200.0;

/// Cuts [0, count) into stretches of about equal work, which depend on nothing but the work.
template <class Work>
std::vector<Stretch> cut(std::size_t count, Work work) {
  std::vector<Stretch> stretches;
  double sum = 0.0;
  std::int64_t begin = 0;
  for (std::size_t k = 0; k < count; ++k) {
    sum += work(k);
    if (sum < kTaskWork && k + 1 < count) continue;
    stretches.push_back({begin, static_cast<std::int64_t>(k) + 1});
    begin = static_cast<std::int64_t>(k) + 1;
    sum = 0.0;
  }
  return stretches;
}

}  // namespace

/// In `place`: k ≥ 0 for the k-th remaining block, -1 - k for the k-th eliminated one.
SchurPlan::SchurPlan(const BlockStructure& structure, std::string_view eliminate,
                     const Kernels& kernels) {
  const std::vector<std::int32_t> set = elimination_set(structure, eliminate);
  std::vector<std::int32_t> place(structure.blocks(), 0);
  for (const std::int32_t block : set) {
    place[block] = -1 - static_cast<std::int32_t>(eliminated.size());
    const std::int32_t size = structure.block_size(block);
    eliminated.push_back({.diagonal = structure.value_begin()[structure.column_begin()[block]],
                          .factor = l_values,
                          .vector = structure.offsets()[block],
                          .part = parts,
                          .first_neighbour = 0,
                          .last_neighbour = 0,
                          .size = size,
                          .block = block});
    l_values += size * size;
    parts += size;
  }
  for (std::int32_t block = 0; block < structure.blocks(); ++block) {
    if (place[block] < 0) continue;
    place[block] = static_cast<std::int32_t>(remaining.size());
    remaining.push_back(block);
    largest_block = std::max(largest_block, structure.block_size(block));
  }
  find_neighbours(structure, place);
  lay_out_y(structure);
  find_reduced(structure, place);
  find_products(structure, kernels);
  count_work();
  cut_into_tasks();
  neighbours.resize(neighbours.size() + kLookahead);
}

void SchurPlan::find_neighbours(const BlockStructure& structure,
                                const std::vector<std::int32_t>& place) {
  // By rising column and row, so that each eliminated block meets its neighbours in their order.
  const auto for_each_neighbour = [&](auto visit) {
    for (std::int32_t j = 0; j < structure.blocks(); ++j) {
      for (std::int64_t e = structure.column_begin()[j] + 1; e < structure.column_begin()[j + 1];
           ++e) {
        const std::int32_t i = structure.rows()[e];
        if (place[i] < 0) visit(-1 - place[i], place[j], e, true);
        if (place[j] < 0) visit(-1 - place[j], place[i], e, false);
      }
    }
  };
  std::vector<std::int64_t> next(eliminated.size() + 1, 0);
  for_each_neighbour(
      [&](std::int32_t element, std::int32_t, std::int64_t, bool) { ++next[element + 1]; });
  std::partial_sum(next.begin(), next.end(), next.begin());
  for (std::size_t k = 0; k < eliminated.size(); ++k) {
    eliminated[k].first_neighbour = next[k];
    eliminated[k].last_neighbour = next[k + 1];
  }
  neighbours.resize(next.back());
  for_each_neighbour(
      [&](std::int32_t element, std::int32_t block, std::int64_t entry, bool transposed) {
        neighbours[next[element]++] = {.source = structure.value_begin()[entry],
                                       .target = 0,
                                       .block = block,
                                       .rows = structure.block_size(remaining[block]),
                                       .transposed = transposed};
      });
}

void SchurPlan::lay_out_y(const BlockStructure& structure) {
  incidence_begin.assign(remaining.size() + 1, 0);
  for (const Neighbour& neighbour : neighbours) ++incidence_begin[neighbour.block + 1];
  std::partial_sum(incidence_begin.begin(), incidence_begin.end(), incidence_begin.begin());
  incidences.resize(neighbours.size());
  std::vector<std::int64_t> next(incidence_begin.begin(), incidence_begin.end() - 1);
  for (std::size_t k = 0; k < eliminated.size(); ++k) {
    const Eliminated& element = eliminated[k];
    for (std::int64_t n = element.first_neighbour; n < element.last_neighbour; ++n) {
      incidences[next[neighbours[n].block]++] = {
          .place = 0,
          .part = element.part,
          .size = element.size,
          .element = static_cast<std::int32_t>(k),
          .nth = static_cast<std::int32_t>(n - element.first_neighbour)};
    }
  }
  for (std::size_t block = 0; block < remaining.size(); ++block) {
    for (std::int64_t k = incidence_begin[block]; k < incidence_begin[block + 1]; ++k) {
      Incidence& incidence = incidences[k];
      incidence.place = y_values;
      neighbours[eliminated[incidence.element].first_neighbour + incidence.nth].target = y_values;
      y_values += structure.block_size(remaining[block]) * incidence.size;
    }
  }
  if (y_values > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(ErrorCode::usage,
                "linear_solver schur: the blocks between eliminated and remaining variables have "
                "more than 2^32 values; try eliminate=independent_set or another solver");
  }
}

/// S has a block where H has one, and where two remaining blocks meet the same eliminated one.
void SchurPlan::find_reduced(const BlockStructure& structure,
                             const std::vector<std::int32_t>& place) {
  std::vector<std::pair<std::int32_t, std::int32_t>> entries;
  std::vector<std::int32_t> seen(remaining.size(), -1);
  for (std::int32_t column = 0; column < static_cast<std::int32_t>(remaining.size()); ++column) {
    const auto add = [&](std::int32_t row) {
      if (seen[row] == column) return;
      seen[row] = column;
      entries.emplace_back(row, column);
    };
    seen[column] = column;
    const std::int32_t j = remaining[column];
    for (std::int64_t e = structure.column_begin()[j] + 1; e < structure.column_begin()[j + 1];
         ++e) {
      if (const std::int32_t row = place[structure.rows()[e]]; row >= 0) add(row);
    }
    for (std::int64_t k = incidence_begin[column]; k < incidence_begin[column + 1]; ++k) {
      const Eliminated& element = eliminated[incidences[k].element];
      for (std::int64_t n = element.first_neighbour + incidences[k].nth + 1;
           n < element.last_neighbour; ++n)
        add(neighbours[n].block);
    }
  }
  std::vector<std::int32_t> sizes;
  sizes.reserve(remaining.size());
  for (const std::int32_t block : remaining) sizes.push_back(structure.block_size(block));
  reduced = BlockStructure(std::move(sizes), std::move(entries));
}

void SchurPlan::find_products(const BlockStructure& structure, const Kernels& kernels) {
  targets.resize(reduced.entries());
  std::vector<std::int64_t> entry_of(remaining.size(), -1);
  std::vector<std::int64_t> count(remaining.size(), 0);
  for (std::int32_t column = 0; column < reduced.blocks(); ++column) {
    for (std::int64_t t = reduced.column_begin()[column]; t < reduced.column_begin()[column + 1];
         ++t) {
      const std::int32_t row = reduced.rows()[t];
      const std::int64_t entry = structure.find(remaining[row], remaining[column]);
      entry_of[row] = t;
      targets[t] = {.source = entry < 0 ? -1 : structure.value_begin()[entry],
                    .value = reduced.value_begin()[t],
                    .first_group = 0,
                    .last_group = 0,
                    .rows = reduced.block_size(row),
                    .columns = reduced.block_size(column)};
    }
    add_products_of_column(column, kernels, entry_of, count);
  }
}

/// The groups of all targets of a column. Eliminated blocks come by rising size, so those of one
/// size make a stretch of the column's incidences, and a group for each target that they reach.
void SchurPlan::add_products_of_column(std::int32_t column, const Kernels& kernels,
                                       std::vector<std::int64_t>& entry_of,
                                       std::vector<std::int64_t>& count) {
  struct OfTarget {
    std::int64_t target;
    Group group;
  };
  std::vector<OfTarget> found;
  std::vector<std::int64_t> group_of(reduced.column_begin()[column + 1] -
                                     reduced.column_begin()[column]);
  const std::int64_t first_target = reduced.column_begin()[column];
  const auto for_each_product = [&](std::int64_t from, std::int64_t to, auto visit) {
    for (std::int64_t k = from; k < to; ++k) {
      const Eliminated& element = eliminated[incidences[k].element];
      for (std::int64_t n = element.first_neighbour + incidences[k].nth; n < element.last_neighbour;
           ++n)
        visit(neighbours[n], incidences[k]);
    }
  };

  const std::int64_t end = incidence_begin[column + 1];
  for (std::int64_t from = incidence_begin[column], to = from; from < end; from = to) {
    const std::int32_t inner = incidences[from].size;
    while (to < end && incidences[to].size == inner) ++to;
    for_each_product(from, to, [&](const Neighbour& row, const Incidence&) { ++count[row.block]; });
    for (std::int64_t t = first_target; t < reduced.column_begin()[column + 1]; ++t) {
      std::int64_t& products = count[reduced.rows()[t]];
      if (products == 0) continue;
      const auto begin = static_cast<std::int64_t>(pairs.size());
      group_of[t - first_target] = static_cast<std::int64_t>(found.size());
      found.push_back({t,
                       {.product = kernels.product(targets[t].rows, targets[t].columns, inner),
                        .first_pair = begin,
                        .last_pair = begin,  // moves on as the pairs are written
                        .inner = inner}});
      pairs.resize(begin + products);
      products = 0;
    }
    for_each_product(from, to, [&](const Neighbour& row, const Incidence& incidence) {
      Group& group = found[group_of[entry_of[row.block] - first_target]].group;
      pairs[group.last_pair++] = {static_cast<std::uint32_t>(row.target),
                                  static_cast<std::uint32_t>(incidence.place)};
    });
  }

  std::ranges::stable_sort(found, {}, &OfTarget::target);
  auto next = found.begin();
  for (std::int64_t t = first_target; t < reduced.column_begin()[column + 1]; ++t) {
    targets[t].first_group = static_cast<std::int64_t>(groups.size());
    for (; next != found.end() && next->target == t; ++next) groups.push_back(next->group);
    targets[t].last_group = static_cast<std::int64_t>(groups.size());
  }
}

void SchurPlan::count_work() {
  for (const Eliminated& element : eliminated) {
    std::int64_t below = 0;
    for (std::int64_t n = element.first_neighbour; n < element.last_neighbour; ++n)
      below += neighbours[n].rows;
    for (std::int64_t c = 0; c < element.size; ++c) {
      const std::int64_t count = element.size - c + below;
      nonzeros += count;
      flops += static_cast<double>(count) * static_cast<double>(count);
    }
  }
}

void SchurPlan::cut_into_tasks() {
  elimination_tasks = cut(eliminated.size(), [&](std::size_t k) {
    const Eliminated& element = eliminated[k];
    double work = kBlockWork + element.size * element.size * element.size;
    for (std::int64_t n = element.first_neighbour; n < element.last_neighbour; ++n)
      work += neighbours[n].rows * element.size * (element.size + 4);
    return work;
  });
  target_tasks = cut(targets.size(), [&](std::size_t t) {
    const Target& target = targets[t];
    double work = kBlockWork;
    for (std::int64_t k = target.first_group; k < target.last_group; ++k) {
      const Group& group = groups[k];
      work += static_cast<double>(group.last_pair - group.first_pair) *
              (target.rows * target.columns * group.inner + 20);
    }
    return work;
  });
}

}  // namespace cairn::schur
