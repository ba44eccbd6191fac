// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <boost/json/array.hpp>
#include <boost/json/object.hpp>

#include "cairn/program/table.hpp"
#include "cairn/runtime/result_fields.hpp"

// What commands write of a result, from its fields alone (cairn/runtime/result_fields.hpp): JSON,
// text, CSV and LaTeX.

namespace cairn::app {

/// Adds every field to a report, "loops.kept" as the member "kept" of "loops".
void put(boost::json::object& report, const ResultRecord& result);
template <ResultStruct Struct>
void put(boost::json::object& report, const Struct& result) {
  put(report, result_record(result));
}
/// The same in an object, or in an array of them.
boost::json::object to_json(const ResultRecord& result);
template <ResultStruct Struct>
boost::json::object to_json(const Struct& result) {
  return to_json(result_record(result));
}
template <ResultStruct Struct>
boost::json::array to_json(const std::vector<Struct>& results) {
  boost::json::array all;
  for (const Struct& result : results) all.push_back(to_json(result));
  return all;
}

/// What a column for people is called: "driven [m]".
std::string title_of(const ResultField& field);

/// A result in texts for people: each figure rounded and with its unit, as its field says.
///
///     const Figures figures(error);
///     table.add({"lost", "KLD " + figures["kld"] + " of the whole"});
///     figures.add_rows(table);  // what no sentence says
class Figures {
 public:
  /// Numbers have as many significant digits as their fields say, or `digits`.
  template <ResultStruct Struct>
  explicit Figures(const Struct& result, int digits = 0)
      : result_(result_record(result)), digits_(digits) {}

  /// "4.32 nats", "12.3 ms", "-" where there is no value. Throws `std::logic_error` if no field has
  /// this name.
  std::string operator[](std::string_view name) const;
  /// The same without its unit.
  std::string number(std::string_view name) const;
  /// The times of a part: "1.2 s (linearize 0.4 s, solve 0.8 s)", the total and what it consists
  /// of: all others of the part but these.
  std::string times(std::string_view part, std::initializer_list<std::string_view> but = {}) const;
  /// A part that is `StepTimes`: "1000: median 12.3 µs, 95 % …, 99 % …, longest …".
  std::string steps(std::string_view part) const;
  /// A row for each that is no detail and has a value.
  void add_rows(Table& table) const;
  /// All single figures, rounded, one below the other: what `--latex` writes.
  Table table() const;
  /// All single figures in two lines: what `--csv` writes.
  std::string csv() const;

 private:
  std::string text(std::size_t field) const;
  /// "median 12.3 µs, longest 1.2 ms": those of a part but for some.
  std::string listed(std::string_view part, std::span<const std::string_view> but) const;

  ResultRecord result_;
  int digits_;
};

/// A table in CSV: a column for each field that is a single value, a line for each result. What is
/// missing, or is no finite number, is an empty field; truth values are 1 and 0.
class CsvText {
 public:
  /// How numbers are written that have no rounding of their own.
  enum class Numbers {
    rounded,  ///< nine significant digits, of seconds nine decimals
    whole     ///< as short as they are read back without loss
  };
  explicit CsvText(const std::vector<ResultField>& fields, Numbers numbers = Numbers::rounded,
                   std::string_view line_end = "\n");
  void add(const ResultRecord& result);
  const std::string& text() const { return text_; }

 private:
  Numbers numbers_;
  std::string_view line_end_;
  std::string text_;
};

/// The same of a range of results.
template <ResultStruct Struct, class Results>
std::string csv_of(const Results& results) {
  CsvText csv(result_fields<Struct>().all());
  for (const Struct& result : results) csv.add(result_record(result));
  return csv.text();
}

}  // namespace cairn::app
