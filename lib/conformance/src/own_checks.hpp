// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string_view>

#include "cairn/conformance/checker.hpp"

namespace cairn::conformance {

// The groups of each kind that the core and this library know, one file each.
std::span<const Group> variable_groups();
std::span<const Group> factor_groups();
std::span<const Group> loss_groups();
std::span<const Group> linear_solver_groups();
std::span<const Group> optimizer_groups();
std::span<const Group> estimator_groups();
std::span<const Group> initial_guess_groups();
std::span<const Group> format_groups();
std::span<const Group> generator_groups();

/// What holds of every component: its options, and that it can be made.
void check_options(const Subject& subject, std::string_view kind, Checker& check);

}  // namespace cairn::conformance
