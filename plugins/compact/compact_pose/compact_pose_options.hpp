// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <string>
#include <vector>

#include "cairn/geometry/motion.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/solve/estimator.hpp"
#include "proximity.hpp"

namespace cairn::compact {

/// What is kept (section 5 of the paper).
enum class Strategy {
  apal,  ///< all poses, all loop closures
  apfl,  ///< all poses, few loop closures
  fpfl,  ///< few of both
};
constexpr auto enum_names(Strategy) {
  return std::to_array<EnumName<Strategy>>(
      {{Strategy::apal, "apal"}, {Strategy::apfl, "apfl"}, {Strategy::fpfl, "fpfl"}});
}

/// An axis of a body.
enum class Axis { x, y, z };
constexpr auto enum_names(Axis) {
  return std::to_array<EnumName<Axis>>({{Axis::x, "x"}, {Axis::y, "y"}, {Axis::z, "z"}});
}

/// Which poses are tested for being near.
enum class Search {
  index,     ///< those that the spatial index finds
  all,       ///< all of them, which finds the same
  untested,  ///< all count as near
  recorded,  ///< those of which the recording has a measurement count as near
};
constexpr auto enum_names(Search) {
  return std::to_array<EnumName<Search>>({{Search::index, "index"},
                                          {Search::all, "all"},
                                          {Search::untested, "untested"},
                                          {Search::recorded, "recorded"}});
}

/// Information gains that decide what is used and kept [nats].
struct Gains {
  double loop = 0.0, pose = 0.0;  ///< g_loop, g_pose
  double prior = 0.0, landmark = 0.0;
  double landmark_loss = 0.0;  ///< of the map, where a pose leaves that landmarks locate
};

/// Options of the pose policy `compact_pose`.
struct CompactPoseOptions {
  Strategy strategy = Strategy::fpfl;
  double range = 5.0;                   ///< of the sensor, along x of the earlier pose [m]
  double range_y = 0.0, range_z = 0.0;  ///< along y and z [m]; 0: as `range`
  double angle = 0.5;                   ///< how much orientations may differ [rad]
  RotationTest rotation = RotationTest::magnitude;  ///< what `angle` is of
  Axis view_axis = Axis::z;                         ///< along which the sensor looks
  double probability = 0.1;                         ///< s, of being within, in each dimension
  /// Whether far poses are candidates too where that deviation alone excludes them, see `search`.
  bool wide = true;
  double noise_scale = 1.0;     ///< by which the standard deviations of that test are multiplied
  double loop_gain = -1.0;      ///< g_loop [nats]; negative: by the size of a pose
  double pose_gain = -1.0;      ///< g_pose [nats]; negative: likewise
  double prior_gain = -1.0;     ///< of an absolute measurement [nats]; negative: as `loop_gain`
  double landmark_gain = -1.0;  ///< of a measurement of a landmark [nats]; negative: by its size
  /// What may be lost about the map where a pose leaves that landmarks locate [nats]; negative:
  /// likewise.
  double landmark_loss = -1.0;
  /// Whether landmarks that no single measurement determines wait for other poses to see them.
  bool several_views = true;
  int waiting = 1000;  ///< most landmarks that do, with up to 64 poses each
  /// Σ̄_y, what a registration is expected to be worth, upper triangle by rows, or the standard
  /// deviations of translation [m] and rotation [rad]. Empty: like the newest odometry.
  std::vector<double> sensor{};
  CompositionOrder composition = CompositionOrder::first;
  Search search = Search::index;
  double gate = 0.0;    ///< part of the right links that pass the consistency check; 0: off
  double trust = 0.01;  ///< see `ConsistencyCheck`
  /// Whether a pose that is found to be at a kept one is not kept itself; where poses have to leave
  /// (`keep`) it never is.
  bool reuse = false;
  /// … where the link loses at most this information [nats per DoF and kept pose nearby].
  double reuse_loss = 0.06;
  int matches = 0;  ///< most requests for a match per pose; 0: any number
  /// Of the matches that are proposed for a pose, those that are inconsistent or wait for another,
  /// since the last that was linked, after which no more is proposed; 0: any number. Where the
  /// estimate is wrong, all others are inconsistent as well; where matches are too uncertain to
  /// confirm one another, all wait. Of no effect with `Strategy::apal` and `Search::recorded`.
  int attempts = 8;
  int keep = 0;  ///< most poses that are kept, as others leave; 0: any number
  std::string select = "nearest:leaving=true";  ///< which poses leave
  std::string sparsifier = "sparsify";          ///< what replaces them by factors
  std::string estimator = "incremental_cholesky";

  /// The range along every axis, `range` where none is given.
  SensorRange sensor_range() const {
    return {
        .translation = {range, range_y > 0.0 ? range_y : range, range_z > 0.0 ? range_z : range},
        .rotation = angle,
        .probability = probability,
        .noise_scale = noise_scale,
        .test = rotation,
        .view_axis = static_cast<int>(view_axis)};
  }

  /// For poses with so many degrees of freedom. −∞ where everything is used, or kept.
  Gains gains(int dof) const;

  static OptionFields<CompactPoseOptions> fields();
};

}  // namespace cairn::compact
