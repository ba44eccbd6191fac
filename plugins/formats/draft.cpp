// SPDX-License-Identifier: BSD-3-Clause
#include "draft.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include <fmt/core.h>

#include "cairn/graph/packed.hpp"
#include "cairn/graph/rounding.hpp"
#include "cairn/plugin/plugin_search.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/symbol.hpp"
#include "printed_digits.hpp"
#include "propagate.hpp"

namespace cairn::formats {
namespace {

/// Of the kind that published files have with misplaced entries.
bool is_repairable(const Draft::FactorKind& kind) {
  return kind.residual == 6 && kind.type->is_relative();
}

/// A state or measurement with one number more than it has degrees of freedom, and four at least:
/// the last four are a rotation.
bool ends_with_quaternion(int numbers, int degrees) {
  return numbers == degrees + 1 && numbers >= 4;
}

}  // namespace

Draft::Draft(std::string file, std::string format, Registry& types, const ReadOptions& options,
             ReadReport& report)
    : file_(std::move(file)),
      format_(std::move(format)),
      types_(&types),
      options_(options),
      report_(&report) {}

void Draft::start_again(const std::string& file, const ReadOptions& options) {
  file_ = file;
  options_ = options;
  variables_.clear();
  factors_.clear();
  held_.clear();
  ids_.clear();
  numbers_.clear();
  skipped_vertices_.clear();
  tallies_ = {};
}

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

void Draft::finish_factor(const Scanner& scanner, const Arrangement& arrangement) {
  Factor& factor = factors_.back();
  const FactorKind& kind = factor_kinds_[factor.kind];
  const std::span<double> information = slots(factor).information;
  if (is_positive_definite(kind.residual, information)) return;
  if (std::ranges::all_of(information, [](double x) { return x == 0.0; })) {
    factor.has_effect = false;
    tallies_.without_effect.add(fmt::format("{} in line {}", describe(factor), factor.line));
    return;
  }
  if (options_.repair_information && is_repairable(kind) &&
      repair_misplaced_entries(information.first<21>())) {
    ++report_->repaired;
    return;
  }
  // Semidefinite is fine: it leaves a direction open. But the square of any numbers read as iSAM's
  // root is semidefinite: there they must not fit another meaning.
  std::vector<double> root(information.size());
  const bool semidefinite = square_root_of_doubles(information, kind.residual, root);
  if (semidefinite && (!arrangement.is_root || advice(factor, scanner).empty())) return;
  if (!semidefinite && settle(factor, scanner, arrangement)) return;
  refuse_information(factor, scanner, arrangement);
}

bool Draft::settle(const Factor& factor, const Scanner& scanner, const Arrangement& arrangement) {
  const std::span<double> information = slots(factor).information;
  std::vector<std::string_view> fields(static_cast<std::size_t>(scanner.layout().information));
  scanner.last_fields(fields);
  std::vector<double> as_in_file(fields.size()), rounding(information.size());
  printed_rounding(fields, as_in_file);
  arrangement.to_rows(as_in_file, rounding);
  const int n = factor_kinds_[factor.kind].residual;
  if (are_texts_of_floats(fields)) add_float_rounding(n, information, rounding);
  if (!settle_rounding(n, rounding, information)) return false;
  tallies_.settled.add(fmt::format("{} in line {}", describe(factor), factor.line));
  return true;
}

/// What else the numbers may be, and what would help.
std::string Draft::advice(const Factor& factor, const Scanner& scanner) const {
  const FactorKind& kind = factor_kinds_[factor.kind];
  if (kind.residual == 3 && kind.type->is_relative()) {
    std::array<std::string_view, 6> fields;
    scanner.last_fields(fields);
    std::array<double, 6> as_in_file{};
    for (std::size_t k = 0; k < fields.size(); ++k) parse_number(fields[k], as_in_file[k]);
    return other_order_hint(as_in_file, format_, !variables_.empty());
  }
  if (!is_repairable(kind) || options_.repair_information) return {};
  std::array<double, 21> copy;
  std::copy_n(numbers_.data() + factor.numbers + kind.measurement, copy.size(), copy.begin());
  return repair_misplaced_entries(copy)
             ? "; moving its (z, rx) and (z, ry) entries to (x, rz) and (y, rz) would make it so: "
               "ReadOptions::repair_information"
             : "";
}

void Draft::refuse_information(const Factor& factor, const Scanner& scanner,
                               const Arrangement& arrangement) const {
  const FactorKind& kind = factor_kinds_[factor.kind];
  const std::span<const double> information{numbers_.data() + factor.numbers + kind.measurement,
                                            static_cast<std::size_t>(kind.information)};
  const std::string found =
      arrangement.is_root
          ? fmt::format(
                "the square root of the information of {} has a zero on its diagonal (row "
                "{})",
                describe(factor), first_failed_pivot(kind.residual, information)->row + 1)
          : fmt::format(
                "the information of {} is not positive semidefinite ({}); expected a positive "
                "semidefinite {}x{} matrix",
                describe(factor), what_is_indefinite(kind.residual, information), kind.residual,
                kind.residual);
  fail(factor.line, found + advice(factor, scanner));
}

void Draft::take_unit_information(const Scanner& scanner) {
  const Factor& factor = factors_.back();
  const FactorKind& kind = factor_kinds_[factor.kind];
  if (!options_.unit_information) {
    fail(factor.line,
         fmt::format("{} without {}; expected {} more (ReadOptions::unit_information takes it as "
                     "the identity)",
                     describe(factor), scanner.layout().matrix,
                     scanner.layout().information == 1
                         ? "1 number"
                         : fmt::format("{} numbers", scanner.layout().information)));
  }
  const std::span<double> information = slots(factor).information;
  std::ranges::fill(information, 0.0);
  for (int row = 0; row < kind.residual; ++row)
    information[static_cast<std::size_t>(triangle_index(kind.residual, row, row))] = 1.0;
  tallies_.of_unit_information.add(fmt::format("{} in line {}", describe(factor), factor.line));
}

void Draft::add_skipped(const Scanner& scanner) {
  const std::string tag = shown(scanner.tag());
  ++report_->skipped[tag];
  if (scanner.tag().starts_with("EDGE") || scanner.tag().starts_with("PARAMS")) return;
  if (const std::optional<Id> id = scanner.id_after_tag())
    skipped_vertices_.try_emplace(*id, SkippedVertex{tag, scanner.line()});
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
        "the file has no vertices{}: {} were made, with states propagated along the factors{}",
        skipped_vertices_.empty() ? "" : " of known types", graph.variable_count(),
        result.roots > 1
            ? fmt::format(" from {} starting points that no factor connects", result.roots)
            : ""));
  }
  hold_variables_of(graph);
  write_notes();
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

std::string Draft::name_of(Id id) const {
  return format_ == "pyfg" ? id_text(id) : fmt::format("{}", id);
}

std::string Draft::describe(const Factor& factor) const {
  const FactorKind& kind = factor_kinds_[factor.kind];
  std::string text = kind.name;
  for (int k = 0; k < kind.arity; ++k) text += " " + name_of(ids_[factor.ids + k]);
  return text;
}

/// Whether what names `missing`, which is no variable, is to be left out; it is counted then.
bool Draft::leave_out(const std::string& what, std::int64_t line, Id missing) {
  const auto skipped = skipped_vertices_.find(missing);
  if (skipped != skipped_vertices_.end()) {
    tallies_.on_skipped.add(fmt::format("{} in line {}, on {} {} of line {}", what, line,
                                        skipped->second.tag, name_of(missing),
                                        skipped->second.line));
    return true;
  }
  if (options_.skip_dangling) {
    tallies_.dangling.add(fmt::format("{} in line {}", what, line));
    return true;
  }
  fail(line,
       fmt::format("{}: there is no vertex {} in this file; expected a line that gives it, or "
                   "a file without any vertices (ReadOptions::skip_dangling leaves out what "
                   "leads to vertices of another file)",
                   what, name_of(missing)));
}

bool Draft::find_ends(const Factor& factor, std::span<int> indices) {
  const FactorKind& kind = factor_kinds_[factor.kind];
  for (int k = 0; k < kind.arity; ++k) {
    const Id id = ids_[factor.ids + k];
    indices[k] = index_of(id);
    if (indices[k] < 0) {
      leave_out(describe(factor), factor.line, id);
      return false;
    }
    const Variable& variable = variables_[indices[k]];
    if (variable.kind != kind.variable_kinds[k]) {
      fail(factor.line, fmt::format("{}: {} is a {} by line {}; expected a {}", describe(factor),
                                    name_of(id), variable_kinds_[variable.kind].tag, variable.line,
                                    variable_kinds_[kind.variable_kinds[k]].tag));
    }
    for (int other = 0; other < k; ++other) {
      if (indices[other] == indices[k]) {
        fail(factor.line, fmt::format("{} joins variable {} to itself; expected different ids",
                                      describe(factor), name_of(id)));
      }
    }
  }
  return true;
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

void Draft::add_factors_to(Graph& graph) {
  std::vector<int> indices;
  for (const Factor& factor : factors_) {
    const FactorKind& kind = factor_kinds_[factor.kind];
    indices.resize(static_cast<std::size_t>(kind.arity));
    if (!find_ends(factor, indices) || !factor.has_effect) continue;
    const double* numbers = numbers_.data() + factor.numbers;
    try {
      graph.add_factor(kind.type, indices, {numbers, static_cast<std::size_t>(kind.measurement)},
                       {numbers + kind.measurement, static_cast<std::size_t>(kind.information)});
    } catch (const Error& error) {
      throw Error(error.code(), located(file_, factor.line, error.what()));
    }
  }
}

void Draft::hold_variables_of(Graph& graph) {
  for (const Held& held : held_) {
    const std::int32_t index = index_of(held.id);
    if (index >= 0) {
      graph.set_fixed(index);
    } else {
      leave_out(fmt::format("FIX {}", name_of(held.id)), held.line, held.id);
    }
  }
}

// Notes -------------------------------------------------------------------------------------------

namespace {

/// Whether the last four numbers are of norm 1 but for rounding: most are, and a root takes longer.
bool is_surely_unit(std::span<const double> numbers) {
  const double* q = numbers.data() + numbers.size() - 4;
  return std::abs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0) < 1e-5;
}

/// Of the last four numbers.
double norm_of(std::span<const double> numbers) {
  const double* q = numbers.data() + numbers.size() - 4;
  return std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3]));
}

/// More than six digits leave; zero is refused.
bool is_off(double norm) {
  constexpr double kTolerance = 1e-5;
  return norm != 0.0 && std::abs(norm - 1.0) > kTolerance;
}

/// Whether a type makes the last four numbers, which are not of norm 1, a quaternion.
template <class Type>
bool would_normalize(const Type& type, std::span<const double> numbers) {
  if (is_surely_unit(numbers) || !is_off(norm_of(numbers))) return false;
  std::vector<double> copy(numbers.begin(), numbers.end());
  return type.normalize(copy.data()).empty() && !is_off(norm_of(copy));
}

}  // namespace

void Draft::check_quaternion(std::span<const double> numbers, std::int64_t line,
                             const std::string& what) {
  const double norm = norm_of(numbers);
  if (is_off(norm))
    tallies_.norms.add(fmt::format("{} in line {} with the norm {:.6g}", what, line, norm));
}

void Draft::check_quaternions() {
  if (format_ == "kitti") return;  // of matrices, which its reader checks
  for (const Variable& variable : variables_) {
    const VariableKind& kind = variable_kinds_[variable.kind];
    if (!ends_with_quaternion(kind.size, kind.type->tangent_size())) continue;
    const std::span<const double> state{numbers_.data() + variable.numbers,
                                        static_cast<std::size_t>(kind.size)};
    if (would_normalize(*kind.type, state))
      check_quaternion(state, variable.line, fmt::format("{} {}", kind.tag, name_of(variable.id)));
  }
  for (const Factor& factor : factors_) {
    const FactorKind& kind = factor_kinds_[factor.kind];
    if (!ends_with_quaternion(kind.measurement, kind.residual)) continue;
    const std::span<const double> z = slots(factor).measurement;
    if (would_normalize(*kind.type, z)) check_quaternion(z, factor.line, describe(factor));
  }
}

void Draft::write_notes() {
  check_quaternions();
  const auto note = [this](const Tally& tally, const char* one, const char* many,
                           std::string_view rest) {
    if (tally.count == 0) return;
    report_->notes.push_back(fmt::format("{} {}{}: {}{}", tally.count,
                                         tally.count == 1 ? one : many, rest,
                                         tally.count == 1 ? "" : "the first is ", tally.first));
  };
  note(tallies_.settled, "factor", "factors",
       " had information that was not positive semidefinite by less than rounding changes its "
       "numbers; it "
       "was set to the nearest semidefinite matrix");
  note(tallies_.without_effect, "factor has zero information and",
       "factors have zero information and", " no effect (left out)");
  note(tallies_.of_unit_information, "factor", "factors",
       " without information taken as of unit information");
  note(tallies_.on_skipped, "line", "lines", " left out, on vertices of skipped lines");
  note(tallies_.dangling, "line", "lines", " left out, on vertices that this file does not have");
  note(tallies_.norms, "quaternion is", "quaternions are",
       " not of norm 1 and normalised (expected qx qy qz qw)");
}

void Draft::fail(std::int64_t line, std::string_view what) const {
  throw Error(ErrorCode::input, located(file_, line, what));
}

}  // namespace cairn::formats
