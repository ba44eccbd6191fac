// SPDX-License-Identifier: BSD-3-Clause
#include "component_names.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/text/spelling.hpp"
#include "ids.hpp"

namespace cairn::python {
namespace {

/// Losses by the names that they were made from. Under the interpreter's lock, as all that has
/// Python objects.
std::map<std::string, std::weak_ptr<const Loss>>& made_losses() {
  static std::map<std::string, std::weak_ptr<const Loss>> losses;
  return losses;
}

std::string text_of(const std::string& name, const py::handle& value) {
  if (py::isinstance<py::bool_>(value)) return option_text(value.cast<bool>());
  if (py::isinstance<py::str>(value)) return value.cast<std::string>();
  if (PyIndex_Check(value.ptr()) != 0) return option_text(value.cast<std::int64_t>());
  if (PyNumber_Check(value.ptr()) != 0) return option_text(value.cast<double>());
  throw Error(ErrorCode::usage,
              fmt::format("option '{}': a {} is neither a number nor a text", name,
                          py::type::of(value).attr("__name__").cast<std::string>()));
}

/// The names of a function's arguments, from the signature that pybind11 writes into its docstring:
/// "optimize(graph: cairn.Graph, optimizer: str = 'levenberg_marquardt', **kwargs) -> …".
std::vector<std::string> argument_names(const char* function) {
  py::object named = py::module_::import("cairn._cairn").attr(function);
  if (py::isinstance<py::type>(named)) named = named.attr("__init__");
  const auto text = named.attr("__doc__").cast<std::string>();
  const std::string_view signature = std::string_view(text).substr(0, text.find('\n'));
  std::vector<std::string> names;
  for (std::size_t end = signature.find(": "); end != std::string_view::npos;
       end = signature.find(": ", end + 1)) {
    const std::size_t begin = signature.find_last_of(" (", end - 1) + 1;
    names.emplace_back(signature.substr(begin, end - begin));
  }
  return names;
}

/// "arguments: a, b; options: c, d"
std::string what_there_is(const std::vector<std::string>& arguments, const OptionTable& table) {
  std::vector<std::string> options;
  for (const OptionSpec& option : table.specs()) options.push_back(option.name);
  return fmt::format("arguments: {}; {}", fmt::join(arguments, ", "),
                     options.empty() ? "it has no options"
                                     : fmt::format("its options: {}", fmt::join(options, ", ")));
}

/// Refuses an option that the component does not have, unless it is near to one of its own.
void check_names(const std::string& component, const py::kwargs& options, std::string_view kind,
                 const char* function) {
  const OptionTable table = default_registry().options(kind, component);
  const std::vector<std::string> arguments = argument_names(function);
  std::vector<std::string> all = arguments;
  for (const OptionSpec& option : table.specs()) all.push_back(option.name);
  for (const auto& [key, value] : options) {
    const auto name = key.cast<std::string>();
    if (table.find(name)) continue;
    const std::string nearest = nearest_spelling(name, all);
    const bool is_argument = std::ranges::find(arguments, nearest) != arguments.end();
    if (!nearest.empty() && !is_argument) continue;  // the component says so itself
    throw Error(ErrorCode::usage,
                fmt::format("{} has no argument '{}', nor has {} such an option; {}", function,
                            name, component,
                            is_argument ? fmt::format("did you mean '{}'?", nearest)
                                        : what_there_is(arguments, table)));
  }
}

std::string name_of(const py::object& type) { return type.attr("__name__").cast<std::string>(); }

/// "'a', 'b' or 'c'"
std::string either(const std::vector<std::string>& tags) {
  std::string text;
  for (std::size_t k = 0; k < tags.size(); ++k) {
    if (k > 0) text += k + 1 < tags.size() ? ", " : " or ";
    text += "'" + tags[k] + "'";
  }
  return text;
}

}  // namespace

ComponentSpec component_spec(const std::string& text, const py::kwargs& options,
                             std::string_view kind, const char* function) {
  if (!options.empty()) check_names(parse_component(text).name, options, kind, function);
  return component_spec(text, options);
}

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
  std::weak_ptr<const Loss>& known = made_losses()[name.cast<std::string>()];
  std::shared_ptr<const Loss> loss = known.lock();
  if (!loss) known = loss = default_registry().make<Loss>(name.cast<std::string>());
  return loss;
}

py::object name_of_loss(const Loss* loss) {
  if (!loss) return py::none();
  for (const auto& [name, made] : made_losses()) {
    if (made.lock().get() == loss) return py::str(name);
  }
  throw Error(ErrorCode::usage,
              "a graph cannot be pickled whose losses were not given by name: give them with "
              "set_loss");
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
  if (py::hasattr(type, "tag")) {
    const py::object tag = type.attr("tag");  // a property, of classes of measurements
    if (py::isinstance<py::str>(tag)) return tag.cast<std::string>();
  }
  const std::vector<std::string> tags = tags_of_class(type);
  if (tags.size() == 1) return tags.front();
  if (!tags.empty()) {
    throw Error(ErrorCode::usage, fmt::format("a {} is of one of several types: give the tag, {}",
                                              name_of(type), either(tags)));
  }
  throw Error(ErrorCode::usage,
              "a type is given by its tag, such as 'VERTEX_SE2' or 'EDGE_SE2', or by a class such "
              "as cairn.Pose2 or cairn.Between");
}

}  // namespace cairn::python
