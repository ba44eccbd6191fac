// SPDX-License-Identifier: BSD-3-Clause
#include "verdict.hpp"

#include <algorithm>
#include <csignal>
#include <cstring>
#include <regex>
#include <set>
#include <sstream>
#include <string_view>
#include <vector>

namespace cairn::faults {
namespace {

constexpr int kOutputError = 3, kMemoryError = 4;
constexpr int kLoaderError = 127;  // of the dynamic loader, which ends a process by itself

bool contains(const std::string& text, std::string_view part) {
  return text.find(part) != std::string::npos;
}

Verdict violation(const std::string& why) { return {Verdict::End::violation, why}; }

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

/// The file of that name; null if there is none.
const std::string* file_of(const RunResult& result, const std::string& name) {
  const auto found = result.files.find(name);
  return found == result.files.end() ? nullptr : &found->second;
}

/// What stood there before the run, or was not there.
bool is_old(const Trial& trial, const RunResult& result, const std::string& name) {
  const std::string* content = file_of(result, name);
  if (name == trial.journal) return !content;
  return content && *content == old_content(name);
}

bool is_new(const RunResult& good, const RunResult& result, const std::string& name) {
  const std::string* content = file_of(result, name);
  const std::string* expected = file_of(good, name);
  return content && expected && *content == *expected;
}

/// The lines of a map, those of variables without their states; empty for what is no map.
std::set<std::string> structure(const std::string& map) {
  std::set<std::string> all;
  std::istringstream lines(map);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string tag, id;
    words >> tag >> id;
    if (tag.starts_with("VERTEX")) all.insert(tag + " " + id);
    if (tag.starts_with("EDGE") || tag == "FIX") all.insert(line);
  }
  return all;
}

/// Whether each line is in one of two maps, and each that is in both is there.
bool is_between(const std::set<std::string>& map, const std::set<std::string>& before,
                const std::set<std::string>& after) {
  const auto in = [](const std::set<std::string>& lines) {
    return [&lines](const std::string& line) { return lines.contains(line); };
  };
  const auto known = [&](const std::string& line) { return in(before)(line) || in(after)(line); };
  const auto kept = [&](const std::string& line) { return !in(after)(line) || in(map)(line); };
  return std::ranges::all_of(map, known) && std::ranges::all_of(before, kept);
}

/// Of a session that ended early: what it had until then, or while it took a line.
bool is_map(const Reference& reference, const Fault& fault, const std::string* map) {
  if (!map) return false;
  if (std::ranges::find(reference.maps, *map) != reference.maps.end()) return true;
  const bool memory = fault.what == Fault::What::allocation || fault.what == Fault::What::memory;
  for (std::size_t k = 0; memory && k + 1 < reference.maps.size(); ++k) {
    if (is_between(structure(*map), structure(reference.maps[k]), structure(reference.maps[k + 1])))
      return true;
  }
  return false;
}

bool is_kill(const Fault& fault) { return fault.what == Fault::What::kill || fault.kind == "KILL"; }

/// Names of files that are no output.
std::string left_behind(const Trial& trial, const Fault& fault, const RunResult& result) {
  std::string names;
  for (const auto& [name, content] : result.files) {
    if (std::ranges::find(trial.outputs, name) != trial.outputs.end()) continue;
    if (!is_kill(fault) || !is_part(trial, name)) names += " " + name;
  }
  return names;
}

Verdict judge_completed(const Trial& trial, const RunResult& good, const RunResult& result) {
  for (const std::string& name : trial.outputs) {
    if (!is_new(good, result, name)) return violation("exit code 0, but " + name + " differs");
  }
  if (result.out != good.out) return violation("exit code 0, but standard output differs");
  return {};
}

// Journals ----------------------------------------------------------------------------------------

/// The number in the last line such as "OK 12 variables …" of what was answered; 0 if there is
/// none.
long last_acknowledged(const std::string& out) {
  long last = 0;
  std::istringstream lines(out.substr(0, out.rfind('\n') + 1));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string word;
    long number = 0;
    words >> word >> number;
    const bool acknowledges =
        word == "OK" || word == "SINGULAR" || word == "UNCONVERGED" || word == "RESTORED";
    if (acknowledges) last = number;
  }
  return last;
}

/// The numbers of the whole records of a journal: the second word of each line but the first.
std::vector<long> record_numbers(const std::string& journal) {
  std::vector<long> numbers;
  std::istringstream lines(journal.substr(0, journal.rfind('\n') + 1));
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line)) {
    std::istringstream words(line);
    std::string checksum;
    long number = 0;
    words >> checksum >> number;
    numbers.push_back(number);
  }
  return numbers;
}

/// Empty, or what is wrong with the journal.
std::string journal_problem(const Trial& trial, const Fault& fault, const RunResult& good,
                            const RunResult& result) {
  const long acknowledged = last_acknowledged(result.out);
  const std::string* journal = file_of(result, trial.journal);
  if (!journal) return acknowledged == 0 ? "" : "lines were acknowledged, and there is no journal";
  const std::string& whole = *file_of(good, trial.journal);
  if (!whole.starts_with(*journal)) return "the journal is no beginning of what it should be";
  if (!is_kill(fault) && !journal->empty() && journal->back() != '\n')
    return "the journal ends in half a record";
  const std::vector<long> there = record_numbers(*journal);
  for (const long number : record_numbers(whole)) {
    if (number <= acknowledged && std::ranges::find(there, number) == there.end())
      return "line " + std::to_string(number) + " was acknowledged, and is not in the journal";
  }
  return "";
}

// Errors ------------------------------------------------------------------------------------------

/// Whether the call that failed only tried an output, before the work: it is opened and closed.
bool was_a_trial(const RunResult& result, std::uint64_t number) {
  const std::size_t at = number - 1;
  if (at >= result.calls.size() || result.calls[at].call != Call::open) return false;
  for (const OutputCall& call : result.calls) {
    if (call.call == Call::write) return &call > &result.calls[at];
  }
  return true;
}

/// Empty, or why that exit code and message do not fit the fault.
std::string code_problem(const Fault& fault, const RunResult& result) {
  const std::string said = ": " + first_line(result.err);
  if (fault.what == Fault::What::output) {
    if (result.code != kOutputError) return "exit code " + std::to_string(result.code) + said;
    return contains(result.err, "cairn: ") ? "" : "no message on standard error";
  }
  const bool loader = result.code == kLoaderError && contains(result.err, "annot allocate memory");
  if (loader) return "";
  if (result.code != kMemoryError) return "exit code " + std::to_string(result.code) + said;
  if (fault.what == Fault::What::thread)
    return contains(result.err, "thread") ? "" : "no message of threads" + said;
  return contains(result.err, "out of memory") ? "" : "no message of memory" + said;
}

/// A summary without the lines that name one of these files, and with single spaces: how wide its
/// columns are depends on its lines.
std::string summary_without(const std::vector<std::string>& files, const std::string& out) {
  static const std::regex kSpaces(" +");
  std::string text;
  std::istringstream lines(out);
  for (std::string line; std::getline(lines, line);) {
    const bool names_one =
        (line.starts_with("output ") || line.starts_with("recording ")) &&
        std::ranges::any_of(files, [&](const std::string& file) { return line.ends_with(file); });
    if (names_one) continue;
    text += std::regex_replace(line, kSpaces, " ");
    if (!lines.eof()) text += '\n';
  }
  return text;
}

Verdict judge_error(const Trial& trial, const Fault& fault, const Reference& reference,
                    const RunResult& result) {
  const RunResult& good = reference.good;
  if (const std::string problem = code_problem(fault, result); !problem.empty())
    return violation(problem);
  std::vector<std::string> old;
  for (const std::string& name : trial.outputs) {
    if (name == trial.journal) {
      if (const std::string problem = journal_problem(trial, fault, good, result); !problem.empty())
        return violation(problem);
    } else if (is_old(trial, result, name)) {
      old.push_back(name);
    } else if (!is_new(good, result, name) && !is_map(reference, fault, file_of(result, name))) {
      return violation(name + " is neither the old file nor the new one");
    }
  }
  if (!summary_without(old, good.out).starts_with(summary_without({}, result.out)))
    return violation("standard output is no beginning, or names what was not written");
  const bool one_failed = fault.what == Fault::What::output && fault.kind != "FULL" &&
                          trial.journal.empty() && !was_a_trial(result, fault.number);
  std::set<std::string> unwritten;
  for (const std::string& name : old) {
    const auto whole = trial.parts.find(name);
    unwritten.insert(whole == trial.parts.end() ? name : whole->second);
  }
  if (one_failed && unwritten.size() > 1)
    return violation("one output failed, and " + old.back() + " was not written either");
  return {Verdict::End::error, ""};
}

// Kills -------------------------------------------------------------------------------------------

Verdict judge_killed(const Trial& trial, const Fault& fault, const RunResult& good,
                     const RunResult& result) {
  if (!good.out.starts_with(result.out)) return violation("standard output is no beginning");
  const long acknowledged = last_acknowledged(result.out);
  for (const std::string& name : trial.outputs) {
    if (name == trial.journal) continue;
    const bool old = is_old(trial, result, name);
    if (!old && !is_new(good, result, name))
      return violation(name + " is neither the old file nor the new one");
    const auto saved = trial.saved.find(name);
    if (old && saved != trial.saved.end() && saved->second <= acknowledged)
      return violation(name + " was acknowledged, and is the old file");
  }
  if (trial.journal.empty()) return {Verdict::End::killed, ""};
  const std::string problem = journal_problem(trial, fault, good, result);
  return problem.empty() ? Verdict{Verdict::End::killed, ""} : violation(problem);
}

}  // namespace

bool is_part(const Trial& trial, const std::string& name) {
  static const std::regex kPart("(.+)\\.[0-9]+-[0-9]+\\.part");
  std::smatch found;
  return std::regex_match(name, found, kPart) &&
         std::ranges::find(trial.outputs, found[1].str()) != trial.outputs.end();
}

std::string last_chi2(const std::string& out) {
  const std::size_t begin = out.rfind("CHI2 ");
  return begin == std::string::npos ? "" : out.substr(begin, out.find('\n', begin) - begin);
}

long last_record(const std::string& journal) {
  const std::vector<long> numbers = record_numbers(journal);
  return numbers.empty() ? 0 : numbers.back();
}

Verdict judge(const Trial& trial, const Fault& fault, const Reference& reference,
              const RunResult& result) {
  if (result.signal == SIGALRM) return violation("it did not end");
  const bool killed = is_kill(fault) && result.signal == SIGKILL;
  if (!killed && result.signal != 0)
    return violation(std::string("killed by ") + strsignal(result.signal) + ": " +
                     first_line(result.err));
  if (const std::string names = left_behind(trial, fault, result); !names.empty())
    return violation("left behind:" + names);
  if (killed) return judge_killed(trial, fault, reference.good, result);
  if (result.code == 0) return judge_completed(trial, reference.good, result);
  const bool passes = is_kill(fault) || fault.kind == "SHORT" || fault.kind == "EINTR";
  if (passes) return violation("nothing was lost, and yet: " + first_line(result.err));
  return judge_error(trial, fault, reference, result);
}

}  // namespace cairn::faults
