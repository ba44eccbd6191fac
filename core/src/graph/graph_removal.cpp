// SPDX-License-Identifier: BSD-3-Clause
// What leaves a graph: pools closed up, what stays renumbered.
#include <algorithm>
#include <cstddef>
#include <utility>

#include <fmt/core.h>

#include "cairn/graph/graph.hpp"
#include "cairn/graph/id_text.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

/// Numbers what stays from 0 on, and marks what leaves by -1.
std::vector<std::int32_t> numbers_of_what_stays(const std::vector<bool>& leaves) {
  std::vector<std::int32_t> number(leaves.size(), -1);
  std::int32_t next = 0;
  for (std::size_t k = 0; k < leaves.size(); ++k) {
    if (!leaves[k]) number[k] = next++;
  }
  return number;
}

/// Moves group `from` of `size` elements to place `to`, which is not after it.
template <class Array>
void move_group(Array& array, std::size_t from, std::size_t to, std::size_t size) {
  if (from != to) std::copy_n(array.begin() + from * size, size, array.begin() + to * size);
}

/// Leaves the information matrices that factors have.
void drop_unused_noises(FactorPool& pool) {
  const std::size_t packed = packed_size(pool.type->residual_size());
  std::ranges::fill(pool.uses, 0);
  for (const std::int32_t noise : pool.noises) ++pool.uses[noise];
  std::vector<std::int32_t> number(pool.uses.size());
  std::size_t kept = 0;
  for (std::size_t k = 0; k < number.size(); ++k) {
    if (pool.uses[k] == 0) continue;
    move_group(pool.information, k, kept, packed);
    move_group(pool.sqrt_information, k, kept, packed);
    pool.ranks[kept] = pool.ranks[k];
    pool.uses[kept] = pool.uses[k];
    number[k] = static_cast<std::int32_t>(kept++);
  }
  pool.information.resize(kept * packed);
  pool.sqrt_information.resize(kept * packed);
  pool.ranks.resize(kept);
  pool.uses.resize(kept);
  pool.recent = {};
  for (std::size_t k = 0; k < kept; ++k) {
    pool.recent.note({pool.information.data() + k * packed, packed}, static_cast<std::int32_t>(k));
  }
  for (std::int32_t& noise : pool.noises) noise = number[noise];
}

}  // namespace

Renumbering Graph::remove(const std::vector<bool>& factors, const std::vector<bool>& variables) {
  if (factors.size() != factors_.size() || variables.size() != records_.size()) {
    throw Error(ErrorCode::usage,
                fmt::format("Graph::remove: {} and {} marks for {} factors and {} variables",
                            factors.size(), variables.size(), factors_.size(), records_.size()));
  }
  for (int f = 0; f < factor_count(); ++f) {
    if (factors[f]) continue;
    for (const std::int32_t v : factor_variables(f)) {
      if (!variables[v]) continue;
      throw Error(ErrorCode::usage, fmt::format("{} cannot be removed: {} is on it and stays",
                                                describe_variable(v), describe_factor(f)));
    }
  }
  Renumbering numbers{numbers_of_what_stays(variables), numbers_of_what_stays(factors)};
  remove_factors(factors, numbers.factor);
  remove_variables(variables, numbers.variable);
  ++structure_version_;
  return numbers;
}

Renumbering Graph::erase(Id id) {
  const std::optional<int> v = find(id);
  if (!v)
    throw Error(ErrorCode::usage, fmt::format("there is no variable {} to erase", id_text(id)));
  std::vector<bool> variables(records_.size(), false), factors(factors_.size(), false);
  variables[*v] = true;
  for (const int f : factors_of(*v)) factors[f] = true;
  return remove(factors, variables);
}

Renumbering Graph::erase_factor(int position) {
  if (position < 0 || position >= factor_count())
    throw Error(ErrorCode::usage, fmt::format("there is no factor {} to erase", position));
  std::vector<bool> factors(factors_.size(), false);
  factors[position] = true;
  return remove(factors, std::vector<bool>(records_.size(), false));
}

void Graph::remove_factors(const std::vector<bool>& leaves,
                           const std::vector<std::int32_t>& position) {
  std::vector<FactorPool> pools;
  GrowingArray<FactorRef> factors;
  factors.resize(static_cast<std::size_t>(std::ranges::count(leaves, false)));
  for (FactorPool& pool : factor_pools_) {
    const std::size_t arity = static_cast<std::size_t>(pool.type->arity()),
                      measurement = static_cast<std::size_t>(pool.type->measurement_size());
    std::size_t kept = 0;
    for (std::size_t f = 0; f < pool.size(); ++f) {
      const std::int32_t now = position[pool.sequence[f]];
      if (now < 0) continue;
      move_group(pool.slots, f, kept, arity);
      move_group(pool.variables, f, kept, arity);
      move_group(pool.measurements, f, kept, measurement);
      pool.noises[kept] = pool.noises[f];
      pool.losses[kept] = pool.losses[f];
      pool.sequence[kept] = now;
      factors[now] = {static_cast<std::int32_t>(pools.size()), static_cast<std::int32_t>(kept++)};
    }
    if (kept == 0) continue;
    pool.slots.resize(kept * arity);
    pool.variables.resize(kept * arity);
    pool.measurements.resize(kept * measurement);
    pool.noises.resize(kept);
    pool.losses.resize(kept);
    pool.sequence.resize(kept);
    drop_unused_noises(pool);
    pools.push_back(std::move(pool));
  }
  factor_pools_ = std::move(pools);
  factors_ = std::move(factors);
}

void Graph::remove_variables(const std::vector<bool>& leaves,
                             const std::vector<std::int32_t>& index) {
  std::vector<std::int32_t> slot(records_.size(), -1);  // by old index
  for (std::size_t p = 0; p < variable_pools_.size(); ++p) {
    VariablePool& pool = variable_pools_[p];
    const std::size_t ambient = static_cast<std::size_t>(pool.type->ambient_size());
    std::size_t kept = 0;
    for (std::size_t s = 0; s < pool.variables.size(); ++s) {
      const std::int32_t v = pool.variables[s];
      if (leaves[v]) continue;
      move_group(values_.pools[p], s, kept, ambient);
      pool.variables[kept] = index[v];
      slot[v] = static_cast<std::int32_t>(kept++);
    }
    pool.variables.resize(kept);
    values_.pools[p].resize(kept * ambient);
  }
  for (std::size_t v = 0; v < records_.size(); ++v) {
    if (leaves[v]) {
      index_of_id_.erase(records_[v].id);
      continue;
    }
    records_[v].slot = slot[v];
    records_[index[v]] = records_[v];
    index_of_id_[records_[v].id] = index[v];
  }
  records_.resize(static_cast<std::size_t>(std::ranges::count(leaves, false)));
  for (FactorPool& pool : factor_pools_) {
    for (std::size_t k = 0; k < pool.variables.size(); ++k) {
      pool.slots[k] = slot[pool.variables[k]];
      pool.variables[k] = index[pool.variables[k]];
    }
  }
}

}  // namespace cairn
