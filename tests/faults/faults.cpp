// SPDX-License-Identifier: BSD-3-Clause
// ./dev faults: makes allocations, outputs and threads of cairn fail, and says where that costs
// more than it must. ./dev kill: the same for processes that are killed.
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "campaign.hpp"
#include "trials.hpp"

namespace cairn::faults {
namespace {

constexpr std::size_t kMostShown = 8;  // violations of one kind of fault

struct Options {
  std::string program, library, folder, fault;
  std::uint64_t count = 10'000, seed = 1;
  bool kill = false, careless = false;
  std::vector<std::string> commands;
};

void add_options(CLI::App& app, Options& options) {
  app.add_option("--program", options.program, "the program")->required();
  app.add_option("--library", options.library, "the injected library")->required();
  app.add_option("--folder", options.folder, "for its files")->required();
  app.add_option("--count", options.count,
                 "at most so many faults of each kind, one per run, spread evenly")
      ->capture_default_str();
  app.add_option("--fault", options.fault,
                 "one run, such as allocation:17 or output:3:ENOSPC; its files stay in FOLDER/run");
  app.add_flag("--kill", options.kill,
               "kill processes instead: at so many random moments, and in calls on outputs");
  app.add_option("--seed", options.seed, "of the moments")->capture_default_str();
  app.add_flag("--careless", options.careless, "the program is the one that does everything wrong");
  app.add_option("command", options.commands, "only these");
  app.footer("Ends with 1 where there is a violation, and with 2 where it cannot be said.");
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
  CLI::App app("Makes calls of cairn's commands fail, and says what that leaves behind.");
  cairn::faults::Options options;
  cairn::faults::add_options(app, options);
  try {
    app.parse(argc, argv);
    return cairn::faults::run(options);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cairn_faults: %s\n", error.what());
    return 2;
  }
}
