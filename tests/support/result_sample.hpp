// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cairn/runtime/result_fields.hpp"

namespace cairn::test {

/// Times of a result.
struct SampleSeconds {
  double total = 1.5, solve = 0.25;

  static ResultFields<SampleSeconds> fields() {
    return ResultFields<SampleSeconds>()
        .figure("total", &SampleSeconds::total, "s", "of all")
        .figure("solve", &SampleSeconds::solve, "s", "solving")
        .details();
  }
};

/// A result with a figure of each kind.
struct Sample {
  int loops = 7;
  double error = 1.0 / 3.0;
  std::string name = "city, \"large\"";
  bool good = true;
  std::optional<double> margin;
  std::optional<SampleSeconds> check;
  SampleSeconds seconds;
  std::vector<SampleSeconds> runs{2};
  std::map<std::string, int> verdicts{{"linked", 3}};

  static ResultFields<Sample> fields() {
    using S = Sample;
    return ResultFields<S>()
        .figure("loops.kept", &S::loops, "loop closures in the graph")
        .attribute("counts.kept_loops")
        .figure(
            "loops.in", [](const S& s) { return 2 * s.loops; }, "loop closures of the recording")
        .attribute("counts.loops")
        .figure("error", &S::error, "m", "root mean square, after alignment")
        .label("ATE")
        .round("{:.3g}")
        .figure("name", &S::name, "of the graph")
        .detail()
        .figure("good", &S::good, "whether it is")
        .figure("margin", &S::margin, "nats", "where it is known")
        .optional()
        .part("check", &S::check)
        .part("seconds", &S::seconds)
        .figure("runs", &S::runs, "each run")
        .figure("verdicts", &S::verdicts, "how many there were of each");
  }
};

/// The same after somebody has added a figure: a member, and its line.
struct GrownSample : Sample {
  double spread = 0.125;

  static ResultFields<GrownSample> fields() {
    return ResultFields<GrownSample>()
        .part([](const GrownSample& grown) -> const Sample& { return grown; })
        .figure("spread", &GrownSample::spread, "m", "of the positions");
  }
};

}  // namespace cairn::test
