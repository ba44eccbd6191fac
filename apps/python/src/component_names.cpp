// SPDX-License-Identifier: BSD-3-Clause
#include "component_names.hpp"

#include <cstdint>
#include <map>

#include <fmt/format.h>

#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::python {
namespace {

std::string text_of(const std::string& name, const py::handle& value) {
  if (py::isinstance<py::bool_>(value)) return option_text(value.cast<bool>());
  if (py::isinstance<py::str>(value)) return value.cast<std::string>();
  if (PyIndex_Check(value.ptr()) != 0) return option_text(value.cast<std::int64_t>());
  if (PyNumber_Check(value.ptr()) != 0) return option_text(value.cast<double>());
  throw Error(ErrorCode::usage,
              fmt::format("option '{}': a {} is neither a number nor a text", name,
                          py::type::of(value).attr("__name__").cast<std::string>()));
}

}  // namespace

ComponentSpec component_spec(const std::string& text, const py::kwargs& options) {
  ComponentSpec spec = parse_component(text);
  for (const auto& [key, value] : options) {
    if (value.is_none()) continue;
    const auto name = key.cast<std::string>();
    if (!spec.values.emplace(name, text_of(name, value)).second) {
      throw Error(
          ErrorCode::usage,
          fmt::format("option '{}' is given twice: in '{}' and as an argument", name, text));
    }
  }
  return spec;
}

std::shared_ptr<const Loss> loss_of(const py::object& name) {
  if (name.is_none()) return nullptr;
  if (!py::isinstance<py::str>(name)) {
    throw Error(ErrorCode::usage,
                "a loss is given by its name and options, such as 'cauchy:scale=2'");
  }
  // Under the interpreter's lock, as all that has Python objects.
  static std::map<std::string, std::weak_ptr<const Loss>> losses;
  std::weak_ptr<const Loss>& known = losses[name.cast<std::string>()];
  std::shared_ptr<const Loss> loss = known.lock();
  if (!loss) known = loss = default_registry().make<Loss>(name.cast<std::string>());
  return loss;
}

FactorSelector selector_of(const std::string& which) {
  FactorSelector selector = FactorSelector::parse(which);
  const Registry& registry = default_registry();
  if (selector.kind() == FactorSelector::Kind::tag && !registry.has("factor", selector.tag())) {
    throw Error(ErrorCode::usage,
                fmt::format("'{}' is neither 'all', 'loops' nor a type of factors, such as {}",
                            which, fmt::join(registry.names("factor"), ", ")));
  }
  return selector;
}

std::string tag_of(const py::object& type) {
  if (py::isinstance<py::str>(type)) return type.cast<std::string>();
  if (py::hasattr(type, "tag")) return type.attr("tag").cast<std::string>();
  throw Error(
      ErrorCode::usage,
      "a type is given by its tag, such as 'VERTEX_SE2', or by a class such as cairn.Pose2");
}

}  // namespace cairn::python
