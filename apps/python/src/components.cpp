// SPDX-License-Identifier: BSD-3-Clause
// What can be chosen by name.
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "bindings.hpp"
#include "cairn/plugin/plugin_search.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "component_names.hpp"

namespace cairn::python {
namespace {

const char* type_text(OptionType type) {
  switch (type) {
    case OptionType::boolean:
      return "boolean";
    case OptionType::integer:
      return "integer";
    case OptionType::real:
      return "real";
    case OptionType::choice:
      return "choice";
    case OptionType::component:
      return "component";
    case OptionType::text:
      break;
  }
  return "text";
}

/// Types have no options; what makes them, kind "types", has.
bool has_options(const Offer& offer) { return offer.kind != "variable" && offer.kind != "factor"; }

std::vector<OptionSpec> options_of(const Offer& offer) {
  if (!has_options(offer)) return {};
  const py::gil_scoped_release unlocked;
  return default_registry().options(offer.kind, offer.name).specs();
}

std::vector<std::string> kinds() {
  std::vector<std::string> all;
  for (const Offer& offer : default_registry().offers()) {
    if (all.empty() || all.back() != offer.kind) all.push_back(offer.kind);
  }
  return all;
}

std::map<std::string, Offer> components(const std::string& kind) {
  std::map<std::string, Offer> all;
  std::string there;
  for (Offer& offer : default_registry().offers()) {
    if (offer.kind == kind) all.emplace(offer.name, std::move(offer));
  }
  if (!all.empty()) return all;
  for (const std::string& other : kinds()) there += (there.empty() ? "" : ", ") + other;
  std::string text = fmt::format("nothing of kind '{}' is on offer; kinds: {}", kind,
                                 there.empty() ? "none, since no plugin was found" : there);
  if (there.empty()) {  // the problems name the folders of the search
    for (const PluginProblem& problem : default_registry().problems())
      text += fmt::format("\n  note: {}", problem.message);
  }
  throw Error(ErrorCode::usage, text);
}

}  // namespace

void bind_components(py::module_& module) {
  py::class_<OptionSpec>(module, "Option", "An option of a component.")
      .def_readonly("name", &OptionSpec::name)
      .def_property_readonly(
          "type", [](const OptionSpec& spec) { return type_text(spec.type); },
          "'boolean', 'integer', 'real', 'text', 'choice' or 'component'.")
      .def_readonly("default", &OptionSpec::default_value, "As a text.")
      .def_readonly("help", &OptionSpec::help, "What it is for, with its unit.")
      .def_readonly("minimum", &OptionSpec::minimum)
      .def_readonly("maximum", &OptionSpec::maximum)
      .def_readonly("choices", &OptionSpec::choices,
                    "What a choice may be; of a component its kind.")
      .def("__repr__", [](const OptionSpec& spec) {
        return fmt::format("<cairn.Option {}={}: {}>", spec.name, spec.default_value, spec.help);
      });
  py::class_<Offer>(module, "Component", "Something that can be chosen by name.")
      .def_readonly("kind", &Offer::kind)
      .def_readonly("name", &Offer::name)
      .def_readonly("summary", &Offer::summary, "One line.")
      .def_readonly("plugin", &Offer::plugin, "Name of the plugin that it is from.")
      .def_readonly("licence", &Offer::licence, "Of the plugin.")
      .def_property_readonly("options", &options_of,
                             "Its options, a list of Option; asking loads its plugin.")
      .def("__repr__", [](const Offer& offer) {
        return fmt::format("<cairn.Component {} '{}': {}>", offer.kind, offer.name, offer.summary);
      });
  module.def("kinds", &kinds, "The kinds of components: 'optimizer', 'linear_solver', …");
  module.def("components", &components, py::arg("kind"),
             "All components of a kind by name, such as components('optimizer').");
  module.def(
      "spec",
      [](const std::string& name, const py::kwargs& options) {
        return to_text(component_spec(name, options));
      },
      py::arg("name"),
      "A component with its options as one text: spec('cholmod', ordering='metis') is "
      "'cholmod:ordering=metis', for options that name components.");
}

}  // namespace cairn::python
