// SPDX-License-Identifier: BSD-3-Clause
#include "bulk.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <fmt/core.h>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/symbol.hpp"
#include "missing.hpp"

namespace cairn::python {
namespace {

/// Takes out what was added since, unless all went well.
class Rollback {
 public:
  explicit Rollback(Graph& graph)
      : graph_(&graph), variables_(graph.variable_count()), factors_(graph.factor_count()) {}
  Rollback(const Rollback&) = delete;
  Rollback& operator=(const Rollback&) = delete;
  ~Rollback() {
    if (!graph_) return;
    std::vector<bool> factors(graph_->factor_count()), variables(graph_->variable_count());
    for (std::size_t k = factors_; k < factors.size(); ++k) factors[k] = true;
    for (std::size_t k = variables_; k < variables.size(); ++k) variables[k] = true;
    graph_->remove(factors, variables);
  }
  void keep() { graph_ = nullptr; }

 private:
  Graph* graph_;
  std::size_t variables_, factors_;
};

std::size_t size_of(int n) { return static_cast<std::size_t>(n); }

/// Indices of variables by id: for many queries from a table, where the ids are not far apart,
/// which takes a third of the time of `Graph::find`.
class IndexTable {
 public:
  IndexTable(const Graph& graph, std::size_t queries) : graph_(&graph) {
    const int count = graph.variable_count();
    if (queries < size_of(count) || count == 0) return;
    Id last = first_ = graph.id(0);
    for (int v = 1; v < count; ++v) {
      first_ = std::min(first_, graph.id(v));
      last = std::max(last, graph.id(v));
    }
    const std::uint64_t range =
        static_cast<std::uint64_t>(last) - static_cast<std::uint64_t>(first_);
    if (range >= 4 * size_of(count)) return;
    table_.assign(range + 1, -1);
    for (int v = 0; v < count; ++v) table_[static_cast<std::size_t>(graph.id(v) - first_)] = v;
  }

  /// Of the variable with that id, which `factor` has among its ids. Throws `Error` (usage).
  int at(Id id, std::size_t factor) const {
    const int index = table_.empty() ? graph_->find(id).value_or(-1) : looked_up(id);
    if (index < 0) {
      throw MissingKey(
          fmt::format("ids[{}]: there is no variable {} in the graph", factor, id_text(id)));
    }
    return index;
  }

 private:
  int looked_up(Id id) const {
    const std::uint64_t place = static_cast<std::uint64_t>(id) - static_cast<std::uint64_t>(first_);
    return place < table_.size() ? table_[place] : -1;
  }

  const Graph* graph_;
  Id first_ = 0;
  std::vector<int> table_;  // by id from first_; empty: not worth it
};

}  // namespace

void add_variables(Graph& graph, const std::shared_ptr<const VariableType>& type,
                   std::span<const Id> ids, std::span<const double> states) {
  graph.reserve(size_of(graph.variable_count()) + ids.size(), size_of(graph.factor_count()));
  const std::size_t size = size_of(type->ambient_size());
  Rollback rollback(graph);
  for (std::size_t k = 0; k < ids.size(); ++k)
    graph.add_variable(type, ids[k], states.subspan(k * size, size));
  rollback.keep();
}

void add_factors(Graph& graph, const std::shared_ptr<const FactorType>& type,
                 std::span<const Id> ids, std::span<const double> measurements,
                 std::span<const double> information, const std::shared_ptr<const Loss>& loss) {
  const std::size_t arity = size_of(type->arity()), size = size_of(type->measurement_size()),
                    packed = packed_size(type->residual_size()), count = ids.size() / arity;
  graph.reserve(size_of(graph.variable_count()), size_of(graph.factor_count()) + count);
  const bool one_for_all = information.size() == packed;
  const IndexTable indices(graph, ids.size());
  std::vector<int> variables(arity);
  Rollback rollback(graph);
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t i = 0; i < arity; ++i) variables[i] = indices.at(ids[k * arity + i], k);
    graph.add_factor(type, variables, measurements.subspan(k * size, size),
                     one_for_all ? information : information.subspan(k * packed, packed), loss);
  }
  rollback.keep();
}

}  // namespace cairn::python
