// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/report/number_table.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// A recording of an exploration, as `ExplorationRecorder` writes it (docs/recording.md).
struct ExplorationRecording {
  std::string name;                ///< what it calls itself
  std::string header;              ///< its first line: a JSON object
  std::vector<std::string> lines;  ///< all others, in order: each a JSON object
  /// For each motion a row: distance, step, decision, coverage, map_entropy, trajectory_entropy,
  /// kept, loops, collisions; NaN where a line lacks the number.
  NumberTable steps;
  int decisions = 0;
  bool ended = false;  ///< the last line says how: the run was not killed
  bool torn = false;   ///< a last line that was cut short was left out
};

/// Whether the beginning of a file is the first line of such a recording.
CAIRN_API bool is_exploration_recording(std::string_view head);

/// Reads a recording and checks that its arrays can be unpacked. A last line that was cut short is
/// left out. Throws `Error` (input) with `name` and line for what is damaged, and for a recording
/// without a single motion.
CAIRN_API ExplorationRecording read_exploration_recording(std::string_view text,
                                                          const std::string& name);

/// The EXPLORATION of docs/report.md for a page, called `name`. Where it would be larger than
/// `most_bytes`, trees of decisions are left out, and then scans, of all but every second, every
/// fourth … line; a sentence on that is added to `notes`. Curves, map and graph stay whole.
CAIRN_API std::string exploration_json(const ExplorationRecording& recording,
                                       const std::string& name, std::size_t most_bytes,
                                       std::vector<std::string>& notes);

}  // namespace cairn
