// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/linear/linearizer.hpp"

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "cairn/runtime/threads.hpp"
#include "graph/factor_call.hpp"

namespace cairn {
namespace {

/// Factors evaluated by one task. Part of the result: partial sums of chi2 are taken chunk by
/// chunk.
constexpr std::size_t kFactorChunk = 256;
/// Block columns gathered by one task, and variables retracted by one.
constexpr std::size_t kColumnChunk = 512;

/// Several factors write one block: what each chunk of factors adds to it has a place of its own in
/// scratch, and the places are added up in the order of the chunks.
struct Gather {
  std::int64_t target;  // in the values of H, or in g
  std::int32_t size;    // doubles
};

void gather(const Gather& sum, std::span<const std::int64_t> places, const double* scratch,
            double* target) {
  double* out = target + sum.target;
  if (places.empty()) {
    std::fill_n(out, sum.size, 0.0);
    return;
  }
  std::copy_n(scratch + places[0], sum.size, out);
  for (const std::int64_t place : places.subspan(1)) {
    for (std::int32_t k = 0; k < sum.size; ++k) out[k] += scratch[place + k];
  }
}

/// Sums of the same kind with the places of each, in compressed rows.
struct Gathers {
  std::vector<Gather> sums;
  std::vector<std::int64_t> places;
  std::vector<std::int64_t> begin{0};

  /// To be called sum by sum; `contributions` are (sum, place), in the order of the chunks.
  void sort_in(std::span<const std::pair<std::int64_t, std::int64_t>> contributions) {
    begin.assign(sums.size() + 1, 0);
    for (const auto& [sum, place] : contributions) ++begin[sum + 1];
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    places.resize(contributions.size());
    std::vector<std::int64_t> next(begin.begin(), begin.end() - 1);
    for (const auto& [sum, place] : contributions) places[next[sum]++] = place;
  }
  void add_up(std::size_t k, const double* scratch, double* target) const {
    gather(sums[k], std::span(places).subspan(begin[k], begin[k + 1] - begin[k]), scratch, target);
  }
};

}  // namespace

struct Linearizer::Plan {
  struct PoolTargets {
    std::vector<std::int64_t> blocks;
    std::vector<std::uint8_t> transposed;
    std::vector<std::int64_t> gradients;
  };
  struct Chunk {
    std::int32_t pool;
    std::size_t begin, end;
    std::int64_t scratch_begin = 0, scratch_end = 0;  // what its factors add to
  };

  const Graph* graph;
  std::uint64_t graph_version;
  std::vector<std::int32_t> block_of;                    // by variable
  std::vector<std::int32_t> variable_of;                 // by block
  std::vector<std::vector<std::int64_t>> delta_offsets;  // by variable pool and slot
  BlockStructure structure;
  std::vector<PoolTargets> targets;  // by factor pool
  std::vector<Chunk> chunks;
  Gathers block_sums;     // by target
  Gathers gradient_sums;  // by block
  AlignedVector scratch;
  std::vector<double> partial;                     // chi2 by chunk
  std::vector<FactorView> views;                   // by factor pool, at the states at hand
  std::vector<std::vector<const double*>> states;  // what the views point to

  Plan(const Graph& g, const std::vector<bool>& held)
      : graph(&g), graph_version(g.structure_version()) {
    number_blocks(held);
    build_structure();
    for (std::size_t p = 0; p < g.factor_pools().size(); ++p) {
      const std::size_t size = g.factor_pools()[p].size();
      for (std::size_t begin = 0; begin < size; begin += kFactorChunk) {
        chunks.push_back(
            {static_cast<std::int32_t>(p), begin, std::min(size, begin + kFactorChunk)});
      }
    }
    partial.resize(chunks.size());
    views.resize(g.factor_pools().size());
    states.resize(views.size());
    assign_targets();
  }

  void number_blocks(const std::vector<bool>& held) {
    block_of.assign(graph->variable_count(), -1);
    for (int v = 0; v < graph->variable_count(); ++v) {
      if (held[v]) continue;
      block_of[v] = static_cast<std::int32_t>(variable_of.size());
      variable_of.push_back(v);
    }
  }

  void build_structure() {
    std::vector<std::int32_t> sizes;
    sizes.reserve(variable_of.size());
    for (const std::int32_t v : variable_of) sizes.push_back(graph->type(v).tangent_size());
    std::vector<std::pair<std::int32_t, std::int32_t>> entries;
    for (const FactorPool& pool : graph->factor_pools()) {
      for (std::size_t f = 0; f < pool.size(); ++f) {
        for_each_pair(pool, f, [&](std::size_t, std::int32_t row, std::int32_t column) {
          if (row != column) entries.emplace_back(row, column);
        });
      }
    }
    structure = BlockStructure(std::move(sizes), std::move(entries));
    for (const VariablePool& pool : graph->variable_pools()) {
      std::vector<std::int64_t>& offsets = delta_offsets.emplace_back();
      offsets.reserve(pool.variables.size());
      for (const std::int32_t v : pool.variables) {
        offsets.push_back(block_of[v] < 0 ? -1 : structure.offsets()[block_of[v]]);
      }
    }
  }

  /// Calls visit(place of the pair in PoolTargets::blocks, block of a, block of b) for all pairs
  /// a ≤ b of variables of one factor that are not held.
  template <class Visit>
  void for_each_pair(const FactorPool& pool, std::size_t factor, Visit visit) const {
    const std::size_t arity = static_cast<std::size_t>(pool.type->arity());
    const std::int32_t* v = pool.variables.data() + factor * arity;
    std::size_t pair = factor * (arity * (arity + 1) / 2);
    for (std::size_t a = 0; a < arity; ++a) {
      for (std::size_t b = a; b < arity; ++b, ++pair) {
        if (block_of[v[a]] >= 0 && block_of[v[b]] >= 0) visit(pair, block_of[v[a]], block_of[v[b]]);
      }
    }
  }

  /// A block with one contributor is written in place. To the others each chunk of factors adds in
  /// a place of its own, and so it does to the gradients.
  void assign_targets() {
    targets.resize(graph->factor_pools().size());
    std::vector<std::int32_t> contributors(structure.entries(), 0);
    for (std::size_t p = 0; p < targets.size(); ++p) {
      const FactorPool& pool = graph->factor_pools()[p];
      const std::size_t arity = static_cast<std::size_t>(pool.type->arity()),
                        pairs = arity * (arity + 1) / 2;
      targets[p].blocks.assign(pool.size() * pairs, LinearizeSink::kNone);
      targets[p].transposed.assign(pool.size() * pairs, 0);
      targets[p].gradients.assign(pool.size() * arity, LinearizeSink::kNone);
      for (std::size_t f = 0; f < pool.size(); ++f) {
        for_each_pair(pool, f, [&](std::size_t pair, std::int32_t a, std::int32_t b) {
          const std::int64_t entry = structure.find(std::max(a, b), std::min(a, b));
          ++contributors[entry];
          targets[p].blocks[pair] = entry;  // until its target is known
          targets[p].transposed[pair] = a < b;
        });
      }
    }

    std::vector<std::int64_t> sum_of(structure.entries(), -1);
    for (std::int32_t j = 0; j < structure.blocks(); ++j) {
      const std::int32_t size = structure.block_size(j);
      gradient_sums.sums.push_back({structure.offsets()[j], size});
      for (std::int64_t e = structure.column_begin()[j]; e < structure.column_begin()[j + 1]; ++e) {
        if (contributors[e] == 1) continue;
        sum_of[e] = std::ssize(block_sums.sums);
        block_sums.sums.push_back(
            {structure.value_begin()[e], structure.block_size(structure.rows()[e]) * size});
      }
    }

    std::int64_t used = 0;
    std::vector<std::pair<std::int64_t, std::int64_t>> to_blocks, to_gradients;
    std::vector<std::int64_t> block_place(block_sums.sums.size(), -1),
        gradient_place(structure.blocks(), -1);
    // The place of a sum in the chunk at hand: a new one if the last is an earlier chunk's.
    const auto place_of = [&](Chunk& chunk, const Gathers& gathers, std::int64_t sum,
                              std::vector<std::int64_t>& place, auto& contributions) {
      if (place[sum] < chunk.scratch_begin) {
        place[sum] = used;
        used += gathers.sums[sum].size;
        contributions.emplace_back(sum, place[sum]);
      }
      return place[sum];
    };
    for (Chunk& chunk : chunks) {
      const FactorPool& pool = graph->factor_pools()[chunk.pool];
      PoolTargets& target = targets[chunk.pool];
      const std::size_t arity = static_cast<std::size_t>(pool.type->arity());
      chunk.scratch_begin = used;
      for (std::size_t f = chunk.begin; f < chunk.end; ++f) {
        for_each_pair(pool, f, [&](std::size_t pair, std::int32_t, std::int32_t) {
          const std::int64_t entry = target.blocks[pair], sum = sum_of[entry];
          target.blocks[pair] = sum < 0 ? structure.value_begin()[entry]
                                        : ~place_of(chunk, block_sums, sum, block_place, to_blocks);
        });
        for (std::size_t k = f * arity; k < (f + 1) * arity; ++k) {
          const std::int32_t block = block_of[pool.variables[k]];
          if (block >= 0) {
            target.gradients[k] =
                place_of(chunk, gradient_sums, block, gradient_place, to_gradients);
          }
        }
      }
      used = (used + 7) / 8 * 8;  // two threads never write one cache line
      chunk.scratch_end = used;
    }
    scratch.resize(used);
    block_sums.sort_in(to_blocks);
    gradient_sums.sort_in(to_gradients);
  }

  void check_graph() const {
    if (graph->structure_version() != graph_version) {
      throw std::logic_error(
          "the graph has changed since this linearizer was made: make a new one");
    }
  }

  bool has_loss(const Chunk& chunk) const {
    return graph->any_loss(chunk.pool, chunk.begin, chunk.end);
  }

  /// Σ rho of the factors of one chunk from their squared norms, and their weights.
  double apply_loss(const Chunk& chunk, std::span<const double> norms,
                    std::span<double> weights) const {
    double rho[kFactorChunk];
    const std::span<double> rhos(rho, norms.size());
    graph->weigh(chunk.pool, chunk.begin, norms, rhos, weights);
    return std::accumulate(rhos.begin(), rhos.end(), 0.0);
  }

  /// Sets `views` to these states.
  void look_at(const Values& values) {
    for (std::size_t p = 0; p < views.size(); ++p)
      views[p] = graph->view(static_cast<int>(p), values, states[p]);
  }
};

Linearizer::Linearizer(const Graph& graph, std::vector<bool> held) {
  if (held.size() != static_cast<std::size_t>(graph.variable_count())) {
    throw std::logic_error("Linearizer: one flag for each variable of the graph is needed");
  }
  plan_ = std::make_unique<Plan>(graph, held);
}
Linearizer::Linearizer(Linearizer&&) noexcept = default;
Linearizer::~Linearizer() = default;

const BlockStructure& Linearizer::structure() const { return plan_->structure; }
int Linearizer::block_of(int variable) const { return plan_->block_of[variable]; }
int Linearizer::variable_of(int block) const { return plan_->variable_of[block]; }

double Linearizer::chi2(const Values& values) {
  Plan& plan = *plan_;
  plan.check_graph();
  plan.look_at(values);
  for_each_chunk(plan.chunks.size(), [&](std::size_t c) {
    const Plan::Chunk& chunk = plan.chunks[c];
    double norms[kFactorChunk];
    const std::span<double> used(norms, chunk.end - chunk.begin);
    const FactorType& type = *plan.graph->factor_pools()[chunk.pool].type;
    call_factor(type,
                [&] { type.squared_norms(plan.views[chunk.pool], chunk.begin, chunk.end, norms); });
    plan.partial[c] = plan.apply_loss(chunk, used, {});
  });
  return std::accumulate(plan.partial.begin(), plan.partial.end(), 0.0);
}

double Linearizer::linearize(const Values& values, BlockMatrix& H, std::span<double> g) {
  Plan& plan = *plan_;
  plan.check_graph();
  if (&H.structure() != &plan.structure ||
      g.size() != static_cast<std::size_t>(plan.structure.size())) {
    throw std::logic_error("Linearizer::linearize: H or g was not made for this structure");
  }
  plan.look_at(values);
  double* H_values = H.values().data();
  double* scratch = plan.scratch.data();
  for_each_chunk(plan.chunks.size(), [&](std::size_t c) {
    const Plan::Chunk& chunk = plan.chunks[c];
    const Plan::PoolTargets& targets = plan.targets[chunk.pool];
    const FactorType& type = *plan.graph->factor_pools()[chunk.pool].type;
    const LinearizeSink sink{.H = H_values,
                             .scratch = scratch,
                             .blocks = targets.blocks.data(),
                             .transposed = targets.transposed.data(),
                             .gradients = targets.gradients.data()};
    const FactorView& view = plan.views[chunk.pool];
    std::fill(scratch + chunk.scratch_begin, scratch + chunk.scratch_end, 0.0);
    double norms[kFactorChunk], weights[kFactorChunk];
    const std::size_t count = chunk.end - chunk.begin;
    if (plan.has_loss(chunk)) {
      call_factor(type, [&] { type.squared_norms(view, chunk.begin, chunk.end, norms); });
      plan.partial[c] = plan.apply_loss(chunk, {norms, count}, {weights, count});
      call_factor(type,
                  [&] { type.linearize(view, chunk.begin, chunk.end, weights, sink, nullptr); });
    } else {
      call_factor(type,
                  [&] { type.linearize(view, chunk.begin, chunk.end, nullptr, sink, norms); });
      plan.partial[c] = std::accumulate(norms, norms + count, 0.0);
    }
  });
  const auto add_up = [&](const Gathers& gathers, std::size_t grain, double* target) {
    for_each_range(gathers.sums.size(), grain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) gathers.add_up(k, scratch, target);
    });
  };
  add_up(plan.block_sums, kColumnChunk, H_values);
  add_up(plan.gradient_sums, 4 * kColumnChunk, g.data());
  return std::accumulate(plan.partial.begin(), plan.partial.end(), 0.0);
}

void Linearizer::retract(const Values& values, std::span<const double> delta, Values& out) const {
  const Plan& plan = *plan_;
  plan.check_graph();
  out.pools.resize(values.pools.size());
  for (std::size_t p = 0; p < values.pools.size(); ++p) {
    const VariablePool& pool = plan.graph->variable_pools()[p];
    const std::size_t ambient = static_cast<std::size_t>(pool.type->ambient_size());
    out.pools[p].resize(values.pools[p].size());
    for_each_range(pool.variables.size(), kColumnChunk, [&](std::size_t begin, std::size_t end) {
      pool.type->retract(end - begin, values.pools[p].data() + begin * ambient,
                         plan.delta_offsets[p].data() + begin, delta.data(),
                         out.pools[p].data() + begin * ambient);
    });
  }
}

}  // namespace cairn
