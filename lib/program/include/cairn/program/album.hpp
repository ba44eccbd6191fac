// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cairn/program/graph_files.hpp"
#include "cairn/program/session.hpp"
#include "cairn/report/album_builder.hpp"
#include "cairn/report/scene.hpp"

namespace cairn::app {

/// What `view` and `plot` show.
struct AlbumOptions {
  std::vector<std::string> files;
  std::vector<std::string> names;  ///< of the estimates, in the order of the files
  std::string truth;
  std::string initial;  ///< a name of kind initial_guess, or empty
  std::string title;
  std::string axes;  ///< of trajectories, robot or camera; empty: by their format
  InputOptions input;
  bool apart = false;   ///< each graph by itself, also one with the ids of another
  bool curves = false;  ///< of recordings of explorations the curves alone, as tables
  bool maps = false;    ///< recordings of explorations whole, also with `curves`

  /// Of commands that show them; `what` says what FILE may be.
  static OptionFields<AlbumOptions> fields(const char* what);
};

/// Of a recording of an exploration [bytes], so that a page is below 15 MB.
inline constexpr std::size_t kMostOfAPage = 13'000'000;

/// Whether a file is read as a table by its name, unless it is a trajectory.
bool is_csv(const std::string& file);
/// Whether it has columns to plot: as `is_csv`, or what a `SceneSource` knows.
bool has_columns(const std::string& file, Registry& registry);

/// Reads the files (graphs, trajectories, recordings, the JSON of runs, CSV) and lays together what
/// belongs together, as `AlbumBuilder` does. Throws `Error` for files that cannot be read.
Album load_album(const AlbumOptions& options, const std::string& command, Session& session);

/// Title, time, machine and build of an `Album` that `command` makes.
Album begin_album(const std::string& title, const std::string& command);

}  // namespace cairn::app
