// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "cairn/plugin/options.hpp"
#include "cairn/policy/registration.hpp"

namespace cairn::registration {

OptionTable recorded_options();
std::unique_ptr<Registration> make_recorded(const Options& options);

OptionTable simulated_options();
std::unique_ptr<Registration> make_simulated(const Options& options);

}  // namespace cairn::registration
