// SPDX-License-Identifier: BSD-3-Clause
// cairn study compact: what the tables of the papers need and a robot does not.
#include <string>

#include "cairn/program/command.hpp"
#include "compact.hpp"

namespace cairn::app {
namespace {

/// Of `cairn compact` with a control.
struct CompactStudyOptions {
  CompactOptions compact;
  CompactStudyOptions() { compact.is_study = true; }

  static auto fields() {
    using O = CompactOptions;
    return OptionFields<CompactStudyOptions>().part(
        &CompactStudyOptions::compact,
        O::fields({"apal", "apfl", "fpfl", "rfpfl"},
                  "all or few poses and loops: apal, apfl, fpfl; rfpfl at random, as many as fpfl "
                  "[fpfl]")
            .integer("seed", &O::seed, 0, kMostSeed, "of rfpfl")
            .choice("draw", &O::draw, {"loops", "poses"},
                    "of rfpfl: loop closures first, with the poses at their ends, or poses first, "
                    "and then loop closures between those, as the authors do")
            .placeholder("WHAT")
            .real("error_ratio", &O::error_ratio, 0.0, 1e9,
                  "errors over those with all loops, at most, in the sample; 0: do not try")
            .text("compare", &O::compare,
                  "covariances beside those with everything, each step (slow), as CSV")
            .placeholder("FILE"));
  }
};

}  // namespace

void add_study_compact(Registrar& registrar) {
  add_command<CompactStudyOptions>(
      registrar, "study compact",
      "Example:\n"
      "  cairn study compact city.g2o --thresholds city.json --strategy rfpfl --seed 3",
      [](const CompactStudyOptions& options, Session& session) {
        return run_compact(options.compact, session);
      });
}

}  // namespace cairn::app
