// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/figures.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "cairn/program/json_report.hpp"
#include "cairn/report/number_table.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

// JSON --------------------------------------------------------------------------------------------

struct ToJson {
  json::value operator()(NoResult) const { return nullptr; }
  json::value operator()(bool value) const { return value; }
  json::value operator()(std::int64_t value) const { return value; }
  json::value operator()(double value) const { return number_json(value); }
  json::value operator()(const std::string& value) const { return json::value(value); }
  json::value operator()(const ResultRecord& record) const { return to_json(record); }
  json::value operator()(const ResultList& list) const {
    json::array array;
    for (const ResultValue& value : list) array.push_back(std::visit(*this, value.data));
    return array;
  }
  json::value operator()(const ResultNames& names) const {
    json::object object;
    for (const auto& [name, value] : names) object[name] = std::visit(*this, value.data);
    return object;
  }
};

/// The member that a name with dots stands for, made if need be.
json::value& member(json::object& report, std::string_view name) {
  json::object* within = &report;
  for (std::size_t dot; (dot = name.find('.')) != std::string_view::npos;) {
    json::value& next = (*within)[name.substr(0, dot)];
    within = next.is_object() ? &next.as_object() : &next.emplace_object();
    name.remove_prefix(dot + 1);
  }
  return (*within)[name];
}

// Text --------------------------------------------------------------------------------------------

bool is_single(const ResultField& field) { return field.type < ResultType::record; }

std::string in_words(std::string name) {
  std::ranges::replace_if(
      name, [](char c) { return c == '.' || c == '_'; }, ' ');
  return name;
}

std::string label_of(const ResultField& field) {
  return field.label.empty() ? in_words(field.name) : field.label;
}

std::string with_unit(const ResultField& field, std::string number) {
  return field.unit.empty() ? number : number + " " + field.unit;
}

struct ToText {
  const ResultField& field;
  int digits;

  std::string operator()(bool value) const { return value ? "yes" : "no"; }
  std::string operator()(std::int64_t value) const {
    if (field.unit == "bytes") return bytes_text(value);
    return with_unit(field, fmt::format("{}", value));
  }
  std::string operator()(double value) const {
    if (!std::isfinite(value)) return "-";
    if (digits > 0) return with_unit(field, fmt::format("{:.{}g}", value, digits));
    if (!field.rounding.empty())
      return with_unit(field, fmt::format(fmt::runtime(field.rounding), value));
    if (field.unit == "s") return seconds_text(value);
    return with_unit(field, fmt::format("{:.4g}", value));
  }
  std::string operator()(const std::string& value) const { return value; }
  std::string operator()(const auto&) const { return "-"; }
};

// CSV ---------------------------------------------------------------------------------------------

struct ToCsv {
  const ResultField& field;
  CsvText::Numbers numbers;

  std::string operator()(bool value) const { return value ? "1" : "0"; }
  std::string operator()(std::int64_t value) const { return fmt::format("{}", value); }
  std::string operator()(double value) const {
    if (!std::isfinite(value)) return "";
    const char* const usual = numbers == CsvText::Numbers::whole ? "{}"
                              : field.unit == "s"                ? "{:.9f}"
                                                                 : "{:.9g}";
    const std::string& own = field.csv_rounding;
    return fmt::format(fmt::runtime(own.empty() ? usual : own), value);
  }
  std::string operator()(const std::string& value) const { return csv_field(value); }
  std::string operator()(const auto&) const { return ""; }
};

std::string column_of(const ResultField& field) {
  std::string column = field.column.empty() ? field.name : field.column;
  std::ranges::replace(column, '.', '_');
  return column;
}

}  // namespace

void put(json::object& report, const ResultRecord& result) {
  for (std::size_t k = 0; k < result.values.size(); ++k) {
    const ResultField& field = (*result.fields)[k];
    const ResultValue& value = result.values[k];
    const NoResult* const nothing = std::get_if<NoResult>(&value.data);
    if (nothing && field.is_optional) continue;
    const bool whole = nothing && nothing->of_record && !field.record.empty();
    member(report, whole ? field.record : field.name) = std::visit(ToJson(), value.data);
  }
}

json::object to_json(const ResultRecord& result) {
  json::object object;
  put(object, result);
  return object;
}

std::string title_of(const ResultField& field) {
  return field.unit.empty() ? label_of(field) : fmt::format("{} [{}]", label_of(field), field.unit);
}

std::string Figures::text(std::size_t field) const {
  return std::visit(ToText{(*result_.fields)[field], digits_}, result_.values[field].data);
}

std::string Figures::operator[](std::string_view name) const { return text(result_.find(name)); }

std::string Figures::number(std::string_view name) const {
  std::string text = (*this)[name];
  const ResultField& field = (*result_.fields)[result_.find(name)];
  if (!field.unit.empty() && text.ends_with(" " + field.unit))
    text.resize(text.size() - field.unit.size() - 1);
  return text;
}

std::string Figures::listed(std::string_view part, std::span<const std::string_view> but) const {
  const std::string prefix = std::string(part) + ".";
  std::string list;
  for (std::size_t k = 0; k < result_.values.size(); ++k) {
    const ResultField& field = (*result_.fields)[k];
    if (!field.name.starts_with(prefix)) continue;
    const std::string name = field.name.substr(prefix.size());
    if (std::ranges::find(but, name) != but.end()) continue;
    const std::string label = field.label.empty() ? in_words(name) : field.label;
    list += (list.empty() ? "" : ", ") + label + " " + text(k);
  }
  return list;
}

std::string Figures::times(std::string_view part,
                           std::initializer_list<std::string_view> but) const {
  std::vector<std::string_view> others(but);
  others.emplace_back("total");
  return fmt::format("{} ({})", (*this)[std::string(part) + ".total"], listed(part, others));
}

std::string Figures::steps(std::string_view part) const {
  constexpr std::string_view kCount[] = {"count"};
  return fmt::format("{}: {}", (*this)[std::string(part) + ".count"], listed(part, kCount));
}

void Figures::add_rows(Table& table) const {
  for (std::size_t k = 0; k < result_.values.size(); ++k) {
    const ResultField& field = (*result_.fields)[k];
    if (!field.is_detail && !result_.values[k].is_missing()) table.add({label_of(field), text(k)});
  }
}

Table Figures::table() const {
  Table table({{"figure", Table::Align::left}, {"value", Table::Align::right}});
  for (std::size_t k = 0; k < result_.values.size(); ++k) {
    const ResultField& field = (*result_.fields)[k];
    if (is_single(field) && !result_.values[k].is_missing()) table.add({label_of(field), text(k)});
  }
  return table;
}

std::string Figures::csv() const {
  CsvText csv(*result_.fields);
  csv.add(result_);
  return csv.text();
}

CsvText::CsvText(const std::vector<ResultField>& fields, Numbers numbers, std::string_view line_end)
    : numbers_(numbers), line_end_(line_end) {
  std::vector<std::string> columns;
  for (const ResultField& field : fields)
    if (is_single(field)) columns.push_back(column_of(field));
  text_ = joined(columns, ",") + std::string(line_end);
}

void CsvText::add(const ResultRecord& result) {
  bool first = true;
  for (std::size_t k = 0; k < result.values.size(); ++k) {
    const ResultField& field = (*result.fields)[k];
    if (!is_single(field)) continue;
    if (!std::exchange(first, false)) text_ += ",";
    text_ += std::visit(ToCsv{field, numbers_}, result.values[k].data);
  }
  text_ += line_end_;
}

}  // namespace cairn::app
