// SPDX-License-Identifier: BSD-3-Clause
#include "explore_recording.hpp"

#include <utility>

#include <fmt/core.h>

#include "album.hpp"
#include "cairn/exploration/recording.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "graph_files.hpp"
#include "picture_files.hpp"

namespace cairn::app {

void add_recording_options(ArgumentParser cli, RunRecordingOptions& options) {
  cli.add_option("--record", options.record,
                 "map, graph, scans and decisions as the run goes on, for cairn view")
      .type_name("FILE");
  cli.add_option("--html", options.page,
                 "the same as a page for the browser, or of a comparison its tables and curves")
      .type_name("PAGE");
}

void check_recording(const RunRecordingOptions& options, Session& session) {
  if (options.record == "-")
    throw Error(ErrorCode::usage, "--record writes to a file, not to standard output; name one");
  check_file(options.record, session);
  if (options.page.empty()) return;
  if (!session.registry().has(Picture::kKind, "html")) {
    throw Error(ErrorCode::plugin,
                "no plugin makes reports here: cairn was built without apps/report/dist and "
                "without npm; leave out --html");
  }
  check_file(options.page, session);
}

RunRecording::RunRecording(const RunRecordingOptions& options, const RecordedRun& run)
    : options_(options), name_(run.name) {
  if (options.record.empty() && options.page.empty()) return;
  ExplorationRecorder::Each each;
  if (!options.page.empty()) each = [this](std::string_view line) { text_ += line; };
  recorder_.emplace(options.record, run, std::move(each));
}

void RunRecording::follow(Exploration& exploration) {
  if (!recorder_) return;
  exploration.decided = [this, before = std::move(exploration.decided)](
                            const Decision& decision, const Situation& situation) {
    if (before) before(decision, situation);
    recorder_->decided(decision, situation);
  };
  exploration.scanned = [this](const ExplorationStep& step, const Situation& situation,
                               const LaserScan& scan) { recorder_->moved(step, situation, scan); };
}

void RunRecording::write(const ExplorationResult& result, Results& results, Session& session) {
  if (!recorder_) return;
  results.add([&] { recorder_->finish(result); });
  results.write(options_.page, [&] { write_page(session); });
}

void RunRecording::write_page(Session& session) const {
  Album album = begin_album(name_, "cairn explore --html");
  album.explorations.push_back(
      exploration_json(read_exploration_recording(text_, name_), name_, kMostOfAPage, album.notes));
  write_picture(album, {"html", {}}, options_.page, session);
}

}  // namespace cairn::app
