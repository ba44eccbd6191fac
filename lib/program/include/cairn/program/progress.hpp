// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <chrono>
#include <optional>
#include <string>
#include <string_view>

#include "cairn/solve/optimizer.hpp"

namespace cairn::app {

/// What is going on, on standard error: on a terminal one line that is rewritten, and shortened to
/// what fits; plain lines elsewhere.
class StatusLine {
 public:
  explicit StatusLine(bool quiet);
  StatusLine(const StatusLine&) = delete;
  StatusLine& operator=(const StatusLine&) = delete;
  ~StatusLine() { clear(); }

  bool silent() const { return quiet_; }
  bool on_terminal() const { return terminal_; }
  void show(std::string_view text);
  /// Wipes the line, so that other output may follow.
  void clear();

 private:
  bool quiet_;
  bool terminal_;
  bool shown_ = false;
};

/// "[#####     ]"
std::string bar(double part, int width);

/// Shows the progress of an optimisation.
class OptimizationProgress : public Observer {
 public:
  OptimizationProgress(bool quiet, int max_iterations)
      : line_(quiet), max_iterations_(max_iterations) {}
  void on_start(const Graph& graph, double chi2) override;
  bool on_iteration(const Iteration& iteration, const Graph& graph, const Values& values) override;

 private:
  bool due(int iteration);

  StatusLine line_;
  int max_iterations_;
  std::chrono::steady_clock::time_point last_shown_{};
};

/// Shows what an initial guess does that takes long, and ends it when the user interrupts. Called
/// as `WatchedGuess` does.
class GuessProgress {
 public:
  GuessProgress(bool quiet, const std::atomic<bool>& interrupt)
      : line_(quiet), interrupt_(interrupt) {}
  bool operator()(std::string_view what, double part);

 private:
  StatusLine line_;
  const std::atomic<bool>& interrupt_;
  std::chrono::steady_clock::time_point last_shown_ = std::chrono::steady_clock::now();
};

/// Shows how far any other work is: with the first call, and then not with every one, so that it
/// can be called often.
class WorkProgress {
 public:
  explicit WorkProgress(bool quiet) : line_(quiet) {}
  /// `part` of the work is done, 0 to 1; none: not known, and `text` is shown at once.
  void show(std::optional<double> part, std::string_view text);

 private:
  StatusLine line_;
  std::chrono::steady_clock::time_point shown_{};
};

}  // namespace cairn::app
