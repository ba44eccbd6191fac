// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <CLI/App.hpp>

#include "cairn/report/scene.hpp"
#include "graph_files.hpp"
#include "session.hpp"

namespace cairn::app {

/// What `view` and `plot` show.
struct AlbumOptions {
  std::vector<std::string> files;
  std::vector<std::string> names;  ///< of the estimates, in the order of the files
  std::string truth;
  std::string initial;  ///< a name of kind initial_guess, or empty
  std::string title;
  InputOptions input;
};
void add_album_options(CLI::App& command, AlbumOptions& options);

/// Reads the files and lays together what belongs together:
///
/// - graphs with the same ids over the first of them; the one with the lowest chi2 is the estimate,
///   the first file otherwise the initial guess, all others peers;
/// - files without factors (trajectories) over the last graph that has their ids, the first of them
///   as ground truth;
/// - recordings and the JSON of runs with their graph, which is read where it is still there.
///
/// Everything else stands by itself. Throws `Error` for files that cannot be read.
Album load_album(const AlbumOptions& options, const std::string& command, Session& session);

/// Title, time, machine and build of an `Album` that `command` makes.
Album begin_album(const std::string& title, const std::string& command);

/// "sphere.g2o" of "maps/sphere.g2o"; a generator's name as it is.
std::string short_name(const std::string& file);

}  // namespace cairn::app
