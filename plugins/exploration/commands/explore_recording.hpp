// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "cairn/exploration/exploration.hpp"
#include "cairn/exploration/recorder.hpp"
#include "cairn/online/run_server.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/session.hpp"

namespace cairn::app {

/// `--record`, `--html` and `--serve` of `cairn explore`.
struct RunRecordingOptions {
  std::string record, page;
  std::optional<std::int64_t> port;  ///< 0: any that is free

  static OptionFields<RunRecordingOptions> fields();
};
/// Finds out before the run whether both can be written. Throws `Error`.
void check_recording(const RunRecordingOptions& options, Session& session);

/// The recording of a run, and its page, where they are asked for: at the end, or while it goes on.
class RunRecording {
 public:
  RunRecording(const RunRecordingOptions& options, const RecordedRun& run, Session& session);
  RunRecording(const RunRecording&) = delete;
  RunRecording& operator=(const RunRecording&) = delete;

  /// Follows a run that has not begun; `exploration` calls what it has called before as well.
  void follow(Exploration& exploration);
  /// Writes what is asked for with the other results.
  void write(const ExplorationResult& result, Results& results, Session& session);

 private:
  std::string live_page(Session& session) const;
  void note_address(const Session& session) const;
  void write_page(Session& session) const;

  const RunRecordingOptions& options_;
  std::string name_;
  std::string text_;    // for the page
  std::string header_;  // its first line
  std::unique_ptr<RunServer> server_;
  std::optional<ExplorationRecorder> recorder_;
};

}  // namespace cairn::app
