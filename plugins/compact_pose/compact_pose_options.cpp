// SPDX-License-Identifier: BSD-3-Clause
#include "compact_pose_options.hpp"

#include <charconv>
#include <sstream>

#include "cairn/runtime/error.hpp"

namespace cairn::compact {
namespace {

std::vector<double> numbers(const std::string& text) {
  std::istringstream words(text);
  std::vector<double> all;
  for (std::string word; words >> word;) {
    double number = 0.0;
    const char* const end = word.data() + word.size();
    if (const auto [at, problem] = std::from_chars(word.data(), end, number);
        problem != std::errc{} || at != end) {
      throw Error(ErrorCode::usage,
                  "compact_pose: sensor: '" + word + "' is no number; expected numbers and blanks");
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
            "a pose is a candidate if it is within range so probably, in each dimension (s)");
}

}  // namespace

OptionFields<CompactPoseOptions> CompactPoseOptions::fields() {
  return range_fields()
      .real("loop_gain", &O::loop_gain, -1.0, 1e9,
            "a link must tell more than this [nats] (g_loop); -1: (n/2 ln 2 + 1)^1.36 - 1, n = 3 "
            "or 6")
      .real("pose_gain", &O::pose_gain, -1.0, 1e9,
            "a pose is kept if any link to it would tell more than this [nats] (g_pose); -1: (n/2 "
            "ln 2 + 1)^1.7 - 1")
      .text("sensor", &O::sensor, numbers, text_of,
            "expected covariance of a match: two standard deviations [m] [rad], or its upper "
            "triangle; nothing: as the newest odometry")
      .choice("composition", &O::composition,
              "order of the covariance of concatenated motions: Smith and Cheeseman, Barfoot and "
              "Furgale")
      .choice("search", &O::search,
              "candidates from a spatial index, by testing all poses, or all poses without a test")
      .real("gate", &O::gate, 0.0, 0.999999,
            "check links for consistency; so large a part of the right ones passes; 0: no check")
      .real("trust", &O::trust, 0.0, 1.0,
            "with gate: a link that a false match would fit more probably than this waits until "
            "another agrees")
      .boolean(
          "reuse", &O::reuse,
          "go on from the kept pose that a link leads to, instead of keeping the pose that was "
          "linked: the map stops growing")
      .real("reuse_loss", &O::reuse_loss, 0.0, 10.0,
            "with reuse: where that costs what is known of the way at most this, times the poses "
            "that are kept nearby [nats a freedom]")
      .component<Estimator>("estimator", &O::estimator, "who estimates");
}

}  // namespace cairn::compact
