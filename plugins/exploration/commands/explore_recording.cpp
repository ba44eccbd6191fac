// SPDX-License-Identifier: BSD-3-Clause
#include "explore_recording.hpp"

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/core.h>

#include "cairn/exploration/recording.hpp"
#include "cairn/io/packed_array.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/album.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/picture_files.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::app {

OptionFields<RunRecordingOptions> RunRecordingOptions::fields() {
  using O = RunRecordingOptions;
  return OptionFields<O>()
      .text("record", &O::record,
            "map, graph, scans and decisions as the run goes on, for cairn view")
      .placeholder("FILE")
      .text("html", &O::page,
            "the same as a page for the browser, or of a comparison its tables and curves")
      .placeholder("PAGE")
      .integer("serve", &O::port, 0, 65535,
               "show it while the run goes on, to browsers on this machine: "
               "http://127.0.0.1:PORT/; 0: any port that is free")
      .placeholder("PORT");
}

void check_recording(const RunRecordingOptions& options, Session& session) {
  if (options.record == "-")
    throw Error(ErrorCode::usage, "--record writes to a file, not to standard output; name one");
  check_file(options.record, session);
  if (options.page.empty() && !options.port) return;
  check_makes_pages(fmt::format("leave out {}", options.page.empty() ? "--serve" : "--html"),
                    session);
  if (!options.page.empty()) check_file(options.page, session);
}

RunRecording::RunRecording(const RunRecordingOptions& options, const RecordedRun& run,
                           Session& session)
    : options_(options), name_(run.name) {
  if (options.record.empty() && options.page.empty() && !options.port) return;
  if (options.port)
    server_ = std::make_unique<RunServer>(static_cast<std::uint16_t>(*options_.port));
  ExplorationRecorder::Each each;
  if (!options.page.empty() || options.port) {
    each = [this](std::string_view line) {
      if (header_.empty()) header_ = line;
      if (!options_.page.empty()) text_ += line;
      if (server_) server_->add(line);
    };
  }
  recorder_.emplace(options.record, run, std::move(each));
  if (!server_) return;
  server_->show(live_page(session));
  note_address(session);
}

/// The page that `cairn view` makes, which asks for the lines of the run instead of having them.
std::string RunRecording::live_page(Session& session) const {
  Album album = begin_album(name_, "cairn explore --serve");
  album.explorations.push_back(
      fmt::format(R"({{"name":{},"complete":false,"header":{},"lines":[],"live":"lines"}})",
                  json_string(name_), header_.substr(0, header_.find('\n'))));
  std::string page = draw_picture(album, {"html", {}}, session);
  // The policy of a page in a file allows no requests; this one requests lines from its server.
  constexpr std::string_view kPolicy = "Content-Security-Policy\" content=\"";
  const std::size_t at = page.find(kPolicy);
  if (at != std::string::npos) page.insert(at + kPolicy.size(), "connect-src 'self'; ");
  return page;
}

void RunRecording::note_address(const Session& session) const {
  const std::string address = fmt::format("http://127.0.0.1:{}/", server_->port());
  // A port that was not named is known from here alone: it is a result.
  if (session.common.quiet && *options_.port == 0)
    fmt::print(stderr, "{}\n", address);
  else
    session.note("follow the run at " + address);
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
  results.add([&] {
    recorder_->finish(result);
    if (server_) server_->finish();
  });
  results.write(options_.page, [&] { write_page(session); });
}

void RunRecording::write_page(Session& session) const {
  Album album = begin_album(name_, "cairn explore --html");
  album.explorations.push_back(
      exploration_json(read_exploration_recording(text_, name_), name_, kMostOfAPage, album.notes));
  write_picture(album, {"html", {}}, options_.page, session);
}

}  // namespace cairn::app
