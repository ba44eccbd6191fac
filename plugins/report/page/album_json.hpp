// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/report/scene.hpp"

namespace cairn::report {

/// Whether the positions of each iteration of a run are needed: pages play them, plots do not.
enum class Frames { all, none };

/// An `Album` as docs/report.md describes it; may be embedded in a <script>.
std::string album_json(const Album& album, Frames frames);

}  // namespace cairn::report
