// SPDX-License-Identifier: BSD-3-Clause
// cairn explore FLOOR --explorer A,B --runs N: explorers side by side.
#include "explore_comparison.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>

#include <fmt/core.h>

#include "cairn/program/graph_files.hpp"
#include "cairn/program/interrupt.hpp"
#include "cairn/program/latex_table.hpp"
#include "cairn/program/progress.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/runtime/timed.hpp"
#include "explore_comparison_report.hpp"

namespace cairn::app {
namespace {

/// How many runs are done, on standard error.
class ComparisonProgress {
 public:
  ComparisonProgress(const std::vector<std::string>& explorers, int runs, const Session& session)
      : explorers_(explorers),
        all_(static_cast<int>(explorers.size()) * runs),
        line_(session.common.quiet) {
    line_.show(fmt::format("0 of {} runs", all_));
  }

  void ended(const ComparedRun& run) {
    ++done_;
    const double left = seconds_since(begin_) / done_ * (all_ - done_);
    std::string what = run.done ? fmt::format("{:.0f} m, {:.0f} m² known, {}",
                                              run.measures.distance, run.measures.coverage, run.why)
                                : run.why;
    const std::string until = done_ < all_ ? fmt::format(", {} left", seconds_text(left)) : "";
    line_.show(fmt::format("{} of {} runs{}: {} with seed {}: {}", done_, all_, until,
                           explorers_[run.explorer], run.seed, what));
  }

  void clear() { line_.clear(); }

 private:
  const std::vector<std::string>& explorers_;
  int all_, done_ = 0;
  StatusLine line_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

/// What runs note, each note once.
void print_notes(const ExploreComparison& comparison, const Session& session) {
  std::vector<std::string> said;
  for (const ComparedRun& run : comparison.outcomes) {
    for (const std::string& note : run.notes) {
      const std::string line = fmt::format("{}: {}", comparison.explorers[run.explorer], note);
      if (std::ranges::find(said, line) != said.end()) continue;
      session.note(line);
      said.push_back(line);
    }
  }
}

void write_outputs(const ComparisonOptions& options, const std::string& page,
                   const ExploreComparison& comparison, Session& session) {
  Results results;
  results.write(options.csv, [&] { write_file(options.csv, comparison_csv(comparison)); });
  results.write(options.latex, [&] { write_file(options.latex, comparison_latex(comparison)); });
  results.write(options.curves,
                [&] { write_file(options.curves, csv_text(all_curves(comparison))); });
  results.write(page, [&] { write_file(page, comparison_page(comparison, session)); });
  results.add([&] { session.write_json(comparison_json(comparison)); });
  results.add([&] { session.print(comparison_text(comparison, session.colour())); });
  results.finish();
}

int exit_code(const std::vector<ComparedRun>& runs) {
  int code = 0;
  for (const ComparedRun& run : runs) {
    if (run.done) continue;
    if (run.end == ExplorationEnd::interrupted) return kExitInterrupted;
    code = static_cast<int>(run.plugin_fault ? ErrorCode::plugin : ErrorCode::input);
  }
  return code;
}

}  // namespace

OptionFields<ComparisonOptions> ComparisonOptions::fields() {
  using O = ComparisonOptions;
  return OptionFields<O>()
      .integer("runs", &O::runs, 1, 100000,
               "of each explorer, with the seeds from --seed on, on --threads threads")
      .text("csv", &O::csv, "a row for each run (- is standard output)")
      .placeholder("FILE")
      .text("curves", &O::curves, "mean curves of entropies and errors, as CSV")
      .placeholder("FILE")
      .text("latex", &O::latex, kLatexHelp)
      .placeholder("FILE");
}

void check_comparison(const ComparisonOptions& options, const std::string& page, Session& session) {
  for (const std::string& file : {options.csv, options.curves, options.latex, page})
    check_file(file, session);
}

int run_comparison(const ComparisonOptions& options, const std::string& page,
                   const ExplorationSetup& setup, const std::string& floor,
                   const ExploreParts& parts, Session& session) {
  ExploreComparison comparison{.floor = floor,
                               .frame = setup.floor.frame,
                               .parts = parts,
                               .explorers = split_components(parts.explorer),
                               .runs = options.runs,
                               .repeatable = !std::isfinite(setup.decision_budget),
                               .outcomes = {}};
  ExplorerComparison work{.setup = setup,
                          .explorers = {},
                          .runs = options.runs,
                          .first_seed = parts.seed,
                          .threads = threads()};
  const std::uint64_t most = std::numeric_limits<std::uint64_t>::max();
  if (static_cast<std::uint64_t>(options.runs - 1) > most - parts.seed) {
    throw Error(ErrorCode::usage,
                fmt::format("--runs {} with the seeds from --seed {} on go beyond the largest, {}: "
                            "give a smaller seed",
                            options.runs, parts.seed, most));
  }
  for (const std::string& name : comparison.explorers) {
    if (std::ranges::count(comparison.explorers, name) > 1) {
      throw Error(ErrorCode::usage,
                  fmt::format("--explorer: {} is there twice, with the same seeds: --runs {} makes "
                              "more runs of it",
                              name, options.runs + 1));
    }
    work.explorers.push_back(parse_component(name));
    setup.registry.make<Explorer>(work.explorers.back());  // a wrong name is reported at once
  }
  const InterruptGuard guard;  // until the results are written
  work.setup.interrupt = &guard.flag();
  ComparisonProgress progress(comparison.explorers, options.runs, session);
  comparison.outcomes =
      compare_explorers(work, [&](const ComparedRun& run) { progress.ended(run); });
  progress.clear();
  print_notes(comparison, session);
  write_outputs(options, page, comparison, session);
  return guard.interrupted() ? kExitInterrupted : exit_code(comparison.outcomes);
}

}  // namespace cairn::app
