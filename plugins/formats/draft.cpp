// SPDX-License-Identifier: BSD-3-Clause
#include "draft.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <utility>

#include <fmt/core.h>

#include "cairn/graph/packed.hpp"
#include "cairn/plugin/plugin_search.hpp"
#include "cairn/runtime/error.hpp"
#include "information.hpp"
#include "propagate.hpp"
#include "scanner.hpp"

namespace cairn::formats {

Draft::Draft(std::string file, std::string format, Registry& types, const ReadOptions& options,
             ReadReport& report)
    : file_(std::move(file)),
      format_(std::move(format)),
      types_(&types),
      options_(options),
      report_(&report) {}

std::string Draft::plugin_problems() const {
  std::string text;
  for (const PluginProblem& problem : types_->problems()) text += "; note: " + problem.message;
  return text;
}

std::int32_t Draft::variable_kind(std::string_view tag) {
  for (std::size_t k = 0; k < variable_kinds_.size(); ++k) {
    if (variable_kinds_[k].tag == tag) return static_cast<std::int32_t>(k);
  }
  auto type = types_->variable_type(tag);
  const int size = type->ambient_size();
  variable_kinds_.push_back({std::string(tag), std::move(type), size});
  return static_cast<std::int32_t>(variable_kinds_.size()) - 1;
}

std::int32_t Draft::factor_kind(std::string_view tag, std::string_view name) {
  if (name.empty()) name = tag;
  for (std::size_t k = 0; k < factor_kinds_.size(); ++k) {
    if (factor_kinds_[k].tag == tag && factor_kinds_[k].name == name) {
      return static_cast<std::int32_t>(k);
    }
  }
  auto type = types_->factor_type(tag);
  std::vector<std::int32_t> kinds;
  for (const std::string_view variable : type->variable_tags())
    kinds.push_back(variable_kind(variable));
  const int residual = type->residual_size();
  const FactorKind kind{std::string(tag),
                        type,
                        std::move(kinds),
                        type->arity(),
                        type->measurement_size(),
                        residual,
                        static_cast<int>(packed_size(residual)),
                        std::string(name)};
  factor_kinds_.push_back(kind);
  return static_cast<std::int32_t>(factor_kinds_.size()) - 1;
}

std::span<double> Draft::add_variable(std::int32_t kind, Id id, std::int64_t line) {
  const std::size_t begin = numbers_.size();
  const std::size_t size = static_cast<std::size_t>(variable_kinds_[kind].size);
  numbers_.resize(begin + size);
  variables_.push_back({kind, id, line, begin});
  return {numbers_.data() + begin, size};
}

Draft::FactorSlots Draft::add_factor(std::int32_t kind, std::int64_t line) {
  const FactorKind& k = factor_kinds_[kind];
  factors_.push_back({kind, line, ids_.size(), numbers_.size()});
  ids_.resize(ids_.size() + static_cast<std::size_t>(k.arity));
  numbers_.resize(numbers_.size() + static_cast<std::size_t>(k.measurement + k.information));
  return slots(factors_.back());
}

Draft::FactorSlots Draft::slots(const Factor& factor) {
  const FactorKind& k = factor_kinds_[factor.kind];
  double* numbers = numbers_.data() + factor.numbers;
  return {{ids_.data() + factor.ids, static_cast<std::size_t>(k.arity)},
          {numbers, static_cast<std::size_t>(k.measurement)},
          {numbers + k.measurement, static_cast<std::size_t>(k.information)}};
}

void Draft::finish_factor(std::span<const double> as_in_file) {
  const Factor& factor = factors_.back();
  const FactorKind& kind = factor_kinds_[factor.kind];
  const std::span<double> information{numbers_.data() + factor.numbers + kind.measurement,
                                      static_cast<std::size_t>(kind.information)};
  const auto failed = first_failed_pivot(kind.residual, information);
  if (!failed) return;
  const bool repairable = kind.residual == 6 && kind.type->is_relative();
  if (repairable && options_.repair_information &&
      repair_misplaced_entries(information.first<21>())) {
    ++report_->repaired;
    return;
  }
  // Semidefinite is fine: it leaves a direction open. But the square of any numbers read as iSAM's
  // root is semidefinite: there they must not fit another meaning.
  std::vector<double> root(information.size());
  const bool zero = std::ranges::all_of(information, [](double x) { return x == 0.0; });
  const bool semidefinite = !zero && square_root(information, kind.residual, root);
  if (semidefinite && format_ != "isam") return;
  std::string advice;
  if (kind.residual == 3 && kind.type->is_relative()) {
    if (as_in_file.empty()) as_in_file = information;
    advice = other_order_hint(as_in_file.first<6>(), format_);
  }
  if (repairable && !options_.repair_information) {
    std::array<double, 21> copy;
    std::copy(information.begin(), information.end(), copy.begin());
    if (repair_misplaced_entries(copy)) {
      advice +=
          "; moving its (z, rx) and (z, ry) entries to (x, rz) and (y, rz) would make it so: "
          "ReadOptions::repair_information";
    }
  }
  if (semidefinite && advice.empty()) return;
  fail(factor.line,
       fmt::format(
           "the information of {} is not positive semidefinite or zero (pivot {} of its Cholesky "
           "factor is {:.6g}); expected a positive semidefinite {}x{} matrix{}",
           describe(factor), failed->row + 1, failed->pivot, kind.residual, kind.residual, advice));
}

Graph Draft::build() {
  if (variables_.empty() && factors_.empty()) {
    std::int64_t skipped = 0;
    for (const auto& [tag, lines] : report_->skipped) skipped += lines;
    const std::string why =
        skipped > 0 ? fmt::format(" ({} lines with unknown tags skipped)", skipped) : "";
    throw Error(ErrorCode::input,
                fmt::format("{}: the file holds no variable and no factor{}", file_, why));
  }
  const bool vertices_missing = variables_.empty();
  if (vertices_missing) make_missing_variables();
  sort_variables();

  Graph graph;
  graph.reserve(variables_.size(), factors_.size());
  add_variables_to(graph);
  add_factors_to(graph);
  if (vertices_missing) {
    const Propagation result = propagate_states(graph);
    report_->notes.push_back(fmt::format(
        "the file has no vertices: {} were made, with states propagated along the factors{}",
        graph.variable_count(),
        result.roots > 1
            ? fmt::format(" from {} starting points that no factor connects", result.roots)
            : ""));
  }
  hold_variables_of(graph);
  return graph;
}

void Draft::make_missing_variables() {
  for (const Factor& factor : factors_) {
    const FactorKind& kind = factor_kinds_[factor.kind];
    for (int k = 0; k < kind.arity; ++k) {
      variables_.push_back({kind.variable_kinds[k], ids_[factor.ids + k], factor.line, 0});
    }
  }
  // The first factor that names a variable says what it is; one that disagrees is found with its
  // ends.
  std::stable_sort(variables_.begin(), variables_.end(),
                   [](const Variable& a, const Variable& b) { return a.id < b.id; });
  const auto last = std::unique(variables_.begin(), variables_.end(),
                                [](const Variable& a, const Variable& b) { return a.id == b.id; });
  variables_.erase(last, variables_.end());
  for (Variable& variable : variables_) {
    const VariableKind& kind = variable_kinds_[variable.kind];
    variable.numbers = numbers_.size();
    numbers_.resize(numbers_.size() + static_cast<std::size_t>(kind.size));
    kind.type->identity(numbers_.data() + variable.numbers);
  }
}

void Draft::sort_variables() {
  const auto by_id = [](const Variable& a, const Variable& b) { return a.id < b.id; };
  if (!std::is_sorted(variables_.begin(), variables_.end(), by_id)) {
    std::stable_sort(variables_.begin(), variables_.end(), by_id);
  }
  const Variable* again = nullptr;  // the duplicate that comes first in the file
  for (std::size_t i = 1; i < variables_.size(); ++i) {
    if (variables_[i].id == variables_[i - 1].id && (!again || variables_[i].line < again->line)) {
      again = &variables_[i];
    }
  }
  if (again) {
    fail(again->line,
         fmt::format("{} {}: the id was already given in line {}; expected every id once",
                     variable_kinds_[again->kind].tag, again->id, (again - 1)->line));
  }
}

std::int32_t Draft::index_of(Id id) const {
  // Ids mostly count up from the first without a gap.
  const Id first = variables_.front().id;
  if (id < first) return -1;
  const auto offset = static_cast<std::size_t>(id - first);
  if (offset < variables_.size() && variables_[offset].id == id) {
    return static_cast<std::int32_t>(offset);
  }
  const auto it = std::lower_bound(variables_.begin(), variables_.end(), id,
                                   [](const Variable& v, Id wanted) { return v.id < wanted; });
  return it == variables_.end() || it->id != id
             ? -1
             : static_cast<std::int32_t>(it - variables_.begin());
}

std::string Draft::describe(const Factor& factor) const {
  const FactorKind& kind = factor_kinds_[factor.kind];
  std::string text = kind.name;
  for (int k = 0; k < kind.arity; ++k) text += fmt::format(" {}", ids_[factor.ids + k]);
  return text;
}

void Draft::check_ends(const Factor& factor, std::span<int> indices) const {
  const FactorKind& kind = factor_kinds_[factor.kind];
  for (int k = 0; k < kind.arity; ++k) {
    const Id id = ids_[factor.ids + k];
    indices[k] = index_of(id);
    if (indices[k] < 0) {
      fail(factor.line,
           fmt::format("{}: there is no vertex {} in this file; expected a line that gives it, "
                       "or a file without any vertices",
                       describe(factor), id));
    }
    const Variable& variable = variables_[indices[k]];
    if (variable.kind != kind.variable_kinds[k]) {
      fail(factor.line, fmt::format("{}: {} is a {} by line {}; expected a {}", describe(factor),
                                    id, variable_kinds_[variable.kind].tag, variable.line,
                                    variable_kinds_[kind.variable_kinds[k]].tag));
    }
    for (int other = 0; other < k; ++other) {
      if (indices[other] == indices[k]) {
        fail(factor.line, fmt::format("{} joins variable {} to itself; expected different ids",
                                      describe(factor), id));
      }
    }
  }
}

void Draft::add_variables_to(Graph& graph) const {
  for (const Variable& variable : variables_) {
    const VariableKind& kind = variable_kinds_[variable.kind];
    try {
      graph.add_variable(kind.type, variable.id,
                         {numbers_.data() + variable.numbers, static_cast<std::size_t>(kind.size)});
    } catch (const Error& error) {
      throw Error(error.code(), located(file_, variable.line, error.what()));
    }
  }
}

void Draft::add_factors_to(Graph& graph) const {
  std::vector<int> indices;
  for (const Factor& factor : factors_) {
    const FactorKind& kind = factor_kinds_[factor.kind];
    indices.resize(static_cast<std::size_t>(kind.arity));
    check_ends(factor, indices);
    const double* numbers = numbers_.data() + factor.numbers;
    try {
      graph.add_factor(kind.type, indices, {numbers, static_cast<std::size_t>(kind.measurement)},
                       {numbers + kind.measurement, static_cast<std::size_t>(kind.information)});
    } catch (const Error& error) {
      throw Error(error.code(), located(file_, factor.line, error.what()));
    }
  }
}

void Draft::hold_variables_of(Graph& graph) const {
  for (const Held& held : held_) {
    const std::int32_t index = index_of(held.id);
    if (index < 0) {
      fail(held.line, fmt::format("FIX {}: there is no vertex {} in this file", held.id, held.id));
    }
    graph.set_fixed(index);
  }
}

void Draft::fail(std::int64_t line, std::string_view what) const {
  throw Error(ErrorCode::input, located(file_, line, what));
}

}  // namespace cairn::formats
