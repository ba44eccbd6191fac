// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "information.hpp"
#include "scanner.hpp"

namespace cairn::formats {

/// What a reader has found in a file so far: variables and factors with the lines that they came
/// from. Every reader fills one, line by line in whatever order the file has, and `build` makes the
/// graph when all is known. All numbers lie in one array, all ids in another.
class Draft {
 public:
  struct Variable {
    std::int32_t kind;
    Id id;
    std::int64_t line;
    std::size_t numbers;  ///< first of ambient_size
  };
  struct Factor {
    std::int32_t kind;
    std::int64_t line;
    std::size_t ids;         ///< first of arity
    std::size_t numbers;     ///< first of measurement_size + n(n+1)/2
    bool has_effect = true;  ///< its information is not zero
  };
  struct Held {
    Id id;
    std::int64_t line;
  };
  struct VariableKind {
    std::string tag;
    std::shared_ptr<const VariableType> type;
    int size;
  };
  struct FactorKind {
    std::string tag;
    std::shared_ptr<const FactorType> type;
    std::vector<std::int32_t> variable_kinds;
    int arity, measurement, residual, information;
    std::string name;  ///< what the file calls it; the tag unless the reader says otherwise
  };

  Draft(std::string file, std::string format, Registry& types, const ReadOptions& options,
        ReadReport& report);
  /// For another text: forgets all but the types.
  void start_again(const std::string& file, const ReadOptions& options);

  /// The kind of that tag, asking the registry for its type the first time. Throws `Error`
  /// (plugin).
  std::int32_t variable_kind(std::string_view tag);
  /// `name`: the tag by which the file calls it in messages, if that is another.
  std::int32_t factor_kind(std::string_view tag, std::string_view name = {});
  const VariableKind& variable(std::int32_t kind) const { return variable_kinds_[kind]; }
  const FactorKind& factor(std::int32_t kind) const { return factor_kinds_[kind]; }

  /// Adds a variable; the span is its state, to be filled by the caller at once.
  std::span<double> add_variable(std::int32_t kind, Id id, std::int64_t line);
  /// Adds a factor; the spans are to be filled by the caller at once: ids, measurement, information
  /// (upper triangle row by row).
  struct FactorSlots {
    std::span<Id> ids;
    std::span<double> measurement;
    std::span<double> information;
  };
  FactorSlots add_factor(std::int32_t kind, std::int64_t line);
  /// To be called when the slots of the last factor are filled from the line of `scanner`, its
  /// information by `arrangement`. Information that is not positive definite is repaired where that
  /// is asked for and possible, set to the nearest semidefinite matrix where it is indefinite by no
  /// more than the digits printed, and refused else; a factor without any has no effect.
  void finish_factor(const Scanner& scanner, const Arrangement& arrangement = kRows);
  /// For the last factor, whose line ends before the information: the identity, if that is asked
  /// for; refused else.
  void take_unit_information(const Scanner& scanner);
  /// A line with an unknown tag was left out; what looks like a vertex is known by its id.
  void add_skipped(const Scanner& scanner);
  void add_held(Id id, std::int64_t line) { held_.push_back({id, line}); }

  std::vector<Variable>& variables() { return variables_; }
  std::vector<Factor>& factors() { return factors_; }
  std::vector<Held>& held() { return held_; }
  FactorSlots slots(const Factor& factor);
  /// A number of a state or measurement by its place.
  double number(std::size_t place) const { return numbers_[place]; }
  ReadReport& report() { return *report_; }
  /// What is wrong with the plugins that were found, for the end of a message about a name that is
  /// not on offer: "; note: …" for each, empty if nothing is.
  std::string plugin_problems() const;
  const std::string& file() const { return file_; }
  const ReadOptions& options() const { return options_; }
  /// "EDGE_SE2 3 4", with names where the format has names in place of ids.
  std::string describe(const Factor& factor) const;

  /// Counts a quaternion, the last four of these numbers, whose norm is not 1 but for rounding.
  void check_quaternion(std::span<const double> numbers, std::int64_t line,
                        const std::string& what);

  /// Reports what was counted: to be called by readers that build no graph.
  void write_notes();

  /// The graph: variables by rising id, factors as in the file. If the file has no vertices at all,
  /// those that its factors join are made, with states propagated along the factors. Throws `Error`
  /// (input) naming file and line.
  Graph build();

  [[noreturn]] void fail(std::int64_t line, std::string_view what) const;

 private:
  /// How often something was done that the report has to say, and where first.
  struct Tally {
    std::int64_t count = 0;
    std::string first;
    void add(const std::string& what) {
      if (count++ == 0) first = what;
    }
  };

  std::string name_of(Id id) const;
  void refuse_information(const Factor& factor, const Scanner& scanner,
                          const Arrangement& arrangement) const;
  bool settle(const Factor& factor, const Scanner& scanner, const Arrangement& arrangement);
  std::string advice(const Factor& factor, const Scanner& scanner) const;
  void make_missing_variables();
  void sort_variables();
  std::int32_t index_of(Id id) const;  ///< among the sorted variables, or -1
  /// False if the factor is to be left out, since a variable of it is not there.
  bool find_ends(const Factor& factor, std::span<int> indices);
  bool leave_out(const std::string& what, std::int64_t line, Id missing);
  void add_variables_to(Graph& graph) const;
  void add_factors_to(Graph& graph);
  void hold_variables_of(Graph& graph);
  void check_quaternions();

  std::string file_;
  std::string format_;
  Registry* types_;
  ReadOptions options_;
  ReadReport* report_;
  std::vector<VariableKind> variable_kinds_;
  std::vector<FactorKind> factor_kinds_;
  std::vector<Variable> variables_;
  std::vector<Factor> factors_;
  std::vector<Held> held_;
  std::vector<Id> ids_;
  std::vector<double> numbers_;
  struct SkippedVertex {
    std::string tag;
    std::int64_t line;
  };
  std::map<Id, SkippedVertex> skipped_vertices_;
  struct Tallies {
    Tally settled, without_effect, of_unit_information, on_skipped, dangling, norms;
  } tallies_;
};

}  // namespace cairn::formats
