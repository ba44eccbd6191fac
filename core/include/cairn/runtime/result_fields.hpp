// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <optional>
#include <ranges>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"

namespace cairn {

/// What a value of a result may be, without its C++ type.
enum class ResultType { boolean, integer, real, text, record, list, names };

/// One figure of a result, or a text, a list or names with values: what all that shows it has to
/// know.
struct ResultField {
  std::string name;  ///< its place in reports: "loops.kept" is the member "kept" of "loops"
  std::string unit;  ///< "m", "nats"; empty: none. Of "s" and "bytes", texts choose "ms", "MiB"
  std::string help;  ///< what it is: a sentence without its full stop
  ResultType type = ResultType::real;
  bool may_be_missing = false;  ///< by its type
  /// In texts: what rows and columns call it. By default the name, in words.
  std::string label;
  /// In texts: how it is rounded, for {fmt}; empty: as its unit and its type are.
  std::string rounding;
  /// In CSV: the same; empty: nine significant digits, of seconds nine decimals.
  std::string csv_rounding;
  std::string column;      ///< in CSV: its title. By default the name with '_' for '.'
  std::string attribute;   ///< in Python. By default the name; "seconds.total" is seconds["total"]
  bool is_detail = false;  ///< in texts it has no row of its own: a sentence says it, or nothing
  bool is_optional = false;  ///< where it has no value it is left out of reports, instead of null
  std::string record;  ///< the name of the part that it is of, which may be missing as a whole
};

struct ResultValue;

/// A struct, as it is reported: its fields, and a value for each.
struct ResultRecord {
  const std::vector<ResultField>* fields = nullptr;  ///< as long as the program runs
  std::vector<ResultValue> values;

  /// Where a field is. Throws `std::logic_error` if none has this name.
  CAIRN_API std::size_t find(std::string_view name) const;
};

/// No value: not known, not asked for, or without meaning.
struct NoResult {
  bool of_record = false;  ///< the whole part that the field is of is missing
};
using ResultList = std::vector<ResultValue>;
using ResultNames = std::vector<std::pair<std::string, ResultValue>>;

/// A value of one field.
struct ResultValue {
  std::variant<NoResult, bool, std::int64_t, double, std::string, ResultRecord, ResultList,
               ResultNames>
      data;

  bool is_missing() const { return std::holds_alternative<NoResult>(data); }
};

namespace detail {

/// The fields of a struct whose type is not known here; what each function does: `ResultFields`.
class CAIRN_API ResultFieldList {
 public:
  using Read = std::function<ResultValue(const void* result)>;
  /// Reads from the part of a result; `NoResult` where the part is missing.
  using ReadPart = std::function<ResultValue(const void* result, const Read& read)>;

  void add(std::string_view name, ResultType type, bool may_be_missing, std::string_view unit,
           std::string_view help, Read read);
  void part(std::string_view name, std::string_view attribute, const ResultFieldList& fields,
            const ReadPart& part, bool may_be_missing);
  ResultField& at(std::string_view name);
  ResultField& last() { return fields_.at(last_); }
  /// `last`, or all of the part that was added last.
  std::span<ResultField> added() { return std::span(fields_).subspan(first_, last_ - first_ + 1); }
  void move_before(std::string_view name);
  void drop(std::string_view name);
  void details();

  const std::vector<ResultField>& fields() const { return fields_; }
  ResultRecord values(const void* result) const;
  ResultValue value(std::size_t field, const void* result) const {
    return reads_.at(field)(result);
  }

 private:
  std::vector<ResultField> fields_;
  std::vector<Read> reads_;
  std::size_t first_ = 0, last_ = 0;  ///< of what was added last
};

template <class Value>
inline constexpr bool is_optional_value = false;
template <class Value>
inline constexpr bool is_optional_value<std::optional<Value>> = true;
template <class Value>
inline constexpr bool is_optional_value<const Value*> = true;
template <>
inline constexpr bool is_optional_value<const char*> = false;

}  // namespace detail

/// A struct that declares what reports say of it.
template <class Struct>
concept ResultStruct = requires {
  { Struct::fields() } -> std::same_as<ResultFields<Struct>>;
};

/// The fields of a struct, made once.
template <ResultStruct Struct>
const ResultFields<Struct>& result_fields() {
  static const ResultFields<Struct> all = Struct::fields();
  return all;
}

/// A struct as it is reported.
template <ResultStruct Struct>
ResultRecord result_record(const Struct& result) {
  return result_fields<Struct>().values(result);
}

namespace detail {

template <class Value>
constexpr ResultType result_type() {
  if constexpr (is_optional_value<Value>) {
    return result_type<std::remove_cvref_t<decltype(*std::declval<Value>())>>();
  } else if constexpr (std::same_as<Value, bool>) {
    return ResultType::boolean;
  } else if constexpr (std::integral<Value>) {
    return ResultType::integer;
  } else if constexpr (std::floating_point<Value>) {
    return ResultType::real;
  } else if constexpr (std::convertible_to<Value, std::string_view> || std::is_enum_v<Value>) {
    return ResultType::text;
  } else if constexpr (ResultStruct<Value>) {
    return ResultType::record;
  } else if constexpr (requires { typename Value::mapped_type; }) {
    return ResultType::names;
  } else {
    static_assert(std::ranges::range<Value>, "a struct in a result declares its fields(), too");
    return ResultType::list;
  }
}

template <class Value>
ResultValue result_value(const Value& value) {
  if constexpr (is_optional_value<Value>) {
    return value ? result_value(*value) : ResultValue{};
  } else if constexpr (std::same_as<Value, bool>) {
    return {value};
  } else if constexpr (std::integral<Value>) {
    return {static_cast<std::int64_t>(value)};
  } else if constexpr (std::floating_point<Value>) {
    return {static_cast<double>(value)};
  } else if constexpr (std::convertible_to<Value, std::string_view>) {
    return {std::string(value)};
  } else if constexpr (std::is_enum_v<Value>) {
    return {std::string(to_string(value))};
  } else if constexpr (ResultStruct<Value>) {
    return {result_record(value)};
  } else if constexpr (requires { typename Value::mapped_type; }) {
    ResultNames names;
    for (const auto& [name, of_it] : value) names.emplace_back(name, result_value(of_it));
    return {std::move(names)};
  } else {
    ResultList list;
    for (const auto& item : value) list.push_back(result_value(item));
    return {std::move(list)};
  }
}

}  // namespace detail

/// What reports say of a struct, declared once, as `OptionFields` are: its function `fields` gives
/// each figure its name, its unit and a line of help.
///
///     struct Fit {
///       double error = 0.0;  ///< after alignment [m]
///       std::vector<Step> steps;
///       static ResultFields<Fit> fields() {
///         return ResultFields<Fit>()
///             .figure("error", &Fit::error, "m", "root mean square after alignment")
///             .figure("steps.count", [](const Fit& fit) { return fit.steps.size(); }, "steps")
///             .figure("steps.all", &Fit::steps, "each of them");
///       }
///     };
///
/// All that shows results goes by the fields, and by nothing else: the JSON of a command, its table
/// in the terminal, in CSV and in LaTeX (cairn/program/figures.hpp), and the attributes in Python
/// with their docstrings (apps/python/src/result_attributes.hpp). A figure that is added here is in
/// all of them, with the unit and the rounding that it has here.
///
/// Values are truth values, numbers, texts, enums with `to_string`, structs with `fields`, ranges
/// of these (a list, such as a table's rows), maps by name, and optionals of all of these.
template <class Struct>
class ResultFields {
 public:
  /// A member, or what a function of the struct returns.
  template <std::invocable<const Struct&> Of>
  ResultFields& figure(std::string_view name, Of of, std::string_view unit, std::string_view help) {
    using Value = std::remove_cvref_t<std::invoke_result_t<Of, const Struct&>>;
    fields_.add(
        name, detail::result_type<Value>(), detail::is_optional_value<Value>, unit, help,
        [of](const void* result) {
          return detail::result_value<Value>(std::invoke(of, *static_cast<const Struct*>(result)));
        });
    return *this;
  }
  /// Without a unit: a count, a ratio, a text, a list.
  template <std::invocable<const Struct&> Of>
  ResultFields& figure(std::string_view name, Of of, std::string_view help) {
    return figure(name, of, "", help);
  }

  /// The fields of another struct, a member or what a function returns, under `name`: "total" of
  /// the part "seconds" is "seconds.total". Without a name they stand beside the others. Of an
  /// optional or a pointer without value all of them are missing; a report has null under `name`.
  /// In Python they are under `attribute`.
  template <std::invocable<const Struct&> Of>
  ResultFields& part(std::string_view name, Of of, std::string_view attribute) {
    using Whole = std::remove_cvref_t<std::invoke_result_t<Of, const Struct&>>;
    if constexpr (detail::is_optional_value<Whole>) {
      using Part = std::remove_cvref_t<decltype(*std::declval<Whole>())>;
      fields_.part(
          name, attribute, result_fields<Part>().list(),
          [of](const void* result, const auto& read) {
            const auto& part = std::invoke(of, *static_cast<const Struct*>(result));
            return part ? read(&*part) : ResultValue{NoResult{.of_record = true}};
          },
          true);
    } else {
      fields_.part(
          name, attribute, result_fields<Whole>().list(),
          [of](const void* result, const auto& read) {
            const auto& part = std::invoke(of, *static_cast<const Struct*>(result));
            return read(&part);
          },
          false);
    }
    return *this;
  }
  template <std::invocable<const Struct&> Of>
  ResultFields& part(std::string_view name, Of of) {
    return part(name, of, name);
  }
  template <std::invocable<const Struct&> Of>
  ResultFields& part(Of of) {
    return part("", of, "");
  }

  /// Drops a field of a part, and all that is under its name.
  ResultFields& without(std::string_view name) {
    fields_.drop(name);
    return *this;
  }

  // What follows is of the field before it, or of the one that `at` names -------------------------
  /// A field of a part. Throws `std::logic_error` if there is none.
  ResultFields& at(std::string_view name) {
    fields_.at(name);
    return *this;
  }
  /// What rows and columns for people call it.
  ResultFields& label(std::string_view label) {
    fields_.last().label = label;
    return *this;
  }
  /// How texts round it: "{:.3g}".
  ResultFields& round(std::string_view format) {
    fields_.last().rounding = format;
    return *this;
  }
  /// How CSV does.
  ResultFields& csv(std::string_view format) {
    fields_.last().csv_rounding = format;
    return *this;
  }
  /// Its title in CSV, whatever part it is of.
  ResultFields& column(std::string_view title) {
    fields_.last().column = title;
    return *this;
  }
  /// Its name in Python; of a part, under the part's.
  ResultFields& attribute(std::string_view name) {
    fields_.last().attribute = name;
    return *this;
  }
  /// No row of its own in texts: a sentence says it, or reports alone. Of a part, all of it.
  ResultFields& detail() {
    for (ResultField& field : fields_.added()) field.is_detail = true;
    return *this;
  }
  /// The same of all fields so far: what comes after them has its row.
  ResultFields& details() {
    fields_.details();
    return *this;
  }
  /// Left out of reports where there is no value, instead of null. Of a part, all of it.
  ResultFields& optional() {
    for (ResultField& field : fields_.added()) field.is_optional = true;
    return *this;
  }
  /// It stands before another field, such as one of a part.
  ResultFields& before(std::string_view name) {
    fields_.move_before(name);
    return *this;
  }

  const std::vector<ResultField>& all() const { return fields_.fields(); }
  /// The result as it is reported; valid as long as these fields are.
  ResultRecord values(const Struct& result) const { return fields_.values(&result); }
  const detail::ResultFieldList& list() const { return fields_; }

 private:
  detail::ResultFieldList fields_;
};

}  // namespace cairn
