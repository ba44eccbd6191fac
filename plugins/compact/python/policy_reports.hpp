// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pybind11/pybind11.h>

namespace cairn::python {

/// The classes that say what a policy did: MatchProposal, LinkReport, PriorReport, LandmarkReport
/// and PoseReport.
void bind_policy_reports(pybind11::module_& module);

}  // namespace cairn::python
