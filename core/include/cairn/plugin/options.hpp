// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/runtime/api.hpp"

namespace cairn {

enum class OptionType {
  boolean,
  integer,
  real,
  text,
  choice,     ///< one of `choices`
  component,  ///< the name (with options) of another component, whose kind is one of `choices`
};

/// How an option stands on a command line, where it is that of a command: `--name VALUE` unless
/// this says otherwise. Options that are written as `component:key=value` do not need it.
struct CommandLineForm {
  std::string placeholder;  ///< of its value in the help, such as FILE; empty: by its type
  char letter = '\0';       ///< `-o` beside `--output`
  bool positional = false;  ///< known by where it stands
  bool named = true;        ///< may be given as `--name`; false of most positional ones
  bool required = false;
  bool takes_words = false;  ///< of a list: takes all words that follow, not one each time
  char separator = '\0';     ///< of a list: one word may hold several values, `A,B`
  std::vector<std::string> generators = {};  ///< `@NAME` of one of these kinds stands for a file
};

/// One option of a component: what it is called, what it may be, and one line of help.
struct OptionSpec {
  std::string name;
  OptionType type = OptionType::text;
  std::string default_value;
  std::string help;  ///< one line; states the unit if there is one
  double minimum = -std::numeric_limits<double>::infinity();
  double maximum = std::numeric_limits<double>::infinity();
  std::vector<std::string> choices = {};  ///< of a text: what may be suggested; any other will do
  bool optional = false;                  ///< a number or choice that may be absent: the empty text
  bool or_zero = false;                   ///< a number that may be zero as well, for no limit
  bool list = false;                      ///< several texts, one after the other (`split_list`)
  bool components = false;                ///< of a component: several, `A,B` (`split_components`)
  CommandLineForm form = {};
};

/// The options of one component. The same table checks the command line, fills in defaults and
/// prints the help. A component with a struct of options has its table from there
/// (`OptionFields`); one without writes it down:
///
///     OptionTable{}
///         .integer("iterations", 100, 1, 1e6, "largest number of iterations")
///         .choice("ordering", "amd", {"amd", "natural"}, "fill-reducing ordering")
class CAIRN_API OptionTable {
 public:
  OptionTable& boolean(std::string name, bool default_value, std::string help);
  OptionTable& integer(std::string name, std::int64_t default_value, double minimum, double maximum,
                       std::string help);
  OptionTable& real(std::string name, double default_value, double minimum, double maximum,
                    std::string help);
  OptionTable& text(std::string name, std::string default_value, std::string help);
  OptionTable& choice(std::string name, std::string default_value, std::vector<std::string> choices,
                      std::string help);
  OptionTable& component(std::string name, std::string kind, std::string default_value,
                         std::string help);
  /// Any of these. Throws `std::logic_error` if there is an option of that name already.
  OptionTable& add(OptionSpec spec);

  const std::vector<OptionSpec>& specs() const { return specs_; }
  /// The spec of that name, or null.
  const OptionSpec* find(std::string_view name) const;
  /// One line per option, for `--help` and `cairn plugins NAME`.
  std::string help(std::string_view indent = "  ") const;

 private:
  std::vector<OptionSpec> specs_;
};

/// A value as it is written on a command line: the shortest text that reads back as the same.
CAIRN_API std::string option_text(bool value);
CAIRN_API std::string option_text(std::int64_t value);
CAIRN_API std::string option_text(double value);

/// The text of a list, whose items have no zero byte; and its items.
CAIRN_API std::string list_text(const std::vector<std::string>& items);
CAIRN_API std::vector<std::string> split_list(std::string_view text);

/// Option values as they were written: name to text.
using OptionValues = std::map<std::string, std::string, std::less<>>;

/// Checked values of all options of one component. Asking for an option that the table does not
/// have, or as another type, is a programming error and throws `std::logic_error`.
class CAIRN_API Options {
 public:
  /// Checks `values` against `table`; what is missing gets its default. Throws `Error` (usage) that
  /// names `owner`, the option and what it may be: unknown name (with the nearest spelling), wrong
  /// type, out of range.
  Options(const OptionTable& table, const OptionValues& values, std::string_view owner);

  bool boolean(std::string_view name) const;
  std::int64_t integer(std::string_view name) const;
  double real(std::string_view name) const;
  /// For text, choice and component options.
  const std::string& text(std::string_view name) const;
  /// Whether an option that may be absent is.
  bool absent(std::string_view name) const;
  /// Whether the value was given, not defaulted.
  bool given(std::string_view name) const;

 private:
  struct Value {
    OptionType type;
    std::string text;
    double number = 0.0;
    std::int64_t whole = 0;
    bool given = false;
    bool absent = false;
  };
  const Value& value(std::string_view name, OptionType type) const;
  std::map<std::string, Value, std::less<>> values_;
};

/// A component as it is named on a command line: `name` or `name:key=value,key=value`.
struct ComponentSpec {
  std::string name;
  OptionValues values;
};

/// Parses `name:key=value,key=value`. Throws `Error` (usage) with the text and the form expected.
CAIRN_API ComponentSpec parse_component(std::string_view text);

/// The inverse of `parse_component`. Throws `Error` (usage) for what that form cannot hold: a name
/// with ':' and a value with ',', such as that of a component with two options of its own, which a
/// `ComponentSpec` can.
CAIRN_API std::string to_text(const ComponentSpec& spec);

/// "compact_pose:range=5,angle=0.5", for people: also of what `to_text` refuses.
CAIRN_API std::string spec_text(const ComponentSpec& spec);

/// Splits `a,b:key=value,key=value,c` into its components: a part that holds '=' but no ':' before
/// it belongs to the component on its left.
CAIRN_API std::vector<std::string> split_components(std::string_view text);

}  // namespace cairn
