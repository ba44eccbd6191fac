// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/graph.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <fmt/format.h>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "graph/factor_call.hpp"

namespace cairn {
namespace {

Error bad_input(const std::string& message) { return {ErrorCode::input, message}; }

bool all_finite(std::span<const double> values) {
  return std::ranges::all_of(values, [](double v) { return std::isfinite(v); });
}

/// U with UᵀU = Ω, packed row by row, and the rank of Ω; rank 0 if Ω is indefinite or zero.
struct Root {
  std::vector<double> packed;
  int rank = 0;
};

Root root_of(std::span<const double> information, int n) {
  Root root{std::vector<double>(information.size()), 0};
  if (!square_root(information, n, root.packed)) return root;
  for (std::size_t k = 0; n > 0; k += static_cast<std::size_t>(n--))
    root.rank += root.packed[k] > 0.0;
  return root;
}

std::size_t size_of(int n) { return static_cast<std::size_t>(n); }

/// What is wrong with an information matrix, or nothing.
std::string problem_of(const Root& root, std::span<const double> information) {
  if (root.rank > 0) return {};
  return std::ranges::all_of(information, [](double x) { return x == 0.0; })
             ? "the information matrix is zero: the factor would measure nothing"
             : "the information matrix is not positive semidefinite";
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
  copy.losses_ = losses_;
  copy.structure_version_ = structure_version_;
  return copy;
}

void Graph::reserve(std::size_t variables, std::size_t factors) {
  records_.reserve(variables);
  index_of_id_.reserve(variables);
  factors_.reserve(factors);
}

/// The pool of a type; one past the last if there is none yet.
int Graph::find_pool(const std::shared_ptr<const VariableType>& type) const {
  for (std::size_t p = 0; p < variable_pools_.size(); ++p) {
    if (variable_pools_[p].type == type) return static_cast<int>(p);
    if (variable_pools_[p].type->tag() == type->tag()) {
      throw bad_input(
          fmt::format("two different variable types are called {}: a graph takes all of its types "
                      "from one registry",
                      type->tag()));
    }
  }
  return static_cast<int>(variable_pools_.size());
}

int Graph::find_pool(const std::shared_ptr<const FactorType>& type) const {
  const auto at =
      std::ranges::find(factor_pools_, type, [](const FactorPool& pool) { return pool.type; });
  return static_cast<int>(at - factor_pools_.begin());
}

int Graph::add(const Variable& variable) {
  const int index = add_variable(variable.type, variable.id, variable.state);
  if (variable.fixed) set_fixed(index);
  return index;
}

int Graph::add_variable(std::shared_ptr<const VariableType> type, Id id,
                        std::span<const double> x) {
  if (!type) throw bad_input(fmt::format("variable {} has no type", id));
  const std::string_view tag = type->tag();
  const std::size_t size = size_of(type->ambient_size());
  if (x.size() != size) {
    throw bad_input(fmt::format("{} {} has {} numbers, expected {}", tag, id, x.size(), size));
  }
  if (!all_finite(x))
    throw bad_input(fmt::format("{} {} has a number that is not finite", tag, id));
  if (const auto there = find(id)) {
    throw bad_input(
        fmt::format("{} {}: the id is already that of {}", tag, id, describe_variable(*there)));
  }
  std::vector<double> state(x.begin(), x.end());
  if (const std::string problem = type->normalize(state.data()); !problem.empty())
    throw bad_input(fmt::format("{} {}: {}", tag, id, problem));
  const int p = find_pool(type);
  // Nothing is refused from here on.
  if (p == std::ssize(variable_pools_)) {
    variable_pools_.push_back({std::move(type), {}});
    values_.pools.emplace_back();
  }
  values_.pools[p].insert(values_.pools[p].end(), state.begin(), state.end());
  const int index = variable_count();
  std::vector<std::int32_t>& variables = variable_pools_[p].variables;
  records_.push_back({id, p, static_cast<std::int32_t>(variables.size()), false});
  variables.push_back(index);
  index_of_id_.emplace(id, index);
  ++structure_version_;
  return index;
}

int Graph::add(const Factor& factor) {
  if (!factor.type) throw bad_input("a factor has no type");
  std::vector<int> variables;
  for (const Id id : factor.variables) {
    const std::optional<int> v = find(id);
    if (!v) {
      std::string name(factor.type->tag());
      for (const Id each : factor.variables) name += fmt::format(" {}", each);
      throw bad_input(fmt::format("{}: there is no variable {}", name, id));
    }
    variables.push_back(*v);
  }
  return add_factor(factor.type, variables, factor.measurement, factor.information, factor.loss);
}

void Graph::check_ends(const FactorType& type, std::span<const int> variables) const {
  const std::string_view tag = type.tag();
  const int arity = type.arity();
  if (variables.size() != size_of(arity)) {
    throw bad_input(fmt::format("{} joins {} variables, not {}", tag, arity, variables.size()));
  }
  const auto name = [&] { return name_of(type, variables); };
  for (int k = 0; k < arity; ++k) {
    const int v = variables[k];
    if (v < 0 || v >= variable_count())
      throw bad_input(fmt::format("{}: there is no such variable", name()));
    if (this->type(v).tag() != type.variable_tags()[k]) {
      throw bad_input(fmt::format("{}: variable {} is a {}, expected a {}", name(), id(v),
                                  this->type(v).tag(), type.variable_tags()[k]));
    }
    if (this->type(v).ambient_size() != type.ambient_size(k) ||
        this->type(v).tangent_size() != type.tangent_size(k)) {
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
}

std::string Graph::name_of(const FactorType& type, std::span<const int> variables) const {
  std::string text(type.tag());
  for (const int v : variables) {
    text +=
        v >= 0 && v < variable_count() ? fmt::format(" {}", id(v)) : fmt::format(" (index {})", v);
  }
  return text;
}

int Graph::add_factor(std::shared_ptr<const FactorType> type, std::span<const int> variables,
                      std::span<const double> measurement, std::span<const double> information,
                      std::shared_ptr<const Loss> loss) {
  if (!type) throw bad_input("a factor has no type");
  check_ends(*type, variables);
  const int n = type->residual_size();
  const std::size_t measurement_size = size_of(type->measurement_size());
  const std::size_t information_size = packed_size(n);
  if (measurement.size() != measurement_size || information.size() != information_size) {
    throw bad_input(
        fmt::format("{}: {} + {} numbers, expected a measurement of {} and the upper triangle of "
                    "an information matrix, {}",
                    name_of(*type, variables), measurement.size(), information.size(),
                    measurement_size, information_size));
  }
  if (!all_finite(measurement) || !all_finite(information)) {
    throw bad_input(fmt::format("{}: has a number that is not finite", name_of(*type, variables)));
  }
  std::vector<double> z(measurement.begin(), measurement.end());
  std::string problem = type->normalize(z.data());
  const Root root = root_of(information, n);
  if (problem.empty()) problem = problem_of(root, information);
  if (!problem.empty()) throw bad_input(fmt::format("{}: {}", name_of(*type, variables), problem));
  const int p = find_pool(type);
  const std::int16_t of_loss = loss_index(*type, loss);
  // Nothing is refused from here on.
  if (p == std::ssize(factor_pools_)) {
    factor_pools_.emplace_back().type = std::move(type);
    for (const int v : variables) factor_pools_[p].variable_pools.push_back(records_[v].pool);
  }
  FactorPool& pool = factor_pools_[p];
  pool.measurements.insert(pool.measurements.end(), z.begin(), z.end());
  pool.information.insert(pool.information.end(), information.begin(), information.end());
  pool.sqrt_information.insert(pool.sqrt_information.end(), root.packed.begin(), root.packed.end());
  pool.ranks.push_back(static_cast<std::int16_t>(root.rank));
  pool.losses.push_back(of_loss);
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

Renumbering Graph::erase(Id id) {
  const std::optional<int> v = find(id);
  if (!v) throw Error(ErrorCode::usage, fmt::format("there is no variable {} to erase", id));
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
  std::vector<FactorRef> factors(static_cast<std::size_t>(std::ranges::count(leaves, false)));
  for (FactorPool& pool : factor_pools_) {
    const std::size_t arity = static_cast<std::size_t>(pool.type->arity()),
                      measurement = static_cast<std::size_t>(pool.type->measurement_size()),
                      packed = packed_size(pool.type->residual_size());
    std::size_t kept = 0;
    for (std::size_t f = 0; f < pool.size(); ++f) {
      const std::int32_t now = position[pool.sequence[f]];
      if (now < 0) continue;
      move_group(pool.slots, f, kept, arity);
      move_group(pool.variables, f, kept, arity);
      move_group(pool.measurements, f, kept, measurement);
      move_group(pool.information, f, kept, packed);
      move_group(pool.sqrt_information, f, kept, packed);
      pool.ranks[kept] = pool.ranks[f];
      pool.losses[kept] = pool.losses[f];
      pool.sequence[kept] = now;
      factors[now] = {static_cast<std::int32_t>(pools.size()), static_cast<std::int32_t>(kept++)};
    }
    if (kept == 0) continue;
    pool.slots.resize(kept * arity);
    pool.variables.resize(kept * arity);
    pool.measurements.resize(kept * measurement);
    pool.information.resize(kept * packed);
    pool.sqrt_information.resize(kept * packed);
    pool.ranks.resize(kept);
    pool.losses.resize(kept);
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

Variable Graph::variable(int variable) const {
  const std::span<const double> x = state(variable);
  return {type_of(variable), id(variable), {x.begin(), x.end()}, fixed(variable)};
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
  const std::size_t size = packed_size(pool.type->residual_size());
  return {pool.information.data() + factors_[position].entry * size, size};
}

std::span<const double> Graph::sqrt_information(int position) const {
  const FactorPool& pool = factor_pools_[factors_[position].pool];
  const std::size_t size = packed_size(pool.type->residual_size());
  return {pool.sqrt_information.data() + factors_[position].entry * size, size};
}

int Graph::information_rank(int position) const {
  return factor_pools_[factors_[position].pool].ranks[factors_[position].entry];
}

int Graph::absolute_size(int position) const {
  // A marginal prior may count more than it has rows: all that can be known.
  const FactorType& type = factor_type(position);
  const int rank = information_rank(position);
  return rank == type.residual_size() ? type.absolute_size() : std::min(type.absolute_size(), rank);
}

Factor Graph::factor(int position) const {
  Factor factor{type_of_factor(position), {}, {}, {}, losses_[loss_of(position)]};
  for (const std::int32_t v : factor_variables(position)) factor.variables.push_back(id(v));
  const std::span<const double> z = measurement(position), omega = information(position);
  factor.measurement.assign(z.begin(), z.end());
  factor.information.assign(omega.begin(), omega.end());
  return factor;
}

std::vector<int> Graph::factors_of(int variable) const {
  std::vector<int> result;
  for (int f = 0; f < factor_count(); ++f) {
    const auto on = factor_variables(f);
    if (std::ranges::find(on, variable) != on.end()) result.push_back(f);
  }
  return result;
}

void Graph::set_measurement(int position, std::span<const double> measurement,
                            std::span<const double> information) {
  FactorPool& pool = factor_pools_[factors_[position].pool];
  const std::size_t packed = packed_size(pool.type->residual_size());
  const std::size_t size = static_cast<std::size_t>(pool.type->measurement_size());
  const std::size_t entry = static_cast<std::size_t>(factors_[position].entry);
  if (measurement.size() != size || (!information.empty() && information.size() != packed) ||
      !all_finite(measurement) || !all_finite(information)) {
    throw bad_input(fmt::format("{}: a measurement is {} finite numbers and its information {}",
                                describe_factor(position), size, packed));
  }
  std::vector<double> z(measurement.begin(), measurement.end());
  std::string problem = pool.type->normalize(z.data());
  Root root;
  if (!information.empty()) {
    root = root_of(information, pool.type->residual_size());
    if (problem.empty()) problem = problem_of(root, information);
  }
  if (!problem.empty()) throw bad_input(fmt::format("{}: {}", describe_factor(position), problem));
  std::ranges::copy(z, pool.measurements.begin() + static_cast<std::ptrdiff_t>(entry * size));
  if (information.empty()) return;
  const auto begin = static_cast<std::ptrdiff_t>(entry * packed);
  std::ranges::copy(information, pool.information.begin() + begin);
  std::ranges::copy(root.packed, pool.sqrt_information.begin() + begin);
  if (pool.ranks[entry] != root.rank) ++structure_version_;  // the gauge may be another
  pool.ranks[entry] = static_cast<std::int16_t>(root.rank);
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

std::int16_t Graph::loss_index(const FactorType& type, const std::shared_ptr<const Loss>& loss) {
  if (!loss || !type.takes_loss()) return 0;
  const auto at = std::ranges::find(losses_, loss);
  if (at == losses_.end()) {
    if (losses_.size() > static_cast<std::size_t>(std::numeric_limits<std::int16_t>::max()))
      throw Error(ErrorCode::usage, "a graph holds at most 32767 different losses");
    losses_.push_back(loss);
    return static_cast<std::int16_t>(losses_.size() - 1);
  }
  return static_cast<std::int16_t>(at - losses_.begin());
}

std::int16_t Graph::loss_of(int position) const {
  return factor_pools_[factors_[position].pool].losses[factors_[position].entry];
}

void Graph::set_loss(int position, std::shared_ptr<const Loss> loss) {
  const FactorRef at = factors_[position];
  factor_pools_[at.pool].losses[at.entry] = loss_index(factor_type(position), loss);
}

void Graph::set_loss(const std::shared_ptr<const Loss>& loss, const FactorSelector& which) {
  const std::vector<bool> selected = select(*this, which);
  losses_.resize(1);
  for (int f = 0; f < factor_count(); ++f) set_loss(f, selected[f] ? loss : nullptr);
}

const Loss* Graph::loss(int position) const { return losses_[loss_of(position)].get(); }

bool Graph::any_loss(int factor_pool, std::size_t begin, std::size_t end) const {
  if (!has_losses()) return false;
  const std::vector<std::int16_t>& of = factor_pools_[factor_pool].losses;
  return std::any_of(of.begin() + static_cast<std::ptrdiff_t>(begin),
                     of.begin() + static_cast<std::ptrdiff_t>(end),
                     [](std::int16_t k) { return k != 0; });
}

void Graph::weigh(int factor_pool, std::size_t begin, std::span<const double> norms,
                  std::span<double> rho, std::span<double> weights) const {
  const std::int16_t* of = factor_pools_[factor_pool].losses.data() + begin;
  // Neighbours mostly have one loss: a call for each run of them.
  for (std::size_t first = 0, last = 0; first < norms.size(); first = last) {
    while (last < norms.size() && of[last] == of[first]) ++last;
    const std::size_t count = last - first;
    const auto part = [&](std::span<double> all) {
      return all.empty() ? all : all.subspan(first, count);
    };
    if (const Loss* loss = losses_[of[first]].get()) {
      loss->evaluate(norms.subspan(first, count), part(rho), part(weights));
    } else {
      std::ranges::copy(norms.subspan(first, rho.empty() ? 0 : count), part(rho).begin());
      std::ranges::fill(part(weights), 1.0);
    }
  }
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

double chi2(const Graph& graph) {
  const std::vector<double> norms = squared_norms(graph);
  double sum = 0.0;
  for (int f = 0; f < graph.factor_count(); ++f) {
    const FactorRef at = graph.ref(f);
    double rho = 0.0;
    graph.weigh(at.pool, static_cast<std::size_t>(at.entry), {&norms[f], 1}, {&rho, 1}, {});
    sum += rho;
  }
  return sum;
}

std::vector<std::vector<int>> factors_by_variable(const Graph& graph) {
  std::vector<std::vector<int>> result(graph.variable_count());
  for (int f = 0; f < graph.factor_count(); ++f) {
    for (const std::int32_t v : graph.factor_variables(f)) result[v].push_back(f);
  }
  return result;
}

}  // namespace cairn
