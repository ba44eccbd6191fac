// SPDX-License-Identifier: BSD-3-Clause
#include "compact_pose_options.hpp"

#include <charconv>
#include <cmath>
#include <limits>
#include <sstream>

#include "cairn/runtime/error.hpp"
#include "cairn/sparsification/selection.hpp"
#include "cairn/sparsification/sparsifier.hpp"

namespace cairn::compact {
namespace {

/// What a measurement of a landmark must add to be used, and what may be lost where a pose leaves
/// that landmarks locate, by default [nats per DoF of a pose].
constexpr double kLittle = 0.1, kLoss = 0.06;

/// (I + 1)^power − 1 of the gain I of a measurement of n numbers as good as what is known of them,
/// such as odometry between two poses, which is n/2 ln 2: what the thresholds of section 5.2 come
/// to for such data.
double default_gain(int n, double power) {
  return std::pow(0.5 * n * std::log(2.0) + 1.0, power) - 1.0;
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
                                        "' is not a number; expected numbers separated by spaces");
    }
    all.push_back(number);
  }
  return all;
}

std::string text_of(const std::vector<double>& numbers) {
  std::string text;
  for (const double number : numbers) text += (text.empty() ? "" : " ") + option_text(number);
  return text;
}

using O = CompactPoseOptions;

OptionFields<O> range_fields() {
  return OptionFields<O>()
      .choice("strategy", &O::strategy,
              "all poses and all loops, all poses and few loops, or few of both")
      .real("range", &O::range, 0.0, 1e9,
            "how far the sensor matches along x of the earlier pose [m]")
      .real("range_y", &O::range_y, 0.0, 1e9, "along y [m]; 0: as range")
      .real("range_z", &O::range_z, 0.0, 1e9, "along z [m]; 0: as range")
      .real("angle", &O::angle, 0.0, 3.15, "how much orientations may differ [rad]")
      .choice("rotation", &O::rotation,
              "what that angle is of: each element of the rotation vector, the whole rotation, or "
              "the direction of view")
      .choice("view_axis", &O::view_axis, "of the body, along which the sensor looks")
      .real("probability", &O::probability, 0.0, 1.0,
            "probability of being within range, in each dimension, that makes a pose a candidate "
            "(s)")
      .boolean("wide", &O::wide,
               "where the newest pose is more uncertain than twice the smallest range, all kept "
               "poses are tested each time it has driven five times the largest, or a match waits "
               "for another, and the most probable are proposed whose probability is more than s "
               "times that of a displacement with mean zero; false: never")
      .real("noise_scale", &O::noise_scale, 0.0, 1.0,
            "how much smaller the errors of the measurements are than their covariances say, for "
            "that probability");
}

}  // namespace

Gains CompactPoseOptions::gains(int dof) const {
  const auto threshold = [&](bool everything, double chosen, double power) {
    if (everything) return -std::numeric_limits<double>::infinity();
    return chosen < 0.0 ? default_gain(dof, power) : chosen;
  };
  const bool all = strategy == Strategy::apal;
  Gains gains;
  gains.loop = threshold(all, loop_gain, 1.36);
  gains.pose = threshold(strategy != Strategy::fpfl, pose_gain, 1.7);
  gains.prior = prior_gain >= 0.0 && !all ? prior_gain : gains.loop;
  gains.landmark = all                    ? -std::numeric_limits<double>::infinity()
                   : landmark_gain >= 0.0 ? landmark_gain
                                          : kLittle * dof;
  gains.landmark_loss = landmark_loss >= 0.0 ? landmark_loss : kLoss * dof;
  return gains;
}

OptionFields<CompactPoseOptions> CompactPoseOptions::fields() {
  return range_fields()
      .real("loop_gain", &O::loop_gain, -1.0, 1e9,
            "information gain that a link must exceed [nats] (g_loop); -1: (n/2 ln 2 + 1)^1.36 - "
            "1, n = 3 or 6")
      .real("pose_gain", &O::pose_gain, -1.0, 1e9,
            "a pose without a link is kept if the information gain of every link to a pose nearby "
            "would exceed this [nats] (g_pose); -1: (n/2 ln 2 + 1)^1.7 - 1")
      .real("prior_gain", &O::prior_gain, -1.0, 1e9,
            "information gain that an absolute measurement of a pose must exceed [nats]; -1: as "
            "loop_gain")
      .real("landmark_gain", &O::landmark_gain, -1.0, 1e9,
            "information gain that a measurement of a landmark in the graph must exceed [nats]; "
            "-1: 0.1 per DoF of a pose")
      .real("landmark_loss", &O::landmark_loss, -1.0, 3.0,
            "largest information about the map that is lost by removing a pose which landmarks "
            "locate, where another one stays [nats]; -1: 0.06 per DoF of a pose")
      .boolean("several_views", &O::several_views,
               "landmarks that no single measurement determines, such as by bearings alone, are "
               "added when several poses determine them together; false: never")
      .integer("waiting", &O::waiting, 1, 1e9,
               "with several_views: most landmarks that wait for other poses to determine them; of "
               "more, what was measured of the one not seen for longest is given up")
      .text("sensor", &O::sensor, numbers, text_of,
            "expected covariance of a match: standard deviations [m] and [rad], or its upper "
            "triangle; empty: the lower quartile of the latest matches, at first as odometry")
      .choice("composition", &O::composition,
              "order of the covariance of composed relative poses: Smith and Cheeseman, Barfoot "
              "and Furgale")
      .choice("search", &O::search,
              "candidates from a spatial index, by testing all poses, all poses without a test, or "
              "of a recording those of which it has a measurement")
      .real("gate", &O::gate, 0.0, 0.999999,
            "fraction of the correct links that pass the consistency check; 0: no check")
      .real("trust", &O::trust, 0.0, 1.0,
            "with gate: a link waits for another to agree if a false match would pass with a "
            "higher probability than this")
      .boolean("reuse", &O::reuse,
               "continue from the kept pose that a link leads to, instead of keeping the pose that "
               "was linked: the map stops growing, and is less accurate; with keep, always once "
               "poses have to leave")
      .real("reuse_loss", &O::reuse_loss, 0.0, 10.0,
            "with reuse: largest loss of information about the link, times the poses that are kept "
            "nearby [nats per DoF]")
      .integer(
          "matches", &O::matches, 0, 1e9,
          "most pairs that are proposed per pose, those first whose information gain times the "
          "probability of a match is largest, which is learnt from earlier answers; 0: any "
          "number, by information gain alone")
      .integer(
          "attempts", &O::attempts, 0, 1e9,
          "with gate: proposed matches of a pose that are inconsistent or wait, since the last "
          "that was linked, after which no other is proposed for it; 0: any number, as with "
          "strategy=apal and search=recorded")
      .integer("keep", &O::keep, 0, 1e9,
               "most poses that are kept: of more, some leave and are replaced by factors between "
               "their neighbours; 0: any number")
      .component<NodeSelection>("select", &O::select, "with keep: which poses leave")
      .component<Sparsifier>("sparsifier", &O::sparsifier,
                             "with keep: what replaces the poses that leave")
      .component<Estimator>("estimator", &O::estimator, "estimator");
}

}  // namespace cairn::compact
