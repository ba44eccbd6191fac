// SPDX-License-Identifier: BSD-3-Clause
#include "result_attributes.hpp"

#include <algorithm>
#include <cctype>
#include <string>
#include <utility>

#include <fmt/core.h>

namespace cairn::python {
namespace {

struct ToPython {
  py::object operator()(NoResult) const { return py::none(); }
  py::object operator()(bool value) const { return py::bool_(value); }
  py::object operator()(std::int64_t value) const { return py::int_(value); }
  py::object operator()(double value) const { return py::float_(value); }
  py::object operator()(const std::string& value) const { return py::str(value); }
  py::object operator()(const ResultRecord& record) const {
    py::dict all;
    for (std::size_t k = 0; k < record.values.size(); ++k)
      put(all, (*record.fields)[k].name, std::visit(*this, record.values[k].data));
    return all;
  }
  py::object operator()(const ResultList& list) const {
    py::list all;
    for (const ResultValue& value : list) all.append(std::visit(*this, value.data));
    return all;
  }
  py::object operator()(const ResultNames& names) const {
    py::dict all;
    for (const auto& [name, value] : names) all[py::str(name)] = std::visit(*this, value.data);
    return all;
  }

  /// "chi2.final" as the member "final" of the dict "chi2".
  static void put(py::dict within, std::string_view name, const py::object& value) {
    for (std::size_t dot; (dot = name.find('.')) != std::string_view::npos;) {
      const py::str member(name.data(), dot);
      if (!within.contains(member)) within[member] = py::dict();
      within = within[member];
      name.remove_prefix(dot + 1);
    }
    within[py::str(name.data(), name.size())] = value;
  }
};

/// One attribute, of one field or of several that are in a dict.
struct Attribute {
  std::string name;
  struct Member {
    std::size_t field;
    std::string name;  ///< in the dict; empty: the field is the attribute
  };
  std::vector<Member> members;

  bool is_dict() const { return !members.front().name.empty(); }
};

std::vector<Attribute> attributes_of(const std::vector<ResultField>& fields) {
  std::vector<Attribute> all;
  for (std::size_t k = 0; k < fields.size(); ++k) {
    const std::string& path = fields[k].attribute.empty() ? fields[k].name : fields[k].attribute;
    const std::size_t dot = path.find('.');
    const std::string name = path.substr(0, dot);
    auto at = std::find_if(all.begin(), all.end(),
                           [&](const Attribute& attribute) { return attribute.name == name; });
    if (at == all.end()) at = all.insert(all.end(), {name, {}});
    at->members.push_back({k, dot == std::string::npos ? "" : path.substr(dot + 1)});
  }
  return all;
}

/// "absolute, after alignment [m]"
std::string with_unit(const ResultField& field) {
  return field.unit.empty() ? field.help : fmt::format("{} [{}]", field.help, field.unit);
}

std::string docstring(const Attribute& attribute, const std::vector<ResultField>& fields) {
  if (!attribute.is_dict()) {
    std::string text = with_unit(fields[attribute.members.front().field]) + ".";
    text.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(text.front())));
    return text;
  }
  std::string text = "A dict:";
  for (const Attribute::Member& member : attribute.members)
    text += fmt::format("\n{}: {}", member.name, with_unit(fields[member.field]));
  return text;
}

/// What a type stub calls it.
std::string type_name(const ResultField& field) {
  const auto name = [&]() -> std::string {
    switch (field.type) {
      case ResultType::boolean:
        return "bool";
      case ResultType::integer:
        return "int";
      case ResultType::real:
        return "float";
      case ResultType::text:
        return "str";
      case ResultType::list:
        return "List[Any]";
      case ResultType::record:
      case ResultType::names:
        return "Dict[str, Any]";
    }
    return "Any";
  }();
  return field.may_be_missing ? "Optional[" + name + "]" : name;
}

std::string type_name(const Attribute& attribute, const std::vector<ResultField>& fields) {
  const std::string first = type_name(fields[attribute.members.front().field]);
  if (!attribute.is_dict()) return first;
  for (const Attribute::Member& member : attribute.members)
    if (member.name.find('.') != std::string::npos || type_name(fields[member.field]) != first)
      return "Dict[str, Any]";
  return fmt::format("Dict[str, {}]", first);
}

}  // namespace

py::object dict_of(const ResultRecord& record) { return ToPython()(record); }

void add_attributes(const py::object& type, const std::vector<ResultField>& fields,
                    const std::function<ResultValue(py::handle self, std::size_t field)>& value) {
  const py::object property = py::module_::import("builtins").attr("property");
  py::dict types;  // tests/python/test_results.py compares the stubs with them
  for (const Attribute& attribute : attributes_of(fields)) {
    if (type.attr("__dict__").contains(attribute.name)) continue;
    const auto get = [attribute, value](const py::object& self) -> py::object {
      if (!attribute.is_dict())
        return std::visit(ToPython(), value(self, attribute.members.front().field).data);
      py::dict all;
      for (const Attribute::Member& member : attribute.members)
        ToPython::put(all, member.name, std::visit(ToPython(), value(self, member.field).data));
      return all;
    };
    type.attr(attribute.name.c_str()) =
        property(py::cpp_function(get), py::none(), py::none(), docstring(attribute, fields));
    types[py::str(attribute.name)] = type_name(attribute, fields);
  }
  type.attr("_result_types") = types;
}

}  // namespace cairn::python
