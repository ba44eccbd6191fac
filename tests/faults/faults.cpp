// SPDX-License-Identifier: BSD-3-Clause
// ./dev faults: makes allocations, outputs and threads of cairn fail, and says where that costs
// more than it must. ./dev kill: the same for processes that are killed.
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include "campaign.hpp"
#include "trials.hpp"

namespace cairn::faults {
namespace {

constexpr std::size_t kMostShown = 8;  // violations of one kind of fault

constexpr const char* kHelp =
    "cairn_faults --program FILE --library FILE --folder FOLDER [--count N] [--fault FAULT]\n"
    "             [--kill] [--seed N] [--careless] [COMMAND...]\n"
    "\n"
    "  --program    the program; --library the injected library; --folder for its files\n"
    "  --count      at most so many faults of each kind, one per run, spread evenly [10000]\n"
    "  --fault      one run, such as allocation:17 or output:3:ENOSPC; its files stay in "
    "FOLDER/run\n"
    "  --kill       kill processes instead: at so many random moments, and in calls on outputs\n"
    "  --seed       of the moments [1]\n"
    "  --careless   the program is the one that does everything wrong\n"
    "  COMMAND      only these\n"
    "\n"
    "Ends with 1 where there is a violation, and with 2 where it cannot be said.\n";

struct Options {
  std::string program, library, folder, fault;
  std::uint64_t count = 10'000, seed = 1;
  bool kill = false, careless = false;
  std::vector<std::string> commands;
};

Options parse(const std::vector<std::string>& words) {
  Options options;
  for (std::size_t k = 0; k < words.size(); ++k) {
    const auto value = [&] {
      if (k + 1 == words.size()) throw std::invalid_argument(words[k] + " needs a value");
      return words[++k];
    };
    if (words[k] == "--program") {
      options.program = value();
    } else if (words[k] == "--library") {
      options.library = value();
    } else if (words[k] == "--folder") {
      options.folder = value();
    } else if (words[k] == "--fault") {
      options.fault = value();
    } else if (words[k] == "--count") {
      options.count = std::stoull(value());
    } else if (words[k] == "--seed") {
      options.seed = std::stoull(value());
    } else if (words[k] == "--kill") {
      options.kill = true;
    } else if (words[k] == "--careless") {
      options.careless = true;
    } else if (words[k].starts_with("-")) {
      throw std::invalid_argument("there is no option " + words[k] + "\n" + kHelp);
    } else {
      options.commands.push_back(words[k]);
    }
  }
  if (options.program.empty() || options.library.empty() || options.folder.empty())
    throw std::invalid_argument(kHelp);
  return options;
}

/// Those that were asked for.
std::vector<Trial> chosen_trials(const Options& options, Experiment& experiment) {
  std::vector<Trial> all;
  if (options.careless) {
    all.push_back(careless_trial());
    if (options.kill) all.push_back(careless_online_trial(experiment));
  } else {
    all = options.kill ? kill_trials() : cairn_trials();
  }
  if (options.commands.empty()) return all;
  std::vector<Trial> chosen;
  for (const std::string& name : options.commands) {
    const std::size_t before = chosen.size();
    for (const Trial& trial : all) {
      if (trial.name == name) chosen.push_back(trial);
    }
    if (chosen.size() == before) throw std::invalid_argument("there is no command " + name);
  }
  return chosen;
}

const char* word_of(Verdict::End end) {
  return end == Verdict::End::completed ? "completed"
         : end == Verdict::End::error   ? "ended with an error"
         : end == Verdict::End::killed  ? "killed"
                                        : "violation";
}

int show_one(const Trial& trial, const Fault& fault, Experiment& experiment) {
  RunResult result;
  const Verdict verdict = Campaign(experiment, trial).run(fault, result);
  for (const auto& [name, content] : result.files)  // other runs may have followed
    write_bytes(experiment.run_folder() / name, content);
  std::printf("%s %s: %s %s\nexit code %d, signal %d; standard error:\n%s\n%s\n",
              trial.name.c_str(), to_string(fault).c_str(), word_of(verdict.end),
              verdict.why.c_str(), result.code, result.signal, result.err.c_str(),
              experiment.shell_line(trial, fault).c_str());
  return verdict.end == Verdict::End::violation ? 1 : 0;
}

void print_head(bool kills) {
  std::printf("%-16s %-14s %9s %7s %10s %7s %11s%s\n", "command", "fault",
              kills ? "us, calls" : "calls", "runs", "completed", kills ? "killed" : "errors",
              "violations", kills ? " left .part" : "");
}

void print(const Trial& trial, const Tally& tally, bool kills) {
  std::printf("%-16s %-14s %9llu %7d %10d %7d %11zu", trial.name.c_str(), tally.fault.c_str(),
              static_cast<unsigned long long>(tally.calls), tally.runs, tally.completed,
              kills ? tally.killed : tally.errors, tally.violations.size());
  std::printf(kills ? " %10d\n" : "\n", tally.parts);
  std::size_t shown = 0;
  for (const Violation& violation : tally.violations) {
    if (++shown > kMostShown) break;
    std::printf("  %s: %s\n    ./dev %s --fault %s %s\n", violation.fault.c_str(),
                violation.why.c_str(), kills ? "kill" : "faults", violation.fault.c_str(),
                trial.name.c_str());
  }
  if (shown > kMostShown) std::printf("  and %zu more\n", tally.violations.size() - kMostShown);
  std::fflush(stdout);
}

int run(const Options& options) {
  Experiment experiment(options.program, options.library, options.folder);
  const std::vector<Trial> trials = chosen_trials(options, experiment);
  if (!options.careless) make_inputs(trials, options.kill ? kForKills : InputSizes{}, experiment);
  if (!options.fault.empty()) {
    if (trials.size() != 1) throw std::invalid_argument("--fault is for one command");
    return show_one(trials.front(), parse_fault(options.fault), experiment);
  }
  print_head(options.kill);
  bool violated = false;
  for (const Trial& trial : trials) {
    Campaign campaign(experiment, trial);
    const std::vector<Tally> all =
        options.kill ? campaign.kill(options.count, options.seed) : campaign.run(options.count);
    for (const Tally& tally : all) {
      print(trial, tally, options.kill);
      violated = violated || !tally.violations.empty();
    }
  }
  return violated ? 1 : 0;
}

}  // namespace
}  // namespace cairn::faults

int main(int argc, char** argv) {
  try {
    return cairn::faults::run(
        cairn::faults::parse(std::vector<std::string>(argv + 1, argv + argc)));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cairn_faults: %s\n", error.what());
    return 2;
  }
}
