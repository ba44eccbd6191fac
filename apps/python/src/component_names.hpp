// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include <pybind11/pybind11.h>

#include "cairn/graph/factor_selector.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/types/loss.hpp"

/// Components and types by name, as Python code names them.
namespace cairn::python {

namespace py = pybind11;

/// "cholmod" or "cholmod:ordering=metis" with further options as keyword arguments: booleans,
/// numbers, texts; None stands for the default. Throws `Error` (usage) for other values and for an
/// option that is given twice.
ComponentSpec component_spec(const std::string& text, const py::kwargs& options);

/// The same of a component of this kind, for a function of the module that takes its options beside
/// arguments of its own. An option that it does not have, and that is near to one of these, is
/// refused with that suggestion.
ComponentSpec component_spec(const std::string& text, const py::kwargs& options,
                             std::string_view kind, const char* function);

/// The loss of that name with its options, "cauchy:scale=2"; None: null. The same object for the
/// same text, so that factors that are added one by one share it.
std::shared_ptr<const Loss> loss_of(const py::object& name);

/// The name with options that a loss was made from; None: there is none. Throws `Error` (usage) for
/// one that was not made by `loss_of`.
py::object name_of_loss(const Loss* loss);

/// "all", "loops", or the tag of a factor type. Throws `Error` (usage) for any other text.
FactorSelector selector_of(const std::string& which);

/// The tag of a type: itself, or that of a class such as `cairn.Pose2`. Throws `Error` (usage).
std::string tag_of(const py::object& type);

}  // namespace cairn::python
