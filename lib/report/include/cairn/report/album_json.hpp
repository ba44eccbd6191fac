// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/report/scene.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// Whether the positions of each iteration of a run are needed: pages play them, plots do not.
enum class AlbumFrames { all, none };

/// An `Album` as docs/report.md describes it; may be embedded in a <script>.
CAIRN_API std::string album_json(const Album& album, AlbumFrames frames);

}  // namespace cairn
