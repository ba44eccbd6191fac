// SPDX-License-Identifier: BSD-3-Clause
#include <charconv>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "compact_pose.hpp"
#include "random_poses.hpp"

namespace {

using namespace cairn;
using namespace cairn::compact;

OptionTable options_table() {
  OptionTable table;
  table
      .choice("strategy", "fpfl", {"apal", "apfl", "fpfl"},
              "all poses and all loops, all poses and few loops, or few of both")
      .real("range", 5.0, 0.0, 1e9, "how far the sensor matches along x of the earlier pose [m]")
      .real("range_y", 0.0, 0.0, 1e9, "along y [m]; 0: as range")
      .real("range_z", 0.0, 0.0, 1e9, "along z [m]; 0: as range")
      .real("angle", 0.5, 0.0, 3.15, "how much orientations may differ [rad]")
      .choice("rotation", "magnitude", {"elements", "magnitude", "view"},
              "what that angle is of: each element of the rotation vector, the whole rotation, or "
              "the direction of view")
      .choice("view_axis", "z", {"x", "y", "z"}, "of the body, along which the sensor looks")
      .real(
          "probability", 0.1, 0.0, 1.0,
          "probability of being within range, in each dimension, that makes a pose a candidate (s)")
      .real("loop_gain", -1.0, -1.0, 1e9,
            "information gain that a link must exceed [nats] (g_loop); "
            "-1: (n/2 ln 2 + 1)^1.36 - 1, n = 3 or 6")
      .real("pose_gain", -1.0, -1.0, 1e9,
            "a pose is kept if the information gain of any link to it would exceed this [nats] "
            "(g_pose); -1: (n/2 ln 2 + 1)^1.7 - 1")
      .text("sensor", "",
            "expected covariance of a match: standard deviations [m] and [rad], or its upper "
            "triangle; empty: as the newest odometry")
      .choice("composition", "first", {"first", "fourth"},
              "order of the covariance of composed relative poses: Smith and Cheeseman, Barfoot "
              "and Furgale")
      .choice("search", "index", {"index", "all", "untested"},
              "candidates from a spatial index, by testing all poses, or all poses without a test")
      .real("gate", 0.0, 0.0, 0.999999,
            "fraction of the correct links that pass the consistency check; 0: no check")
      .real("trust", 0.01, 0.0, 1.0,
            "with gate: a link waits for another to agree if a false match would pass with a "
            "higher probability than this")
      .boolean("reuse", true,
               "continue from the kept pose that a link leads to, instead of keeping the pose that "
               "was linked: the map stops growing")
      .real("reuse_loss", 0.06, 0.0, 10.0,
            "with reuse: largest loss of information about the link, times the poses that are kept "
            "nearby [nats per DoF]")
      .component("estimator", Estimator::kKind.data(), "incremental_cholesky", "estimator");
  return table;
}

std::vector<double> numbers(const std::string& text) {
  std::istringstream words(text);
  std::vector<double> all;
  for (std::string word; words >> word;) {
    double number = 0.0;
    const char* const end = word.data() + word.size();
    if (const auto [at, problem] = std::from_chars(word.data(), end, number);
        problem != std::errc{} || at != end) {
      throw Error(ErrorCode::usage, "compact_pose: sensor: '" + word +
                                        "' is no number; expected numbers separated by spaces");
    }
    all.push_back(number);
  }
  return all;
}

std::unique_ptr<PosePolicy> make(const Options& options, Registry& registry) {
  CompactPoseOptions chosen;
  const std::string& strategy = options.text("strategy");
  chosen.all_loops = strategy == "apal";
  chosen.all_poses = strategy != "fpfl";
  const double range = options.real("range");
  const auto or_range = [&](const char* name) {
    return options.real(name) > 0.0 ? options.real(name) : range;
  };
  chosen.range.translation = {range, or_range("range_y"), or_range("range_z")};
  chosen.range.rotation = options.real("angle");
  chosen.range.probability = options.real("probability");
  const std::string& rotation = options.text("rotation");
  chosen.range.test = rotation == "elements"    ? RotationTest::elements
                      : rotation == "magnitude" ? RotationTest::magnitude
                                                : RotationTest::view;
  chosen.range.view_axis = options.text("view_axis")[0] - 'x';
  chosen.loop_gain = options.real("loop_gain");
  chosen.pose_gain = options.real("pose_gain");
  chosen.sensor = numbers(options.text("sensor"));
  chosen.composition =
      options.text("composition") == "first" ? CompositionOrder::first : CompositionOrder::fourth;
  const std::string& search = options.text("search");
  chosen.search = search == "index" ? Search::index
                  : search == "all" ? Search::all
                                    : Search::untested;
  chosen.reuse = options.boolean("reuse");
  chosen.reuse_loss = options.real("reuse_loss");
  chosen.gate = options.real("gate");
  chosen.trust = options.real("trust");
  return std::make_unique<CompactPose>(registry.make<Estimator>(options.text("estimator")),
                                       std::move(chosen));
}

OptionTable random_options() {
  OptionTable table;
  table.integer("poses", 100, 2, 1e9, "kept, the first and the last among them")
      .integer("loops", 10, 0, 1e9, "loop closures used, if there are so many between those")
      .integer("seed", 1, 0, 1e15, "of the draw")
      .component("estimator", Estimator::kKind.data(), "incremental_cholesky", "estimator");
  return table;
}

std::unique_ptr<PosePolicy> make_random(const Options& options, Registry& registry) {
  return std::make_unique<RandomPoses>(registry.make<Estimator>(options.text("estimator")),
                                       static_cast<int>(options.integer("poses")),
                                       static_cast<int>(options.integer("loops")),
                                       static_cast<std::uint64_t>(options.integer("seed")));
}

}  // namespace

void cairn_register(Registrar& registrar) {
  registrar.add<PosePolicy>("compact_pose", options_table(), make);
  registrar.add<PosePolicy>("random_poses", random_options(), make_random);
}
