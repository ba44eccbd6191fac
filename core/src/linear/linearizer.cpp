// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/linear/linearizer.hpp"

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "cairn/runtime/threads.hpp"
#include "cairn/types/factor_call.hpp"

namespace cairn {
namespace {

/// Factors evaluated by one task. Part of the result: partial sums of chi2 are taken chunk by
/// chunk.
constexpr std::size_t kFactorChunk = 256;
/// Block columns gathered by one task, and variables retracted by one.
constexpr std::size_t kColumnChunk = 512;

using Target = LinearizeTarget;

/// A block of H or a part of g to which factors of several runs contribute: the first run sums in
/// place, what the others add has places of its own in scratch, which are added in the order of the
/// factors.
struct Sum {
  Target::Array array;
  std::int32_t size;    // doubles
  std::int64_t offset;  // in the array
  std::int64_t begin;   // of its places
};

template <class Size>
void gather(std::span<const std::int64_t> places, const double* scratch, Size size, double* out) {
  for (const std::int64_t place : places) {
    for (int k = 0; k < size; ++k) out[k] += scratch[place + k];
  }
}

/// The same with loops of constant size, which are unrolled, for the sizes of poses and points.
void gather_any(std::span<const std::int64_t> places, const double* scratch, int size,
                double* out) {
  const auto with = [&](auto constant) { gather(places, scratch, constant, out); };
  if (size == 2) return with(std::integral_constant<int, 2>());
  if (size == 3) return with(std::integral_constant<int, 3>());
  if (size == 4) return with(std::integral_constant<int, 4>());
  if (size == 6) return with(std::integral_constant<int, 6>());
  if (size == 9) return with(std::integral_constant<int, 9>());
  if (size == 36) return with(std::integral_constant<int, 36>());
  gather(places, scratch, size, out);
}

}  // namespace

struct Linearizer::Plan {
  struct PoolTargets {
    std::vector<Target> blocks, gradients;
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
  std::size_t runs = 0;  // of chunks, each worked off by one thread
  std::vector<Sum> sums;
  std::vector<std::int64_t> places;     // of all sums, in scratch
  std::vector<std::int32_t> untouched;  // blocks of variables without factors
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

  /// One thread works off all chunks in one run. Of several, each takes the next run in turn.
  std::size_t wanted_runs() const {
    constexpr std::size_t kRunsPerThread = 8;
    const auto count = static_cast<std::size_t>(threads());
    return std::min(std::max<std::size_t>(chunks.size(), 1),
                    count == 1 ? 1 : count * kRunsPerThread);
  }
  std::size_t run_begin(std::size_t run) const { return run * chunks.size() / runs; }

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

  /// Calls on_pair(target, entry of H, transposed) and on_slot(target, block) for what all factors
  /// of a run contribute, in their order.
  template <class OnPair, class OnSlot>
  void for_each_target(std::size_t run, const OnPair& on_pair, const OnSlot& on_slot) {
    for (std::size_t c = run_begin(run); c < run_begin(run + 1); ++c) {
      const FactorPool& pool = graph->factor_pools()[chunks[c].pool];
      PoolTargets& pool_targets = targets[chunks[c].pool];
      const std::size_t arity = static_cast<std::size_t>(pool.type->arity());
      for (std::size_t f = chunks[c].begin; f < chunks[c].end; ++f) {
        for_each_pair(pool, f, [&](std::size_t pair, std::int32_t a, std::int32_t b) {
          const std::int64_t entry =
              a == b ? structure.column_begin()[a] : structure.find(std::max(a, b), std::min(a, b));
          on_pair(pool_targets.blocks[pair], entry, a < b);
        });
        for (std::size_t k = f * arity; k < (f + 1) * arity; ++k) {
          const std::int32_t block = block_of[pool.variables[k]];
          if (block >= 0) on_slot(pool_targets.gradients[k], block);
        }
      }
    }
  }

  /// Every sum is that of its contributions in the order of the factors, however many runs there
  /// are. The first is written in place, and the others of the same run are added to it; those of
  /// later runs have places in scratch. So one run needs no scratch.
  void assign_targets() {
    runs = wanted_runs();
    targets.assign(graph->factor_pools().size(), {});
    for (std::size_t p = 0; p < targets.size(); ++p) {
      const FactorPool& pool = graph->factor_pools()[p];
      const std::size_t arity = static_cast<std::size_t>(pool.type->arity());
      targets[p].blocks.resize(pool.size() * (arity * (arity + 1) / 2));
      targets[p].gradients.resize(pool.size() * arity);
    }
    const Sums found = find_sums();
    std::vector<std::pair<std::int64_t, std::int64_t>> contributions;  // sum, place
    std::int64_t used = 0;
    std::vector<bool> begun(structure.entries(), false), begun_gradient(structure.blocks(), false);
    const auto put = [&](Target& target, const Sum& what, std::int64_t sum, bool here,
                         bool transposed, std::vector<bool>::reference started) {
      if (!here) {
        target = Target(Target::Array::scratch, used, Target::How::write, transposed);
        contributions.emplace_back(sum, used);
        used += what.size;
      } else {
        target = Target(what.array, what.offset, started ? Target::How::add : Target::How::write,
                        transposed);
      }
      started = true;
    };
    for (std::size_t run = 0; run < runs; ++run) {
      used = (used + 7) / 8 * 8;  // two threads never write one cache line
      for_each_target(
          run,
          [&](Target& target, std::int64_t entry, bool transposed) {
            put(target, block_sum(entry), found.number[entry], found.first_run[entry] == run,
                transposed, begun[entry]);
          },
          [&](Target& target, std::int32_t block) {
            const std::int64_t entry = structure.column_begin()[block];
            put(target, gradient_sum(block), found.number[entry] + 1, found.first_run[entry] == run,
                false, begun_gradient[block]);
          });
    }
    scratch = AlignedVector(used);
    sort_places(contributions);
    untouched.clear();
    for (std::int32_t j = 0; j < structure.blocks(); ++j) {
      if (!begun[structure.column_begin()[j]]) untouched.push_back(j);
    }
  }

  Sum block_sum(std::int64_t entry) const {
    const std::int64_t begin = structure.value_begin()[entry];
    return {Target::Array::H, static_cast<std::int32_t>(structure.value_begin()[entry + 1] - begin),
            begin, 0};
  }
  Sum gradient_sum(std::int32_t block) const {
    return {Target::Array::gradient, structure.block_size(block), structure.offsets()[block], 0};
  }

  /// By entry of H: the first run that contributes to it, and the number of its sum if others do;
  /// that of a gradient follows that of the block on the diagonal.
  struct Sums {
    std::vector<std::uint32_t> first_run;
    std::vector<std::int64_t> number;
  };
  /// Lists the sums to which several runs contribute.
  Sums find_sums() {
    sums.clear();
    const std::size_t entries = static_cast<std::size_t>(structure.entries());
    Sums found{std::vector<std::uint32_t>(entries, 0), std::vector<std::int64_t>(entries, -1)};
    if (runs == 1) return found;
    constexpr std::uint32_t kNobody = ~std::uint32_t{0};
    std::ranges::fill(found.first_run, kNobody);
    std::vector<bool> shared(entries, false);
    for (std::size_t run = 0; run < runs; ++run) {
      for_each_target(
          run,
          [&](Target&, std::int64_t entry, bool) {
            std::uint32_t& first = found.first_run[entry];
            if (first == kNobody) first = static_cast<std::uint32_t>(run);
            if (first != run) shared[entry] = true;
          },
          [](Target&, std::int32_t) {});
    }
    for (std::int32_t j = 0; j < structure.blocks(); ++j) {
      const std::int64_t diagonal = structure.column_begin()[j];
      for (std::int64_t e = diagonal; e < structure.column_begin()[j + 1]; ++e) {
        if (!shared[e]) continue;
        found.number[e] = std::ssize(sums);
        sums.push_back(block_sum(e));
        if (e == diagonal) sums.push_back(gradient_sum(j));
      }
    }
    return found;
  }

  /// `contributions`: (sum, place), in the order of the factors.
  void sort_places(std::span<const std::pair<std::int64_t, std::int64_t>> contributions) {
    std::vector<std::int64_t> next(sums.size() + 1, 0);
    for (const auto& [sum, place] : contributions) ++next[sum + 1];
    std::partial_sum(next.begin(), next.end(), next.begin());
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k].begin = next[k];
    places.resize(contributions.size());
    for (const auto& [sum, place] : contributions) places[next[sum]++] = place;
  }

  /// Adds what later runs contributed, and sets to zero what nobody contributes to.
  void add_up(const LinearizeSink& sink) const {
    for_each_range(sums.size(), kColumnChunk, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) {
        const auto last = k + 1 < sums.size() ? sums[k + 1].begin : std::ssize(places);
        gather_any(std::span(places).subspan(sums[k].begin, last - sums[k].begin), scratch.data(),
                   sums[k].size, sink.arrays[static_cast<int>(sums[k].array)] + sums[k].offset);
      }
    });
    for (const std::int32_t j : untouched) {
      for (const Sum& sum : {block_sum(structure.column_begin()[j]), gradient_sum(j)})
        std::fill_n(sink.arrays[static_cast<int>(sum.array)] + sum.offset, sum.size, 0.0);
    }
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

  /// Adds what the factors of a chunk contribute, and sets its part of chi2.
  void linearize_chunk(std::size_t c, LinearizeSink sink) {
    const Chunk& chunk = chunks[c];
    const FactorType& type = *graph->factor_pools()[chunk.pool].type;
    const FactorView& view = views[chunk.pool];
    sink.blocks = targets[chunk.pool].blocks.data();
    sink.gradients = targets[chunk.pool].gradients.data();
    double norms[kFactorChunk], weights[kFactorChunk];
    const std::size_t count = chunk.end - chunk.begin;
    if (has_loss(chunk)) {
      call_factor(type, [&] { type.squared_norms(view, chunk.begin, chunk.end, norms); });
      partial[c] = apply_loss(chunk, {norms, count}, {weights, count});
      call_factor(type,
                  [&] { type.linearize(view, chunk.begin, chunk.end, weights, sink, nullptr); });
    } else {
      call_factor(type,
                  [&] { type.linearize(view, chunk.begin, chunk.end, nullptr, sink, norms); });
      partial[c] = std::accumulate(norms, norms + count, 0.0);
    }
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
  if (plan.runs != plan.wanted_runs()) plan.assign_targets();
  const LinearizeSink all{.arrays = {H.values().data(), g.data(), plan.scratch.data()}};
  for_each_chunk(plan.runs, [&](std::size_t run) {
    for (std::size_t c = plan.run_begin(run); c < plan.run_begin(run + 1); ++c)
      plan.linearize_chunk(c, all);
  });
  plan.add_up(all);
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
