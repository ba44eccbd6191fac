// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/graph.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "graph/factor_call.hpp"

namespace cairn {
namespace {

Error bad_input(const std::string& message) { return {ErrorCode::input, message}; }

bool all_finite(std::span<const double> values) {
  return std::ranges::all_of(values, [](double v) { return std::isfinite(v); });
}

/// U, packed row by row, with UᵀU = Ω. False if Ω is not positive definite.
bool square_root(std::span<const double> information, int n, double* packed) {
  using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 16, 16>;
  const auto factor = [&](auto omega) {
    std::size_t k = 0;
    for (int row = 0; row < n; ++row) {
      for (int column = row; column < n; ++column) omega(column, row) = information[k++];
    }
    const Eigen::LLT<decltype(omega), Eigen::Lower> llt(omega);
    if (llt.info() != Eigen::Success) return false;
    k = 0;
    for (int row = 0; row < n; ++row) {
      for (int column = row; column < n; ++column) packed[k++] = llt.matrixLLT()(column, row);
    }
    return std::isfinite(packed[k - 1]);
  };
  if (n == 3) return factor(Eigen::Matrix3d::Zero().eval());
  if (n == 6) return factor(Eigen::Matrix<double, 6, 6>::Zero().eval());
  if (n <= 16) return factor(Small(n, n));
  return factor(Eigen::MatrixXd(n, n));
}

}  // namespace

Graph::Graph() = default;
Graph::Graph(Graph&&) noexcept = default;
Graph& Graph::operator=(Graph&&) noexcept = default;
Graph::~Graph() = default;

Graph Graph::clone() const {
  Graph copy;
  copy.records_ = records_;
  copy.variable_pools_ = variable_pools_;
  copy.values_ = values_;
  copy.factors_ = factors_;
  copy.factor_pools_ = factor_pools_;
  copy.index_of_id_ = index_of_id_;
  copy.loss_ = loss_;
  copy.loss_scope_ = loss_scope_;
  copy.structure_version_ = structure_version_;
  return copy;
}

void Graph::reserve(std::size_t variables, std::size_t factors) {
  records_.reserve(variables);
  index_of_id_.reserve(variables);
  factors_.reserve(factors);
}

int Graph::variable_pool_of(const std::shared_ptr<const VariableType>& type) {
  for (std::size_t p = 0; p < variable_pools_.size(); ++p) {
    if (variable_pools_[p].type == type) return static_cast<int>(p);
    if (variable_pools_[p].type->tag() == type->tag()) {
      throw bad_input(
          fmt::format("two different variable types are called {}: a graph takes all of its types "
                      "from one registry",
                      type->tag()));
    }
  }
  variable_pools_.push_back({type, {}});
  values_.pools.emplace_back();
  return static_cast<int>(variable_pools_.size()) - 1;
}

int Graph::factor_pool_of(const std::shared_ptr<const FactorType>& type) {
  for (std::size_t p = 0; p < factor_pools_.size(); ++p) {
    if (factor_pools_[p].type == type) return static_cast<int>(p);
  }
  FactorPool pool;
  pool.type = type;
  factor_pools_.push_back(std::move(pool));
  return static_cast<int>(factor_pools_.size()) - 1;
}

int Graph::add_variable(std::shared_ptr<const VariableType> type, Id id,
                        std::span<const double> x) {
  const std::string_view tag = type->tag();
  const std::size_t size = static_cast<std::size_t>(type->ambient_size());
  if (x.size() != size) {
    throw bad_input(fmt::format("{} {} has {} numbers, expected {}", tag, id, x.size(), size));
  }
  if (!all_finite(x))
    throw bad_input(fmt::format("{} {} has a number that is not finite", tag, id));
  if (const auto there = find(id)) {
    throw bad_input(
        fmt::format("{} {}: the id is already that of {}", tag, id, describe_variable(*there)));
  }
  const int pool = variable_pool_of(type);
  AlignedVector& states = values_.pools[pool];
  const std::size_t begin = states.size();
  states.insert(states.end(), x.begin(), x.end());
  if (const std::string problem = type->normalize(states.data() + begin); !problem.empty()) {
    states.resize(begin);
    throw bad_input(fmt::format("{} {}: {}", tag, id, problem));
  }
  const int index = variable_count();
  const std::int32_t slot = static_cast<std::int32_t>(variable_pools_[pool].variables.size());
  variable_pools_[pool].variables.push_back(index);
  records_.push_back({id, pool, slot, false});
  index_of_id_.emplace(id, index);
  ++structure_version_;
  return index;
}

int Graph::add_factor(std::shared_ptr<const FactorType> type, std::span<const int> variables,
                      std::span<const double> measurement, std::span<const double> information) {
  const std::string_view tag = type->tag();
  const int arity = type->arity(), n = type->residual_size();
  if (variables.size() != static_cast<std::size_t>(arity)) {
    throw bad_input(fmt::format("{} joins {} variables, not {}", tag, arity, variables.size()));
  }
  const auto name = [&] {
    std::string text(tag);
    for (const int v : variables) {
      text += v >= 0 && v < variable_count() ? fmt::format(" {}", id(v))
                                             : fmt::format(" (index {})", v);
    }
    return text;
  };
  for (int k = 0; k < arity; ++k) {
    const int v = variables[k];
    if (v < 0 || v >= variable_count())
      throw bad_input(fmt::format("{}: there is no such variable", name()));
    if (this->type(v).tag() != type->variable_tags()[k]) {
      throw bad_input(fmt::format("{}: variable {} is a {}, expected a {}", name(), id(v),
                                  this->type(v).tag(), type->variable_tags()[k]));
    }
    if (this->type(v).ambient_size() != type->ambient_size(k) ||
        this->type(v).tangent_size() != type->tangent_size(k)) {
      throw Error(ErrorCode::plugin,
                  fmt::format("{}: the factor type and the variable type {} disagree about the "
                              "variable's sizes",
                              name(), this->type(v).tag()));
    }
    for (int other = 0; other < k; ++other) {
      if (variables[other] == v)
        throw bad_input(fmt::format("{}: joins variable {} with itself", name(), id(v)));
    }
  }
  const std::size_t measurement_size = static_cast<std::size_t>(type->measurement_size());
  const std::size_t information_size = static_cast<std::size_t>(n * (n + 1) / 2);
  if (measurement.size() != measurement_size || information.size() != information_size) {
    throw bad_input(fmt::format(
        "{}: {} + {} numbers, expected a measurement of {} and an information matrix of {}", name(),
        measurement.size(), information.size(), measurement_size, information_size));
  }
  if (!all_finite(measurement) || !all_finite(information)) {
    throw bad_input(fmt::format("{}: has a number that is not finite", name()));
  }

  const int p = factor_pool_of(type);
  FactorPool& pool = factor_pools_[p];
  if (pool.variable_pools.empty()) {
    for (const int v : variables) pool.variable_pools.push_back(records_[v].pool);
  }
  const std::size_t m = pool.measurements.size(), u = pool.sqrt_information.size();
  pool.measurements.insert(pool.measurements.end(), measurement.begin(), measurement.end());
  pool.sqrt_information.resize(u + information_size);
  std::string problem = type->normalize(pool.measurements.data() + m);
  if (problem.empty() && !square_root(information, n, pool.sqrt_information.data() + u)) {
    problem = "the information matrix is not positive definite";
  }
  if (!problem.empty()) {
    pool.measurements.resize(m);
    pool.sqrt_information.resize(u);
    throw bad_input(fmt::format("{}: {}", name(), problem));
  }
  pool.information.insert(pool.information.end(), information.begin(), information.end());
  for (const int v : variables) {
    pool.variables.push_back(v);
    pool.slots.push_back(records_[v].slot);
  }
  const int position = factor_count();
  factors_.push_back({p, static_cast<std::int32_t>(pool.size())});
  pool.sequence.push_back(position);
  ++structure_version_;
  return position;
}

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

void Graph::remove_factors(const std::vector<bool>& leaves,
                           const std::vector<std::int32_t>& position) {
  std::vector<FactorPool> pools;
  std::vector<FactorRef> factors(static_cast<std::size_t>(std::ranges::count(leaves, false)));
  for (FactorPool& pool : factor_pools_) {
    const std::size_t arity = static_cast<std::size_t>(pool.type->arity()),
                      measurement = static_cast<std::size_t>(pool.type->measurement_size()),
                      n = static_cast<std::size_t>(pool.type->residual_size()),
                      packed = n * (n + 1) / 2;
    std::size_t kept = 0;
    for (std::size_t f = 0; f < pool.size(); ++f) {
      const std::int32_t now = position[pool.sequence[f]];
      if (now < 0) continue;
      move_group(pool.slots, f, kept, arity);
      move_group(pool.variables, f, kept, arity);
      move_group(pool.measurements, f, kept, measurement);
      move_group(pool.information, f, kept, packed);
      move_group(pool.sqrt_information, f, kept, packed);
      pool.sequence[kept] = now;
      factors[now] = {static_cast<std::int32_t>(pools.size()), static_cast<std::int32_t>(kept++)};
    }
    if (kept == 0) continue;
    pool.slots.resize(kept * arity);
    pool.variables.resize(kept * arity);
    pool.measurements.resize(kept * measurement);
    pool.information.resize(kept * packed);
    pool.sqrt_information.resize(kept * packed);
    pool.sequence.resize(kept);
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

std::optional<int> Graph::find(Id id) const {
  const auto it = index_of_id_.find(id);
  return it == index_of_id_.end() ? std::nullopt : std::optional<int>(it->second);
}

void Graph::set_fixed(int variable, bool fixed) {
  records_[variable].fixed = fixed;
  ++structure_version_;
}

std::span<const double> Graph::state(int variable) const {
  const std::size_t size = static_cast<std::size_t>(type(variable).ambient_size());
  return {values_.pools[pool(variable)].data() + slot(variable) * size, size};
}

void Graph::set_state(int variable, std::span<const double> x) {
  const VariableType& t = type(variable);
  const std::size_t size = static_cast<std::size_t>(t.ambient_size());
  if (x.size() != size || !all_finite(x)) {
    throw bad_input(
        fmt::format("{}: a state is {} finite numbers", describe_variable(variable), size));
  }
  std::vector<double> state(x.begin(), x.end());
  if (const std::string problem = t.normalize(state.data()); !problem.empty()) {
    throw bad_input(fmt::format("{}: {}", describe_variable(variable), problem));
  }
  std::ranges::copy(state, values_.pools[pool(variable)].begin() +
                               slot(variable) * static_cast<std::ptrdiff_t>(size));
}

std::string Graph::describe_variable(int variable) const {
  return fmt::format("{} {}", type(variable).tag(), id(variable));
}

std::span<const std::int32_t> Graph::factor_variables(int position) const {
  const FactorPool& pool = factor_pools_[factors_[position].pool];
  const std::size_t arity = static_cast<std::size_t>(pool.type->arity());
  return {pool.variables.data() + factors_[position].entry * arity, arity};
}

std::span<const double> Graph::measurement(int position) const {
  const FactorPool& pool = factor_pools_[factors_[position].pool];
  const std::size_t size = static_cast<std::size_t>(pool.type->measurement_size());
  return {pool.measurements.data() + factors_[position].entry * size, size};
}

std::span<const double> Graph::information(int position) const {
  const FactorPool& pool = factor_pools_[factors_[position].pool];
  const std::size_t n = static_cast<std::size_t>(pool.type->residual_size()),
                    size = n * (n + 1) / 2;
  return {pool.information.data() + factors_[position].entry * size, size};
}

void Graph::set_measurement(int position, std::span<const double> measurement,
                            std::span<const double> information) {
  FactorPool& pool = factor_pools_[factors_[position].pool];
  const std::size_t n = static_cast<std::size_t>(pool.type->residual_size()),
                    packed = n * (n + 1) / 2;
  const std::size_t size = static_cast<std::size_t>(pool.type->measurement_size());
  const std::size_t entry = static_cast<std::size_t>(factors_[position].entry);
  if (measurement.size() != size || (!information.empty() && information.size() != packed) ||
      !all_finite(measurement) || !all_finite(information)) {
    throw bad_input(fmt::format("{}: a measurement is {} finite numbers and its information {}",
                                describe_factor(position), size, packed));
  }
  std::vector<double> z(measurement.begin(), measurement.end()), root(packed);
  std::string problem = pool.type->normalize(z.data());
  if (problem.empty() && !information.empty() &&
      !square_root(information, static_cast<int>(n), root.data())) {
    problem = "the information matrix is not positive definite";
  }
  if (!problem.empty()) throw bad_input(fmt::format("{}: {}", describe_factor(position), problem));
  std::ranges::copy(z, pool.measurements.begin() + static_cast<std::ptrdiff_t>(entry * size));
  if (!information.empty()) {
    std::ranges::copy(information,
                      pool.information.begin() + static_cast<std::ptrdiff_t>(entry * packed));
    std::ranges::copy(root,
                      pool.sqrt_information.begin() + static_cast<std::ptrdiff_t>(entry * packed));
  }
}

std::string Graph::describe_factor(int position) const {
  std::string text(factor_pools_[factors_[position].pool].type->tag());
  for (const std::int32_t v : factor_variables(position)) text += fmt::format(" {}", id(v));
  return text;
}

void Graph::set_values(Values values) {
  bool fits = values.pools.size() == values_.pools.size();
  for (std::size_t p = 0; fits && p < values.pools.size(); ++p) {
    fits = values.pools[p].size() == values_.pools[p].size();
  }
  if (!fits)
    throw Error(ErrorCode::usage, "these states belong to another graph: their sizes differ");
  values_ = std::move(values);
}

FactorView Graph::view(int factor_pool, const Values& values,
                       std::vector<const double*>& states) const {
  const FactorPool& pool = factor_pools_[factor_pool];
  states.clear();
  for (const std::int32_t p : pool.variable_pools) states.push_back(values.pools[p].data());
  return {.size = pool.size(),
          .slots = pool.slots.data(),
          .measurements = pool.measurements.data(),
          .sqrt_information = pool.sqrt_information.data(),
          .states = states.data()};
}

std::int64_t Graph::tangent_size() const {
  std::int64_t total = 0;
  for (const VariablePool& pool : variable_pools_) {
    total += static_cast<std::int64_t>(pool.variables.size()) * pool.type->tangent_size();
  }
  return total;
}

std::int64_t Graph::residual_size() const {
  std::int64_t total = 0;
  for (const FactorPool& pool : factor_pools_) {
    total += static_cast<std::int64_t>(pool.size()) * pool.type->residual_size();
  }
  return total;
}

void Graph::set_loss(std::shared_ptr<const Loss> loss, LossScope scope) {
  loss_ = std::move(loss);
  loss_scope_ = scope;
}

namespace {

/// For each variable its place among the variables of its type, by rising id.
std::vector<std::int32_t> rank_within_type(const Graph& graph) {
  std::vector<std::int32_t> rank(graph.variable_count());
  for (const VariablePool& pool : graph.variable_pools()) {
    std::vector<std::int32_t> order = pool.variables;
    const auto by_id = [&](std::int32_t a, std::int32_t b) { return graph.id(a) < graph.id(b); };
    if (!std::ranges::is_sorted(order, by_id)) std::ranges::sort(order, by_id);
    for (std::size_t k = 0; k < order.size(); ++k) rank[order[k]] = static_cast<std::int32_t>(k);
  }
  return rank;
}

}  // namespace

std::vector<bool> loop_closures(const Graph& graph) {
  const std::vector<std::int32_t> rank = rank_within_type(graph);
  std::vector<bool> result(graph.factor_count());
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto v = graph.factor_variables(f);
    result[f] = v.size() == 2 && graph.pool(v[0]) == graph.pool(v[1]) &&
                std::abs(rank[v[0]] - rank[v[1]]) != 1;
  }
  return result;
}

std::vector<bool> under_loss(const Graph& graph) {
  if (!graph.loss()) return std::vector<bool>(static_cast<std::size_t>(graph.factor_count()));
  std::vector<bool> result =
      graph.loss_scope() == LossScope::all
          ? std::vector<bool>(static_cast<std::size_t>(graph.factor_count()), true)
          : loop_closures(graph);
  for (const FactorPool& pool : graph.factor_pools()) {
    if (pool.type->takes_loss()) continue;
    for (const std::int32_t position : pool.sequence) result[position] = false;
  }
  return result;
}

std::vector<double> squared_norms(const Graph& graph) {
  std::vector<double> result(graph.factor_count());
  std::vector<const double*> states;
  std::vector<double> norms;
  for (std::size_t p = 0; p < graph.factor_pools().size(); ++p) {
    const FactorPool& pool = graph.factor_pools()[p];
    const FactorView view = graph.view(static_cast<int>(p), graph.values(), states);
    norms.resize(pool.size());
    for_each_range(pool.size(), 512, [&](std::size_t begin, std::size_t end) {
      call_factor(*pool.type,
                  [&] { pool.type->squared_norms(view, begin, end, norms.data() + begin); });
    });
    for (std::size_t k = 0; k < pool.size(); ++k) result[pool.sequence[k]] = norms[k];
  }
  return result;
}

}  // namespace cairn
