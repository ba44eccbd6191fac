// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/exploration/exploration.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// What the first line of a recording says of a run.
struct RecordedRun {
  std::string name;        ///< what to call it, such as the explorer's name
  std::string floor = {};  ///< as it was named, or empty
  /// Components by kind, as they were named: {"explorer", "frontier:length=2"}.
  std::vector<std::pair<std::string, std::string>> parts = {};
  std::uint64_t seed = 1;
  RobotModel robot = {};
};

/// Writes a run as it goes, to a file of JSON lines (docs/recording.md): a line for each motion
/// with poses, entropies, scan, the cells of the map that have changed and what has changed of the
/// graph; a line for each decision with its candidates and its tree; one for the end.
///
/// Each line is given to the system as soon as it is complete, so that what a process had recorded
/// survives its being killed. Two runs of the same command differ in the member "time" alone. The
/// file is written beside its name (`OutputFile`) and gets that name in `finish`; a run that is
/// killed leaves FILE.PID-0.part, which can be read as it is.
///
///     ExplorationRecorder recorder("run.jsonl", {.name = "frontier", .robot = world.robot()});
///     exploration.scanned = [&](const auto& step, const auto& at, const auto& scan) {
///       recorder.moved(step, at, scan);
///     };
///     exploration.decided = [&](const auto& decision, const auto& at) {
///       recorder.decided(decision, at);
///     };
///     recorder.finish(run_exploration(exploration));
class CAIRN_API ExplorationRecorder {
 public:
  /// Receives each line, with its line end, as soon as it is complete.
  using Each = std::function<void(std::string_view line)>;

  /// Opens the file and writes the first line. An empty name: there is no file, and `each` alone
  /// is called. Throws `Error` (input) if the file cannot be written.
  ExplorationRecorder(const std::filesystem::path& file, const RecordedRun& run, Each each = {});
  ExplorationRecorder(const ExplorationRecorder&) = delete;
  ExplorationRecorder& operator=(const ExplorationRecorder&) = delete;
  ~ExplorationRecorder();

  /// To be called by `Exploration::scanned`.
  void moved(const ExplorationStep& step, const Situation& situation, const LaserScan& scan);
  /// To be called by `Exploration::decided`.
  void decided(const Decision& decision, const Situation& situation);
  /// How it ended, and what the last solution has moved. Throws `Error` (input) if something could
  /// not be written (a full disk).
  void finish(const ExplorationResult& result);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cairn
