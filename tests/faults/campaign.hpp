// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "experiment.hpp"
#include "verdict.hpp"

namespace cairn::faults {

struct Violation {
  std::string fault, why;
};

/// How the runs of one kind of fault ended.
struct Tally {
  std::string fault;        ///< "allocation", "output ENOSPC", …
  std::uint64_t calls = 0;  ///< that the command makes; of kills: microseconds that it takes
  int runs = 0, completed = 0, errors = 0;
  int killed = 0, parts = 0;  ///< processes, and files that they left
  std::vector<Violation> violations;
};

/// Makes each call of a trial fail, one per run.
class Campaign {
 public:
  /// Runs the trial without a fault. Throws `std::runtime_error` where that does not succeed, where
  /// the library is not loaded, or two runs differ: then nothing can be compared.
  Campaign(Experiment& experiment, const Trial& trial);

  /// Tries at most `count` faults of each kind, spread evenly over the calls that can fail so.
  /// Throws `std::runtime_error` where a run cannot be made, or no fault came to pass.
  std::vector<Tally> run(std::uint64_t count);
  /// Kills the process at `count` random moments, spread evenly over its life and a tenth more, and
  /// in every call on an output, or at most `count` of them. Throws as `run` does.
  std::vector<Tally> kill(std::uint64_t count, std::uint64_t seed);
  /// One run.
  Verdict run(const Fault& fault, RunResult& result);

 private:
  Tally tally(const std::string& name, std::uint64_t calls, const std::vector<Fault>& faults);
  void collect_maps();
  std::vector<Fault> moments(std::uint64_t count, std::uint64_t seed) const;
  std::string continuation_problem(const std::string& journal);
  std::string recording_problem(const RunResult& left);

  Experiment& experiment_;
  const Trial& trial_;
  Reference reference_;
  std::set<std::string> continued_;  // journals that were continued to the right end
};

}  // namespace cairn::faults
