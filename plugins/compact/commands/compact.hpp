// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cairn/program/figure_files.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/problem_setup.hpp"
#include "cairn/program/session.hpp"

namespace cairn::app {

struct CompactOptions {
  std::string graph;
  std::string output, output_format;
  std::string trajectory;
  std::string recovery = "v2";
  std::string policy = "compact_pose";
  std::string strategy;  ///< empty: whole where the recording is known as such, else fpfl
  std::string estimator;
  std::string registration = "recorded";
  std::string map;          ///< of an earlier session
  std::optional<Id> begin;  ///< the pose at which the trajectory begins
  std::string truth;
  bool automatic = false;
  double sample = 0.6;
  std::string thresholds, save_thresholds;
  int keep = 0;  ///< most poses; 0: any number
  std::optional<double> range, angle, loop_gain, pose_gain, gate;
  std::string steps;
  FigureFiles figures;
  InputOptions input;
  ProblemOptions problem;
  // Of studies, besides the strategy rfpfl:
  bool is_study = false;  ///< the strategy is that of a robot by default: fpfl
  double error_ratio = 2.5;
  std::uint64_t seed = 1;
  std::string draw = "loops";
  std::string compare;

  CompactOptions() { problem.initial.clear(); }

  static OptionFields<CompactOptions> fields();
  /// The same where other strategies are on offer, about which `help` is.
  static OptionFields<CompactOptions> fields(std::vector<std::string> strategies,
                                             std::string_view help);
};

/// Returns the exit code.
int run_compact(const CompactOptions& options, Session& session);

}  // namespace cairn::app
