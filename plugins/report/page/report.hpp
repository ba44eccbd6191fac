// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "cairn/report/scene.hpp"

namespace cairn::report {

/// The data of the HTML report for an `Album`, as docs/report.md describes it; may be embedded in a
/// <script>.
std::string page_json(const Album& album);

/// Puts the data into the page. Throws `Error` (plugin) if `page` has not exactly one place for it.
std::string fill(std::string_view page, std::string_view data);

}  // namespace cairn::report
