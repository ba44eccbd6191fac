// SPDX-License-Identifier: BSD-3-Clause
#include "mission.hpp"

#include <sys/wait.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <thread>
#include <utility>

namespace cairn::soak {
namespace {

namespace fs = std::filesystem;

constexpr int kOutputError = 3, kInterrupted = 130;
constexpr std::uint64_t kMostPoses = 40;            // between disturbances
constexpr std::uint64_t kFillPipes = 400;           // poses whose answers nobody reads
constexpr std::int64_t kLargestJump = 315'360'000;  // [s] ten years

const fs::path& made_anew(const fs::path& folder) {
  fs::remove_all(folder);
  fs::create_directories(folder);
  return folder;
}

/// How the session under test is run; never what would give another estimate.
std::vector<std::string> arguments(bool keeps_map, std::uint64_t choice) {
  static constexpr const char* kSyncs[] = {"every", "batch", "none"};
  static constexpr const char* kOutputs[] = {"last", "changed", "all", "none"};
  std::vector<std::string> words{"--journal",        "run.journal", "--sync",
                                 kSyncs[choice % 3], "--output",    kOutputs[choice / 3 % 4]};
  if (keeps_map) words.insert(words.end(), {"-o", "map.g2o"});
  return words;
}

}  // namespace

const char* name_of(Disturbance what) {
  static constexpr const char* kNames[] = {
      "killed by SIGKILL",      "ended by SIGTERM", "disk full",  "answers read slowly",
      "reader of answers gone", "half a last line", "clock wrong"};
  return kNames[static_cast<int>(what)];
}

faults::Launch online(const Place& place, const fs::path& folder, const fs::path& record,
                      std::vector<std::string> arguments) {
  faults::Launch launch{{place.program.string(), "online", "--threads", "1"},
                        faults::plain_environment(folder / "none"),
                        folder,
                        0};
  std::ranges::move(arguments, std::back_inserter(launch.command));
  if (record.empty()) return launch;
  launch.environment.push_back("LD_PRELOAD=" + place.library.string());
  launch.environment.push_back(std::string(faults::kRecordVariable) + "=" + record.string());
  launch.environment.push_back(std::string(faults::kClockVariable) + "=wrong");
  return launch;
}

Mission::Mission(const Place& place, std::uint64_t seed, Tally& tally)
    : random_(seed),
      tally_(tally),
      folder_(made_anew(place.folder / "mission")),
      keeps_map_(below(2) == 0),
      robot_(keeps_map_ ? Forgetting::remove : Forgetting::marginalize, random_()),
      record_(folder_ / "record"),
      reference_(online(place, folder_, "", {"--output", "none"}), folder_ / "reference.err", {}),
      session_(online(place, folder_, folder_ / "record", arguments(keeps_map_, random_() >> 8)),
               folder_ / "session.err", [this](const std::string& line) {
                 ++tally_.lines;
                 if (!reference_.send({line})) throw Violated("the undisturbed session ends");
               }) {
  ++tally_.missions;
  reference_.start();
  session_.restore();
  drive(2);  // a graph without a measurement is not written: the session would end with code 3
}

std::vector<std::string> Mission::poses(std::uint64_t count) {
  std::vector<std::string> lines;
  for (; count > 0; --count) std::ranges::move(robot_.next_pose(), std::back_inserter(lines));
  return lines;
}

void Mission::drive(std::uint64_t count) {
  if (!session_.send(poses(count))) throw Violated("ends by itself");
}

void Mission::round() {
  drive(1 + below(kMostPoses));
  const auto what = static_cast<Disturbance>(below(kDisturbances));
  did_ += std::string(did_.empty() ? "" : ", ") + name_of(what);
  ++tally_.times[static_cast<std::size_t>(what)];
  disturb(what);
  if (below(3) == 0) compare();
}

void Mission::disturb(Disturbance what) {
  switch (what) {
    case Disturbance::kill:
      return kill();
    case Disturbance::terminate:
      return terminate();
    case Disturbance::full_disk:
      return fill_disk();
    case Disturbance::slow_reader:
      return session_.send_unheard(poses(kFillPipes));
    case Disturbance::gone_reader:
      return lose_reader();
    case Disturbance::half_line:
      return end_in_half_a_line();
    case Disturbance::clock:
      record_->clock_offset = static_cast<std::int64_t>(below(2 * kLargestJump)) - kLargestJump;
  }
}

void Mission::expect_code(int status, int code) const {
  if (WIFEXITED(status) && WEXITSTATUS(status) == code) return;
  const std::string end = WIFSIGNALED(status) ? "signal " + std::to_string(WTERMSIG(status))
                                              : "exit code " + std::to_string(WEXITSTATUS(status));
  throw Violated("ends with " + end + "; expected exit code " + std::to_string(code));
}

/// At any moment while it takes lines. What it had answered counts as read.
void Mission::kill() {
  drive(1 + below(4));
  std::this_thread::sleep_for(std::chrono::microseconds(below(6000)));
  session_.process().send_signal(SIGKILL);
  session_.finish();
  go_on(false);
}

void Mission::terminate() {
  session_.ask("CHI2");  // it has begun to listen for signals
  drive(1 + below(4));
  session_.process().send_signal(SIGTERM);
  expect_code(session_.finish(), kInterrupted);
  go_on(true);
}

/// From a moment on, and until the session has ended of it.
void Mission::fill_disk() {
  record_->disk_full = below(2) == 0 ? 1 : 2;
  session_.send(poses(1 + below(4)));
  expect_code(session_.finish(), kOutputError);
  record_->disk_full = 0;
  go_on(false);
}

/// All that follows is taken in all the same.
void Mission::lose_reader() {
  session_.ask("CHI2");
  session_.process().close_answers();
  drive(1 + below(kMostPoses));
  expect_code(session_.finish(), 0);
  const long again = tally_.sent_again;
  go_on(true);
  if (tally_.sent_again > again) throw Violated("lines were not taken, since the reader was gone");
}

void Mission::end_in_half_a_line() {
  session_.process().write("EDGE_SE2 1 2 0.5");
  expect_code(session_.finish(), 0);
  go_on(true);
}

/// `has_map`: the session had the time to write it.
void Mission::go_on(bool has_map) {
  const long before = session_.ledger().confirmed_lines();
  const std::vector<std::string> again = session_.restore();
  tally_.sent_again += std::ssize(again);
  tally_.longest = std::max(tally_.longest, before);
  ++tally_.restorations;
  if (has_map && keeps_map_) compare_map();
  if (!session_.send(again)) throw Violated("ends after it was restored");
}

void Mission::compare() {
  for (const char* const question : {"ESTIMATE ALL", "CHI2"}) {
    const std::string there = session_.ask(question);
    if (there != reference_.ask(question))
      throw Violated(std::string(question) + " differs from that of an undisturbed session");
  }
  ++tally_.comparisons;
}

/// The map that was written at the end of the session, as a file.
void Mission::compare_map() {
  reference_.ask("SAVE reference.g2o");
  const std::string map = faults::read_bytes(folder_ / "map.g2o");
  if (map != faults::read_bytes(folder_ / "reference.g2o"))
    throw Violated("map.g2o differs from that of an undisturbed session");
  ++tally_.comparisons;
}

void Mission::end() {
  compare();
  session_.ask("QUIT");
  expect_code(session_.finish(), 0);
  if (keeps_map_) compare_map();
  expect_code(reference_.finish(), 0);
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
    tally_.parts += entry.path().extension() == ".part" ? 1 : 0;
    tally_.cuts += entry.path().extension() == ".cut" ? 1 : 0;
  }
}

}  // namespace cairn::soak
