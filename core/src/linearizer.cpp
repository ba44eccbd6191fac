// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/linearizer.hpp"

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "cairn/threads.hpp"

namespace cairn {
namespace {

/// Factors evaluated by one task. Part of the result: partial sums of chi2 are taken chunk by
/// chunk.
constexpr std::size_t kFactorChunk = 256;
/// Block columns gathered by one task, and variables retracted by one.
constexpr std::size_t kColumnChunk = 512;

/// Several factors write one block: they lie side by side in scratch and are added up in factor
/// order.
struct Gather {
  std::int64_t target;   // in the values of H, or in g
  std::int64_t scratch;  // of the first contribution
  std::int32_t size;     // doubles a contribution
  std::int32_t count;
};

void gather(const Gather& sum, const double* scratch, double* target) {
  const double* source = scratch + sum.scratch;
  double* out = target + sum.target;
  if (sum.count == 0) {
    std::fill_n(out, sum.size, 0.0);
    return;
  }
  std::copy_n(source, sum.size, out);
  for (std::int32_t c = 1; c < sum.count; ++c) {
    source += sum.size;
    for (std::int32_t k = 0; k < sum.size; ++k) out[k] += source[k];
  }
}

}  // namespace

struct Linearizer::Plan {
  struct PoolTargets {
    std::vector<std::int64_t> blocks;
    std::vector<std::uint8_t> transposed;
    std::vector<std::int64_t> gradients;
    std::vector<std::uint8_t>
        plain;  // loss scope loop_closures: factors that the loss leaves alone
  };
  struct Chunk {
    std::int32_t pool;
    std::size_t begin, end;
  };

  const Graph* graph;
  std::uint64_t graph_version;
  std::vector<std::int32_t> block_of;                    // by variable
  std::vector<std::int32_t> variable_of;                 // by block
  std::vector<std::vector<std::int64_t>> delta_offsets;  // by variable pool and slot
  BlockStructure structure;
  std::vector<PoolTargets> targets;  // by factor pool
  std::vector<Chunk> chunks;
  std::vector<Gather> block_sums;     // by target
  std::vector<Gather> gradient_sums;  // by block
  AlignedVector scratch;
  std::vector<double> partial;  // chi2 by chunk

  Plan(const Graph& g, const std::vector<bool>& held)
      : graph(&g), graph_version(g.structure_version()) {
    number_blocks(held);
    build_structure();
    assign_targets();
    find_plain_factors();
    for (std::size_t p = 0; p < g.factor_pools().size(); ++p) {
      const std::size_t size = g.factor_pools()[p].size();
      for (std::size_t begin = 0; begin < size; begin += kFactorChunk) {
        chunks.push_back(
            {static_cast<std::int32_t>(p), begin, std::min(size, begin + kFactorChunk)});
      }
    }
    partial.resize(chunks.size());
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
    for_each_pair([&](std::int32_t, std::size_t, std::int32_t row, std::int32_t column) {
      if (row >= 0 && column >= 0 && row != column) entries.emplace_back(row, column);
    });
    structure = BlockStructure(std::move(sizes), std::move(entries));
    for (const VariablePool& pool : graph->variable_pools()) {
      std::vector<std::int64_t>& offsets = delta_offsets.emplace_back();
      offsets.reserve(pool.variables.size());
      for (const std::int32_t v : pool.variables) {
        offsets.push_back(block_of[v] < 0 ? -1 : structure.offsets()[block_of[v]]);
      }
    }
  }

  /// Calls visit(pool, place of the pair in PoolTargets::blocks, block of a, block of b) for all
  /// pairs a ≤ b of variables of all factors, in the order of the factors.
  template <class Visit>
  void for_each_pair(Visit visit) const {
    for (int position = 0; position < graph->factor_count(); ++position) {
      const FactorRef ref = graph->factor(position);
      const std::span<const std::int32_t> v = graph->factor_variables(position);
      std::size_t pair = static_cast<std::size_t>(ref.entry) * (v.size() * (v.size() + 1) / 2);
      for (std::size_t a = 0; a < v.size(); ++a) {
        for (std::size_t b = a; b < v.size(); ++b)
          visit(ref.pool, pair++, block_of[v[a]], block_of[v[b]]);
      }
    }
  }

  /// A block with one contributor is written in place; the others get room in scratch, contribution
  /// by contribution. So do all gradients.
  void assign_targets() {
    std::vector<std::int32_t> contributors(structure.entries(), 0),
        gradient_contributors(structure.blocks(), 0);
    std::vector<std::int64_t> entry_of_pair;
    for_each_pair([&](std::int32_t, std::size_t, std::int32_t a, std::int32_t b) {
      if (a < 0 || b < 0) return;
      const std::int64_t entry = structure.find(std::max(a, b), std::min(a, b));
      entry_of_pair.push_back(entry);
      ++contributors[entry];
      if (a == b) ++gradient_contributors[a];
    });

    std::int64_t used = 0;
    std::vector<std::int64_t> next(structure.entries(), -1), next_gradient(structure.blocks());
    for (std::int32_t j = 0; j < structure.blocks(); ++j) {
      for (std::int64_t e = structure.column_begin()[j]; e < structure.column_begin()[j + 1]; ++e) {
        if (contributors[e] == 1) continue;
        const std::int32_t size =
            structure.block_size(structure.rows()[e]) * structure.block_size(j);
        block_sums.push_back({structure.value_begin()[e], used, size, contributors[e]});
        next[e] = used;
        used += static_cast<std::int64_t>(size) * contributors[e];
      }
      const std::int32_t size = structure.block_size(j);
      gradient_sums.push_back({structure.offsets()[j], used, size, gradient_contributors[j]});
      next_gradient[j] = used;
      used += static_cast<std::int64_t>(size) * gradient_contributors[j];
    }
    scratch.resize(used);

    targets.resize(graph->factor_pools().size());
    for (std::size_t p = 0; p < targets.size(); ++p) {
      const FactorPool& pool = graph->factor_pools()[p];
      const std::size_t arity = static_cast<std::size_t>(pool.type->arity()),
                        pairs = arity * (arity + 1) / 2;
      targets[p].blocks.assign(pool.size() * pairs, LinearizeSink::kNone);
      targets[p].transposed.assign(pool.size() * pairs, 0);
      targets[p].gradients.assign(pool.size() * arity, LinearizeSink::kNone);
    }
    auto entry = entry_of_pair.begin();
    for_each_pair([&](std::int32_t p, std::size_t pair, std::int32_t a, std::int32_t b) {
      if (a < 0 || b < 0) return;
      const std::int64_t e = *entry++;
      if (next[e] < 0) {
        targets[p].blocks[pair] = structure.value_begin()[e];
      } else {
        targets[p].blocks[pair] = ~next[e];
        next[e] += static_cast<std::int64_t>(structure.block_size(a)) * structure.block_size(b);
      }
      targets[p].transposed[pair] = a < b;
    });
    for (int position = 0; position < graph->factor_count(); ++position) {
      const FactorRef ref = graph->factor(position);
      const std::span<const std::int32_t> v = graph->factor_variables(position);
      for (std::size_t a = 0; a < v.size(); ++a) {
        const std::int32_t block = block_of[v[a]];
        if (block < 0) continue;
        targets[ref.pool].gradients[ref.entry * v.size() + a] = next_gradient[block];
        next_gradient[block] += structure.block_size(block);
      }
    }
  }

  void find_plain_factors() {
    const std::vector<bool> closes_loop = loop_closures(*graph);
    for (std::size_t p = 0; p < targets.size(); ++p) {
      const FactorPool& pool = graph->factor_pools()[p];
      targets[p].plain.resize(pool.size());
      for (std::size_t f = 0; f < pool.size(); ++f)
        targets[p].plain[f] = !closes_loop[pool.sequence[f]];
    }
  }

  void check_graph() const {
    if (graph->structure_version() != graph_version) {
      throw std::logic_error(
          "the graph has changed since this linearizer was made: make a new one");
    }
  }

  /// rho and weight of the factors of one chunk from their squared norms; returns Σ rho.
  double apply_loss(const Chunk& chunk, std::span<const double> norms,
                    std::span<double> weights) const {
    const Loss* loss = graph->loss();
    if (!loss) return std::accumulate(norms.begin(), norms.end(), 0.0);
    double rho[kFactorChunk];
    const std::span<double> rhos(rho, norms.size());
    loss->evaluate(norms, rhos, weights);
    if (graph->loss_scope() == LossScope::loop_closures) {
      const std::uint8_t* plain = targets[chunk.pool].plain.data() + chunk.begin;
      for (std::size_t k = 0; k < norms.size(); ++k) {
        if (!plain[k]) continue;
        rhos[k] = norms[k];
        if (!weights.empty()) weights[k] = 1.0;
      }
    }
    return std::accumulate(rhos.begin(), rhos.end(), 0.0);
  }

  /// The view of every factor pool at given states.
  struct Views {
    std::vector<std::vector<const double*>> states;
    std::vector<FactorView> pools;
    Views(const Graph& graph, const Values& values) : states(graph.factor_pools().size()) {
      for (std::size_t p = 0; p < states.size(); ++p) {
        pools.push_back(graph.view(static_cast<int>(p), values, states[p]));
      }
    }
  };
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

double Linearizer::chi2(const Values& values) const {
  Plan& plan = *plan_;
  plan.check_graph();
  const Plan::Views views(*plan.graph, values);
  for_each_chunk(plan.chunks.size(), [&](std::size_t c) {
    const Plan::Chunk& chunk = plan.chunks[c];
    double norms[kFactorChunk];
    const std::span<double> used(norms, chunk.end - chunk.begin);
    plan.graph->factor_pools()[chunk.pool].type->squared_norms(views.pools[chunk.pool], chunk.begin,
                                                               chunk.end, norms);
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
  const Plan::Views views(*plan.graph, values);
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
    const FactorView& view = views.pools[chunk.pool];
    double norms[kFactorChunk], weights[kFactorChunk];
    const std::size_t count = chunk.end - chunk.begin;
    if (plan.graph->loss()) {
      type.squared_norms(view, chunk.begin, chunk.end, norms);
      plan.partial[c] = plan.apply_loss(chunk, {norms, count}, {weights, count});
      type.linearize(view, chunk.begin, chunk.end, weights, sink, nullptr);
    } else {
      type.linearize(view, chunk.begin, chunk.end, nullptr, sink, norms);
      plan.partial[c] = plan.apply_loss(chunk, {norms, count}, {});
    }
  });
  for_each_range(plan.block_sums.size(), kColumnChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) gather(plan.block_sums[k], scratch, H_values);
  });
  for_each_range(plan.gradient_sums.size(), 4 * kColumnChunk,
                 [&](std::size_t begin, std::size_t end) {
                   for (std::size_t k = begin; k < end; ++k)
                     gather(plan.gradient_sums[k], scratch, g.data());
                 });
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
