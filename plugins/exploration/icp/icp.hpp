// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "cairn/plugin/registry.hpp"
#include "cairn/policy/registration.hpp"
#include "scan_matcher_options.hpp"

namespace cairn::icp {

/// The registration `icp`: a `ScanMatcher` on the scans that it was given by pose.
std::unique_ptr<Registration> make_icp(const ScanMatcherOptions& options, Registry& registry);

}  // namespace cairn::icp
