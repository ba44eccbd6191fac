// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/linear/jacobian.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/types/factor_call.hpp"
#include "cairn/types/loss.hpp"

namespace cairn {
namespace {

/// Factors evaluated by one task; no sum depends on it.
constexpr std::size_t kFactorChunk = 256;

std::vector<std::int64_t> offsets_of(std::span<const std::int32_t> sizes) {
  std::vector<std::int64_t> offsets(sizes.size() + 1, 0);
  for (std::size_t k = 0; k < sizes.size(); ++k) offsets[k + 1] = offsets[k] + sizes[k];
  return offsets;
}

}  // namespace

JacobianStructure::JacobianStructure(std::vector<std::int32_t> row_sizes,
                                     std::vector<std::int32_t> column_sizes,
                                     std::vector<std::int64_t> row_begin,
                                     std::vector<std::int32_t> columns)
    : row_sizes_(std::move(row_sizes)),
      column_sizes_(std::move(column_sizes)),
      row_offsets_(offsets_of(row_sizes_)),
      column_offsets_(offsets_of(column_sizes_)),
      row_begin_(std::move(row_begin)),
      columns_(std::move(columns)) {
  if (row_begin_.size() != row_sizes_.size() + 1 || row_begin_.front() != 0 ||
      row_begin_.back() != entries()) {
    throw std::logic_error("JacobianStructure: row_begin does not fit the rows and the entries");
  }
  static std::atomic<std::uint64_t> counter{0};  // only a source of distinct numbers
  version_ = ++counter;
  value_begin_.reserve(columns_.size() + 1);
  std::int64_t total = 0;
  for (int row = 0; row < block_rows(); ++row) {
    for (std::int64_t e = row_begin_[row]; e < row_begin_[row + 1]; ++e) {
      value_begin_.push_back(total);
      total += static_cast<std::int64_t>(row_sizes_[row]) * column_sizes_[columns_[e]];
    }
  }
  value_begin_.push_back(total);
}

JacobianMatrix::JacobianMatrix(const JacobianStructure& structure)
    : structure_(&structure),
      values_(static_cast<std::size_t>(structure.values()), 0.0),
      residual_(static_cast<std::size_t>(structure.rows()), 0.0) {}

namespace {

/// Calls visit(entry, block row, block column) row by row.
template <class Visit>
void for_each_entry(const JacobianStructure& s, Visit visit) {
  for (int row = 0; row < s.block_rows(); ++row) {
    for (std::int64_t e = s.row_begin()[row]; e < s.row_begin()[row + 1]; ++e)
      visit(e, row, s.columns()[e]);
  }
}

}  // namespace

void JacobianMatrix::multiply(std::span<const double> x, std::span<double> y) const {
  const JacobianStructure& s = *structure_;
  std::fill(y.begin(), y.end(), 0.0);
  for_each_entry(s, [&](std::int64_t e, int row, int column) {
    const double* value = block(e);
    for (std::int64_t c = s.column_offsets()[column]; c < s.column_offsets()[column + 1]; ++c) {
      for (std::int64_t r = s.row_offsets()[row]; r < s.row_offsets()[row + 1]; ++r)
        y[r] += *value++ * x[c];
    }
  });
}

void JacobianMatrix::multiply_transposed(std::span<const double> y, std::span<double> x) const {
  const JacobianStructure& s = *structure_;
  std::fill(x.begin(), x.end(), 0.0);
  for_each_entry(s, [&](std::int64_t e, int row, int column) {
    const double* value = block(e);
    for (std::int64_t c = s.column_offsets()[column]; c < s.column_offsets()[column + 1]; ++c) {
      for (std::int64_t r = s.row_offsets()[row]; r < s.row_offsets()[row + 1]; ++r)
        x[c] += *value++ * y[r];
    }
  });
}

struct JacobianEvaluator::Plan {
  const Graph* graph;
  std::uint64_t graph_version;
  JacobianStructure structure;
  /// By factor pool: entry × arity, where that variable's block starts in the values, -1 if held.
  std::vector<std::vector<std::int64_t>> targets;
  /// By factor pool: the factors that the loss leaves alone.

  Plan(const Graph& g, const Linearizer& linearizer)
      : graph(&g), graph_version(g.structure_version()) {
    std::vector<std::int32_t> row_sizes, columns;
    std::vector<std::int64_t> row_begin{0};
    for (int position = 0; position < g.factor_count(); ++position) {
      row_sizes.push_back(g.factor_type(position).residual_size());
      for (const std::int32_t v : g.factor_variables(position)) {
        if (const int block = linearizer.block_of(v); block >= 0) columns.push_back(block);
      }
      row_begin.push_back(static_cast<std::int64_t>(columns.size()));
    }
    const std::span<const std::int32_t> column_sizes = linearizer.structure().sizes();
    structure = JacobianStructure(std::move(row_sizes), {column_sizes.begin(), column_sizes.end()},
                                  std::move(row_begin), std::move(columns));
    assign_targets(linearizer);
  }

  void assign_targets(const Linearizer& linearizer) {
    for (const FactorPool& pool : graph->factor_pools())
      targets.emplace_back(pool.size() * static_cast<std::size_t>(pool.type->arity()), -1);
    std::int64_t entry = 0;
    for (int position = 0; position < graph->factor_count(); ++position) {
      const FactorRef ref = graph->ref(position);
      const std::span<const std::int32_t> variables = graph->factor_variables(position);
      for (std::size_t a = 0; a < variables.size(); ++a) {
        if (linearizer.block_of(variables[a]) < 0) continue;
        targets[ref.pool][ref.entry * variables.size() + a] = structure.value_begin()[entry++];
      }
    }
  }

  /// Evaluates one factor of a pool into its rows.
  void evaluate(std::size_t p, std::size_t f, const FactorView& view, JacobianMatrix& J) const {
    const FactorPool& pool = graph->factor_pools()[p];
    const FactorType& type = *pool.type;
    const auto arity = static_cast<std::size_t>(type.arity());
    thread_local std::vector<const double*> states;
    thread_local std::vector<double*> jacobians;
    states.resize(arity);
    jacobians.resize(arity);
    for (std::size_t a = 0; a < arity; ++a) {
      const auto ambient = static_cast<std::size_t>(type.ambient_size(static_cast<int>(a)));
      states[a] = view.states[a] + static_cast<std::size_t>(view.slots[f * arity + a]) * ambient;
      const std::int64_t target = targets[p][f * arity + a];
      jacobians[a] = target < 0 ? nullptr : J.values().data() + target;
    }
    call_factor(type, [&] {
      type.evaluate(
          states.data(), view.measurements + f * static_cast<std::size_t>(type.measurement_size()),
          view.sqrt_information + view.noise(f) * packed_size(type.residual_size()),
          J.residual().data() + structure.row_offsets()[pool.sequence[f]], jacobians.data());
    });
  }

  /// Scales the rows of factors [begin, end) of a pool by the square root of their weight.
  void weigh(std::size_t p, std::size_t begin, std::size_t end, JacobianMatrix& J) const {
    const FactorPool& pool = graph->factor_pools()[p];
    double norms[kFactorChunk], weights[kFactorChunk];
    for (std::size_t f = begin; f < end; ++f) {
      const std::int32_t row = pool.sequence[f];
      const std::span<const double> r = J.residual().subspan(
          static_cast<std::size_t>(structure.row_offsets()[row]), structure.row_sizes()[row]);
      norms[f - begin] = std::inner_product(r.begin(), r.end(), r.begin(), 0.0);
    }
    const std::size_t count = end - begin;
    graph->weigh(static_cast<int>(p), begin, {norms, count}, {}, {weights, count});
    for (std::size_t f = begin; f < end; ++f) {
      if (weights[f - begin] == 1.0) continue;
      const std::int32_t row = pool.sequence[f];
      const double scale = std::sqrt(weights[f - begin]);
      const auto scale_all = [scale](double* first, const double* last) {
        for (; first != last; ++first) *first *= scale;
      };
      scale_all(J.values().data() + structure.value_begin()[structure.row_begin()[row]],
                J.values().data() + structure.value_begin()[structure.row_begin()[row + 1]]);
      scale_all(J.residual().data() + structure.row_offsets()[row],
                J.residual().data() + structure.row_offsets()[row + 1]);
    }
  }
};

JacobianEvaluator::JacobianEvaluator(const Graph& graph, const Linearizer& linearizer)
    : plan_(std::make_unique<Plan>(graph, linearizer)) {}
JacobianEvaluator::JacobianEvaluator(JacobianEvaluator&&) noexcept = default;
JacobianEvaluator::~JacobianEvaluator() = default;

const JacobianStructure& JacobianEvaluator::structure() const { return plan_->structure; }

void JacobianEvaluator::evaluate(const Values& values, JacobianMatrix& J) const {
  const Plan& plan = *plan_;
  if (plan.graph->structure_version() != plan.graph_version) {
    throw std::logic_error("the graph has changed since this evaluator was made: make a new one");
  }
  if (&J.structure() != &plan.structure)
    throw std::logic_error("JacobianEvaluator::evaluate: J was not made for this structure");
  for (std::size_t p = 0; p < plan.targets.size(); ++p) {
    std::vector<const double*> states;
    const FactorView view = plan.graph->view(static_cast<int>(p), values, states);
    for_each_range(plan.graph->factor_pools()[p].size(), kFactorChunk,
                   [&](std::size_t begin, std::size_t end) {
                     for (std::size_t f = begin; f < end; ++f) plan.evaluate(p, f, view, J);
                     if (plan.graph->any_loss(static_cast<int>(p), begin, end))
                       plan.weigh(p, begin, end, J);
                   });
  }
}

JacobianSolver::~JacobianSolver() = default;

}  // namespace cairn
