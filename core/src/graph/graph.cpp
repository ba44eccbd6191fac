// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/graph.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/core.h>
#include <boost/container/small_vector.hpp>

#include "cairn/graph/id_text.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/types/loss_by_size.hpp"

namespace cairn {
namespace {

using Numbers = boost::container::small_vector<double, 32>;  // of a state or measurement

Error bad_input(const std::string& message) { return {ErrorCode::input, message}; }

bool all_finite(std::span<const double> values) {
  return std::ranges::all_of(values, [](double v) { return std::isfinite(v); });
}

/// What the type says of a state's or a measurement's numbers, which it must leave finite.
template <class Type>
std::string normalize(const Type& type, Numbers& numbers) {
  std::string problem = call_plugin([&] { return fmt::format("{}: its normalize()", type.tag()); },
                                    [&] { return type.normalize(numbers.data()); });
  if (problem.empty() && !all_finite(numbers))
    throw Error(ErrorCode::plugin,
                fmt::format("{}: its normalize() left a number that is not finite", type.tag()));
  return problem;
}

/// U with UᵀU = Ω, packed row by row, and the rank of Ω; rank 0 if Ω is indefinite or zero.
struct Root {
  Numbers packed;
  int rank = 0;
};

Root root_of(std::span<const double> information, int n) {
  Root root{Numbers(information.size()), 0};
  if (!square_root(information, n, root.packed)) return root;
  for (std::size_t k = 0; n > 0; k += static_cast<std::size_t>(n--))
    root.rank += root.packed[k] > 0.0;
  return root;
}

std::size_t size_of(int n) { return static_cast<std::size_t>(n); }

/// Of a type there are so many at least before there is room for all that are expected.
constexpr std::size_t kMany = 1000;

template <class... Arrays>
void reserve_if_possible(std::size_t size, Arrays&... arrays) {
  try {
    (arrays.reserve(size), ...);
  } catch (const std::exception&) {  // so much is refused: they grow as they are filled
  }
}

/// Another information matrix of a pool, which nothing uses yet. Where there is no memory for it
/// the pool stays as it was.
std::int32_t add_noise(FactorPool& pool, std::span<const double> information,
                       std::span<const double> root, int rank) {
  const std::size_t count = pool.ranks.size(), numbers = pool.information.size() + root.size();
  const Numbers row(information.begin(), information.end());  // may be of the pool itself
  pool.information.reserve(numbers);
  pool.sqrt_information.reserve(numbers);
  pool.ranks.reserve(count + 1);
  pool.uses.reserve(count + 1);
  pool.information.append(row);
  pool.sqrt_information.append(root);
  pool.ranks.push_back(static_cast<std::int16_t>(rank));
  pool.uses.push_back(0);
  pool.recent.note(row, static_cast<std::int32_t>(count));
  return static_cast<std::int32_t>(count);
}

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
  constexpr std::size_t kMost = std::numeric_limits<std::int32_t>::max();
  if (std::max(variables, factors) > kMost)
    throw Error(ErrorCode::usage, fmt::format("Graph::reserve: no room for {} variables and {} "
                                              "factors, but for {} of each at most",
                                              variables, factors, kMost));
  reserve_if_possible(variables, records_);
  const auto places = static_cast<std::size_t>(static_cast<double>(index_of_id_.bucket_count()) *
                                               index_of_id_.max_load_factor());
  if (variables > places) reserve_if_possible(std::max(variables, 2 * places), index_of_id_);
  reserve_if_possible(factors, factors_);
  expected_variables_ = variables;
  expected_factors_ = factors;
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
  const auto at = std::ranges::find(factor_pools_, type, &FactorPool::type);
  return static_cast<int>(at - factor_pools_.begin());
}

int Graph::add(const Variable& variable) {
  const int index = add_variable(variable.type, variable.id, variable.state);
  if (variable.fixed) set_fixed(index);
  return index;
}

int Graph::add_variable(std::shared_ptr<const VariableType> type, Id id,
                        std::span<const double> x) {
  if (!type) throw bad_input(fmt::format("variable {} has no type", id_text(id)));
  const auto name = [&] { return fmt::format("{} {}", type->tag(), id_text(id)); };
  const std::size_t size = size_of(type->ambient_size());
  if (x.size() != size)
    throw bad_input(fmt::format("{} has {} numbers, expected {}", name(), x.size(), size));
  if (!all_finite(x)) throw bad_input(name() + " has a number that is not finite");
  if (const auto there = find(id)) {
    throw bad_input(
        fmt::format("{}: the id is already that of {}", name(), describe_variable(*there)));
  }
  Numbers state(x.begin(), x.end());
  if (const std::string problem = normalize(*type, state); !problem.empty())
    throw bad_input(fmt::format("{}: {}", name(), problem));
  const int p = find_pool(type);
  // Nothing is refused from here on.
  if (p == std::ssize(variable_pools_)) {
    variable_pools_.push_back({std::move(type), {}});
    values_.pools.emplace_back();
  }
  values_.pools[p].insert(values_.pools[p].end(), state.begin(), state.end());
  const int index = variable_count();
  GrowingArray<std::int32_t>& variables = variable_pools_[p].variables;
  records_.push_back({id, p, static_cast<std::int32_t>(variables.size()), false});
  variables.push_back(index);
  if (variables.size() == kMany)
    reserve_if_possible(std::max(expected_variables_, kMany) * size, values_.pools[p]);
  index_of_id_.emplace(id, index);
  ++structure_version_;
  return index;
}

int Graph::add(const Factor& factor) {
  if (!factor.type) throw bad_input("a factor has no type");
  boost::container::small_vector<int, 8> variables;
  for (const Id id : factor.variables) {
    const std::optional<int> v = find(id);
    if (!v) {
      std::string name(factor.type->tag());
      for (const Id each : factor.variables) name += " " + id_text(each);
      throw bad_input(fmt::format("{}: there is no variable {}", name, id_text(id)));
    }
    variables.push_back(*v);
  }
  return add_factor(factor.type, variables, factor.measurement, factor.information, factor.loss);
}

void Graph::check_ends(const FactorType& type, std::span<const int> variables) const {
  const int arity = type.arity();
  if (variables.size() != size_of(arity))
    throw bad_input(
        fmt::format("{} joins {} variables, not {}", type.tag(), arity, variables.size()));
  const auto name = [&] { return name_of(type, variables); };
  const auto pool = std::ranges::find_if(
      factor_pools_, [&](const FactorPool& each) { return each.type.get() == &type; });
  for (int k = 0; k < arity; ++k) {
    const int v = variables[k];
    if (v < 0 || v >= variable_count())
      throw bad_input(fmt::format("{}: there is no such variable", name()));
    // The variable's type fits where it is that of the factors of this type before.
    const bool fits = pool != factor_pools_.end() && records_[v].pool == pool->variable_pools[k];
    if (!fits && this->type(v).tag() != type.variable_tags()[k]) {
      throw bad_input(fmt::format("{}: variable {} is a {}, expected a {}", name(), id_text(id(v)),
                                  this->type(v).tag(), type.variable_tags()[k]));
    }
    if (!fits && (this->type(v).ambient_size() != type.ambient_size(k) ||
                  this->type(v).tangent_size() != type.tangent_size(k))) {
      throw Error(ErrorCode::plugin,
                  fmt::format("{}: the factor type and the variable type {} disagree about the "
                              "variable's sizes",
                              name(), this->type(v).tag()));
    }
    for (int other = 0; other < k; ++other) {
      if (variables[other] == v)
        throw bad_input(fmt::format("{}: joins variable {} with itself", name(), id_text(id(v))));
    }
  }
}

std::string Graph::name_of(const FactorType& type, std::span<const int> variables) const {
  std::string text(type.tag());
  for (const int v : variables)
    text += v >= 0 && v < variable_count() ? " " + id_text(id(v)) : fmt::format(" (index {})", v);
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
  if (!all_finite(measurement) || !all_finite(information))
    throw bad_input(fmt::format("{}: has a number that is not finite", name_of(*type, variables)));
  Numbers z(measurement.begin(), measurement.end());
  std::string problem = normalize(*type, z);
  const int p = find_pool(type);
  const bool has_pool = p < std::ssize(factor_pools_);
  std::int32_t noise =
      has_pool ? factor_pools_[p].recent.find(information, factor_pools_[p].information) : -1;
  Root root;
  if (problem.empty() && noise < 0) {
    root = root_of(information, n);
    problem = problem_of(root, information);
  }
  if (!problem.empty()) throw bad_input(fmt::format("{}: {}", name_of(*type, variables), problem));
  const int rank = noise < 0 ? root.rank : factor_pools_[p].ranks[noise];
  if (loss) loss = for_size(std::move(loss), rank);
  const std::int16_t of_loss = loss_index(*type, loss);
  // Nothing is refused from here on.
  if (!has_pool) {
    factor_pools_.emplace_back().type = std::move(type);
    for (const int v : variables) factor_pools_[p].variable_pools.push_back(records_[v].pool);
  }
  // What was given may be of this graph itself, whose arrays move while they grow: it comes first.
  FactorPool& pool = factor_pools_[p];
  if (noise < 0) noise = add_noise(pool, information, root.packed, root.rank);
  ++pool.uses[noise];
  pool.noises.push_back(noise);
  pool.variables.append(variables);
  pool.measurements.append(z);
  pool.losses.push_back(of_loss);
  for (const int v : std::span(pool.variables).last(variables.size()))
    pool.slots.push_back(records_[v].slot);
  const int position = factor_count();
  factors_.push_back({p, static_cast<std::int32_t>(pool.size())});
  pool.sequence.push_back(position);
  if (pool.size() == kMany && factors_.size() < expected_factors_) {
    const std::size_t all = kMany + expected_factors_ - factors_.size();
    reserve_if_possible(all * pool.variable_pools.size(), pool.variables, pool.slots);
    reserve_if_possible(all * measurement_size, pool.measurements);
    reserve_if_possible(all, pool.noises, pool.losses, pool.sequence);
    if (pool.ranks.size() > kMany / 2) {  // most have one of their own
      reserve_if_possible(all * information_size, pool.information, pool.sqrt_information);
      reserve_if_possible(all, pool.ranks, pool.uses);
    }
  }
  ++structure_version_;
  return position;
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
  Numbers state(x.begin(), x.end());
  if (const std::string problem = normalize(t, state); !problem.empty())
    throw bad_input(fmt::format("{}: {}", describe_variable(variable), problem));
  std::ranges::copy(state, values_.pools[pool(variable)].begin() +
                               slot(variable) * static_cast<std::ptrdiff_t>(size));
}

Variable Graph::variable(int variable) const {
  const std::span<const double> x = state(variable);
  return {type_of(variable), id(variable), {x.begin(), x.end()}, fixed(variable)};
}

std::string Graph::describe_variable(int variable) const {
  return fmt::format("{} {}", type(variable).tag(), id_text(id(variable)));
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
  return {pool.information.data() + pool.noises[factors_[position].entry] * size, size};
}

std::span<const double> Graph::sqrt_information(int position) const {
  const FactorPool& pool = factor_pools_[factors_[position].pool];
  const std::size_t size = packed_size(pool.type->residual_size());
  return {pool.sqrt_information.data() + pool.noises[factors_[position].entry] * size, size};
}

int Graph::information_rank(int position) const {
  const FactorPool& pool = factor_pools_[factors_[position].pool];
  return pool.ranks[pool.noises[factors_[position].entry]];
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
  for (int f = 0; f < factor_count(); ++f)
    if (std::ranges::count(factor_variables(f), variable) > 0) result.push_back(f);
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
  Numbers z(measurement.begin(), measurement.end());
  std::string problem = normalize(*pool.type, z);
  Root root;
  if (!information.empty()) {
    root = root_of(information, pool.type->residual_size());
    if (problem.empty()) problem = problem_of(root, information);
  }
  if (!problem.empty()) throw bad_input(fmt::format("{}: {}", describe_factor(position), problem));
  std::int32_t& noise = pool.noises[entry];
  const std::int32_t old = noise;
  const bool own = information.empty() || pool.uses[old] == 1;
  if (!own) noise = add_noise(pool, information, root.packed, root.rank);
  std::ranges::copy(z, pool.measurements.begin() + static_cast<std::ptrdiff_t>(entry * size));
  if (information.empty()) return;
  if (pool.ranks[old] != root.rank) ++structure_version_;  // the gauge may be another
  if (!own) {
    --pool.uses[old];
    ++pool.uses[noise];
    return;
  }
  const auto begin = noise * static_cast<std::ptrdiff_t>(packed);
  std::ranges::copy(information, pool.information.begin() + begin);
  std::ranges::copy(root.packed, pool.sqrt_information.begin() + begin);
  pool.ranks[noise] = static_cast<std::int16_t>(root.rank);
}

std::string Graph::describe_factor(int position) const {
  std::string text(factor_pools_[factors_[position].pool].type->tag());
  for (const std::int32_t v : factor_variables(position)) text += " " + id_text(id(v));
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
          .noises = pool.noises.data(),
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

}  // namespace cairn
