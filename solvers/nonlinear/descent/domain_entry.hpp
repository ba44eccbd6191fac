// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "cairn/graph/graph.hpp"

namespace cairn {

/// Where an optimisation may begin instead of at `values`, where some factors with a `Domain` have
/// large residuals (above 50 σ): a point in the plane of a camera or behind it, or as good as at
/// infinity, or elsewhere than most of its images show it. No sequence of small steps that lower
/// chi2 leads back from there, or it leads all else astray first.
///
/// Each such variable that is not held is put where its factors, all other variables being
/// constant, are in their domains and chi2 is least: from the places that each of its factors gives
/// it, by some iterations of Levenberg-Marquardt on this variable alone. It is moved only if that
/// lowers chi2 of its factors. Returns a note, or nothing if `values` are as they were. Takes one
/// evaluation of the factors with a domain where nothing is wrong.
std::string enter_domains(const Graph& graph, const std::vector<bool>& held, Values& values);

}  // namespace cairn
