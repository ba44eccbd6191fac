// SPDX-License-Identifier: BSD-3-Clause
#include "campaign.hpp"

#include <algorithm>
#include <random>
#include <stdexcept>
#include <utility>

namespace cairn::faults {
namespace {

using What = Fault::What;

/// The lines of a text after the first `count`.
std::string lines_after(const std::string& text, long count) {
  std::size_t begin = 0;
  for (; count > 0 && begin < text.size(); --count) begin = text.find('\n', begin) + 1;
  return text.substr(begin);
}

/// `count` of the numbers 1 … last, spread evenly, `last` among them; all if there are no more.
std::vector<std::uint64_t> numbers_to(std::uint64_t last, std::uint64_t count) {
  count = std::min(count, last);
  std::vector<std::uint64_t> numbers;
  for (std::uint64_t k = 1; k <= count; ++k) numbers.push_back(k * last / count);
  return numbers;
}

std::vector<Fault> faults_of(What what, std::uint64_t last, std::uint64_t count) {
  std::vector<Fault> faults;
  for (const std::uint64_t number : numbers_to(last, count)) faults.push_back({what, number, ""});
  return faults;
}

/// Whether such a call can fail so.
bool can_fail(Call call, const std::string& kind) {
  if (kind == "SHORT") return call == Call::write;
  if (kind == "EINTR") return call != Call::rename;
  return true;
}

std::vector<Fault> output_faults(const RunResult& good, const std::string& kind,
                                 std::uint64_t count) {
  std::vector<Fault> all;
  for (std::size_t k = 0; k < good.calls.size(); ++k) {
    if (can_fail(good.calls[k].call, kind)) all.push_back({What::output, k + 1, kind});
  }
  std::vector<Fault> chosen;
  for (const std::uint64_t n : numbers_to(all.size(), count)) chosen.push_back(all[n - 1]);
  return chosen;
}

}  // namespace

Campaign::Campaign(Experiment& experiment, const Trial& trial)
    : experiment_(experiment), trial_(trial), reference_{experiment.run(trial, {}), {}} {
  RunResult& good = reference_.good;
  const RunResult again = experiment.run(trial, {});
  good.microseconds = std::min(good.microseconds, again.microseconds);
  const auto refuse = [&](const std::string& why) {
    throw std::runtime_error(trial.name + ": " + why);
  };
  if (good.started == 0) refuse("the injected library was not loaded");
  if (good.code != 0) refuse("fails without a fault: " + good.err);
  if (good.outputs == 0) refuse("writes nothing that could be made to fail");
  if (good.outputs > FaultRecord::kMostCalls) refuse("more calls on outputs than can be listed");
  const bool same = good.out == again.out && good.files == again.files;
  if (!same) refuse("two runs without a fault differ");
}

/// The maps after each number of lines: that of the end, and that before it, which a policy's end
/// changes. The old map is among them, which may stand too.
void Campaign::collect_maps() {
  const std::string text = read_bytes(experiment_.inputs() / trial_.input);
  Trial partial = trial_;
  partial.input = "prefix.txt";
  for (std::size_t end = 0; end < text.size(); end = text.find('\n', end) + 1) {
    write_bytes(experiment_.inputs() / partial.input, text.substr(0, end) + "SAVE saved.g2o\n");
    const RunResult result = experiment_.run(partial, {});
    for (const char* name : {"saved.g2o", "map.g2o"}) {
      const auto map = result.files.find(name);
      reference_.maps.push_back(map == result.files.end() ? "" : map->second);
    }
  }
}

/// Restores a session from what a run has left, and gives it the rest of the stream: the map must
/// be the one that a session without a fault makes. Empty, or what is wrong.
std::string Campaign::continuation_problem(const std::string& journal) {
  if (!continued_.insert(journal).second) return "";
  write_bytes(experiment_.inputs() / "left.journal", journal);
  const std::string stream = read_bytes(experiment_.inputs() / trial_.stream);
  write_bytes(experiment_.inputs() / "left.txt", lines_after(stream, last_record(journal)));
  Trial rest = trial_;
  rest.before[trial_.journal] = "left.journal";
  rest.input = "left.txt";
  const RunResult result = experiment_.run(rest, {});
  if (result.code != 0) return "its journal is refused: " + result.err;
  if (result.files.at("map.g2o") != reference_.good.files.at("map.g2o"))
    return "its journal leads to another map";
  return last_chi2(result.out) == last_chi2(reference_.good.out)
             ? ""
             : "its journal leads to another chi2";
}

/// What was left of a recording must be its beginning, byte by byte, and `cairn view` must show it
/// once the start was recorded (in the second line). Empty, or what is wrong.
std::string Campaign::recording_problem(const RunResult& left) {
  const std::string& whole = reference_.good.files.at(trial_.recording);
  std::string part;
  for (const auto& [name, content] : left.files) {
    if (name.starts_with(trial_.recording + ".") && is_part(trial_, name)) part = content;
  }
  if (!whole.starts_with(part)) return "its recording is no beginning of the whole one";
  if (std::ranges::count(part, '\n') < 2) return "";
  write_bytes(experiment_.inputs() / "left.jsonl", part);
  Trial view;
  view.name = "view";
  view.arguments = {"view", "../inputs/left.jsonl", "-o", "page.html", "--threads", "1"};
  const RunResult result = experiment_.run(view, {});
  const auto page = result.files.find("page.html");
  if (result.code != 0 || page == result.files.end())
    return "its recording cannot be shown: " + result.err;
  const std::size_t end = part.rfind('\n'), begin = part.rfind('\n', end - 1) + 1;
  return page->second.find(part.substr(begin, end - begin)) == std::string::npos
             ? "the page lacks the last line of its recording"
             : "";
}

Verdict Campaign::run(const Fault& fault, RunResult& result) {
  const bool kills = fault.what == What::kill || fault.kind == "KILL";
  if (!trial_.journal.empty() && !kills && reference_.maps.empty()) collect_maps();
  result = experiment_.run(trial_, fault);
  Verdict verdict = judge(trial_, fault, reference_, result);
  if (verdict.end == Verdict::End::killed && !trial_.recording.empty()) {
    if (std::string problem = recording_problem(result); !problem.empty())
      return {Verdict::End::violation, problem};
  }
  const auto journal = result.files.find(trial_.journal);
  const bool stopped = verdict.end == Verdict::End::error || verdict.end == Verdict::End::killed;
  if (!stopped || journal == result.files.end()) return verdict;
  if (std::string problem = continuation_problem(journal->second); !problem.empty())
    return {Verdict::End::violation, problem};
  return verdict;
}

Tally Campaign::tally(const std::string& name, std::uint64_t calls,
                      const std::vector<Fault>& faults) {
  Tally tally;
  tally.fault = name;
  tally.calls = calls;
  std::uint64_t failed = 0;
  for (const Fault& fault : faults) {
    RunResult result;
    Verdict verdict = run(fault, result);
    failed += result.failed;
    ++tally.runs;
    tally.completed += verdict.end == Verdict::End::completed;
    tally.errors += verdict.end == Verdict::End::error;
    tally.killed += verdict.end == Verdict::End::killed;
    for (const auto& [file, content] : result.files) tally.parts += is_part(trial_, file) ? 1 : 0;
    if (verdict.end == Verdict::End::violation)
      tally.violations.push_back({to_string(fault), std::move(verdict.why)});
  }
  if (failed == 0 && tally.killed == 0 && tally.violations.empty())
    throw std::runtime_error(trial_.name + ": no " + name + " ever failed");
  return tally;
}

/// One in each of `count` equal parts of the time.
std::vector<Fault> Campaign::moments(std::uint64_t count, std::uint64_t seed) const {
  const double life = 1.1 * static_cast<double>(reference_.good.microseconds);
  std::mt19937_64 random(seed);
  std::vector<Fault> faults;
  for (std::uint64_t k = 0; k < count; ++k) {
    const double part = static_cast<double>(random() >> 11) * 0x1p-53;
    const double moment = life * (static_cast<double>(k) + part) / static_cast<double>(count);
    faults.push_back({What::kill, static_cast<std::uint64_t>(moment), ""});
  }
  return faults;
}

std::vector<Tally> Campaign::kill(std::uint64_t count, std::uint64_t seed) {
  const RunResult& good = reference_.good;
  return {tally("moment", static_cast<std::uint64_t>(good.microseconds), moments(count, seed)),
          tally("output KILL", good.outputs, output_faults(good, "KILL", count))};
}

std::vector<Tally> Campaign::run(std::uint64_t count) {
  const RunResult& good = reference_.good;
  if (trial_.threads)
    return {tally("thread", good.threads, faults_of(What::thread, good.threads, count))};
  std::vector<Tally> all;
  for (const auto& [name, what] :
       {std::pair("allocation", What::allocation), std::pair("memory", What::memory)}) {
    if (trial_.memory)
      all.push_back(tally(name, good.allocations, faults_of(what, good.allocations, count)));
  }
  for (const std::string kind : {"ENOSPC", "EIO", "FULL", "EINTR", "SHORT"})
    all.push_back(tally("output " + kind, good.outputs, output_faults(good, kind, count)));
  return all;
}

}  // namespace cairn::faults
