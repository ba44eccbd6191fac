// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <memory>
#include <span>
#include <string_view>
#include <tuple>
#include <vector>

#include "cairn/graph/elements.hpp"
#include "cairn/typed/point.hpp"
#include "cairn/typed/pose2.hpp"
#include "cairn/typed/pose3.hpp"
#include "cairn/typed/rot3.hpp"
#include "cairn/types/define_factor.hpp"

namespace cairn {

/// A measurement as a value: on which variables it is, by their ids, what was measured, and by its
/// tag which factor type it becomes. Those below are of the plugins slam2d and slam3d; any struct
/// with these members is one as well.
template <class M>
concept MeasurementValue = requires(const M& m) {
  { M::kTag } -> std::convertible_to<std::string_view>;
  { m.variables() } -> std::convertible_to<std::vector<Id>>;
  { m.numbers() } -> std::convertible_to<std::vector<double>>;
};

/// A value that a variable's state can be: `Traits` is the struct that describes the variable type.
template <class T>
concept StateValue = requires(const T& value, std::span<const double> state) {
  { T::Traits::kTag } -> std::convertible_to<std::string_view>;
  { T::from_state(state) } -> std::convertible_to<T>;
  { value } -> std::convertible_to<std::span<const double>>;
};

namespace detail {

/// The tags of the factor types that measure a value.
template <class T>
struct Tags;
template <>
struct Tags<Pose2> {
  static constexpr std::string_view kBetween = "EDGE_SE2", kPrior = "EDGE_PRIOR_SE2";
};
template <>
struct Tags<Pose3> {
  static constexpr std::string_view kBetween = "EDGE_SE3:QUAT", kPrior = "EDGE_PRIOR_SE3:QUAT";
};
template <>
struct Tags<Point2> {
  static constexpr std::string_view kSeen = "EDGE_SE2_XY", kPrior = "EDGE_PRIOR_XY",
                                    kPosition = "EDGE_PRIOR_SE2_XY";
};
template <>
struct Tags<Point3> {
  static constexpr std::string_view kSeen = "EDGE_SE3_TRACKXYZ", kPrior = "EDGE_PRIOR_TRACKXYZ",
                                    kPosition = "EDGE_SE3_PRIORXYZ";
};

inline std::vector<double> copied(std::span<const double> numbers) {
  return {numbers.begin(), numbers.end()};
}

}  // namespace detail

/// Odometry or a loop closure: pose `to` as seen from pose `from`, measured = from⁻¹ · to. The
/// error has three numbers (x y [m], theta [rad]) for `Pose2`, six (translation, rotation) for
/// `Pose3`.
template <class Pose>
struct Between {
  static constexpr std::string_view kTag = detail::Tags<Pose>::kBetween;
  Id from, to;
  Pose measured;

  Between(Id from_id, Id to_id, const Pose& pose) : from(from_id), to(to_id), measured(pose) {}
  std::vector<Id> variables() const { return {from, to}; }
  std::vector<double> numbers() const { return detail::copied(measured); }
};

/// Where a pose or a landmark is in the world. The error of a pose is along the axes of the pose
/// that was measured. What is not known has no information, and then changes nothing of the rest;
/// but two of the three components of a rotation depend on how large the third is, so that there
/// are types for what is measured alone: `Position`, `Orientation` and `Direction`.
template <class T>
struct Prior {
  static constexpr std::string_view kTag = detail::Tags<T>::kPrior;
  Id variable;
  T measured;

  Prior(Id id, const T& value) : variable(id), measured(value) {}
  std::vector<Id> variables() const { return {variable}; }
  std::vector<double> numbers() const { return detail::copied(measured); }
};

/// Where a pose is in the world, without its orientation, as from GNSS: `Point2` for a `Pose2`,
/// `Point3` for a `Pose3`. The error [m] is along the axes of the world; a component that is not
/// measured (an altimeter measures z alone) has an infinite standard deviation.
template <class Point>
struct Position {
  static constexpr std::string_view kTag = detail::Tags<Point>::kPosition;
  Id pose;
  Point measured;

  Position(Id pose_id, const Point& point) : pose(pose_id), measured(point) {}
  std::vector<Id> variables() const { return {pose}; }
  std::vector<double> numbers() const { return detail::copied(measured); }
};

/// How a `Pose3` is turned in the world, without its position, as from an attitude filter. The
/// error is the rotation vector [rad] of measured⁻¹ · orientation (with `slam3d:metric=g2o` its
/// half).
struct Orientation {
  static constexpr std::string_view kTag = "EDGE_SE3_PRIORQUAT";
  Id pose;
  Rot3 measured;

  Orientation(Id pose_id, const Rot3& rotation) : pose(pose_id), measured(rotation) {}
  std::vector<Id> variables() const { return {pose}; }
  std::vector<double> numbers() const {
    const std::vector<double> q = detail::copied(measured);
    return {q[3], q[0], q[1], q[2]};
  }
};

/// A direction that is known in the world, such as that of gravity, seen in the frame of a `Pose3`;
/// lengths do not matter. The error has three numbers, Rᵀ · (unit in the world) − (unit seen), of
/// which two are free: for small angles the angle between the two [rad]. The turn about the
/// direction is not measured, and changes nothing however large it is: roll and pitch without yaw
/// are `Direction(id, Point3(0, 0, -1), seen)`.
struct Direction {
  static constexpr std::string_view kTag = "EDGE_SE3_PRIORVEC";
  Id pose;
  Point3 in_world, seen;

  Direction(Id pose_id, const Point3& direction_in_world, const Point3& direction_seen)
      : pose(pose_id), in_world(direction_in_world), seen(direction_seen) {}
  std::vector<Id> variables() const { return {pose}; }
  std::vector<double> numbers() const {
    return {in_world[0], in_world[1], in_world[2], seen[0], seen[1], seen[2]};
  }
};

/// A landmark seen from a pose: its position [m] in the frame of the pose (`Point2` or `Point3`).
template <class Point>
struct Observation {
  static constexpr std::string_view kTag = detail::Tags<Point>::kSeen;
  Id pose, landmark;
  Point measured;

  Observation(Id pose_id, Id landmark_id, const Point& point)
      : pose(pose_id), landmark(landmark_id), measured(point) {}
  std::vector<Id> variables() const { return {pose, landmark}; }
  std::vector<double> numbers() const { return detail::copied(measured); }
};

/// A landmark of the plane seen from a pose: the direction [rad], anticlockwise from straight
/// ahead, and the distance [m].
struct BearingRange {
  static constexpr std::string_view kTag = "EDGE_BEARING_RANGE_SE2_XY";
  Id pose, landmark;
  double bearing, range;

  BearingRange(Id pose_id, Id landmark_id, double bearing_rad, double range_m)
      : pose(pose_id), landmark(landmark_id), bearing(bearing_rad), range(range_m) {}
  std::vector<Id> variables() const { return {pose, landmark}; }
  std::vector<double> numbers() const { return {bearing, range}; }
};

/// The factor type that a struct describes: one object for the whole process, so that all graphs
/// and a registry can share it.
template <FactorTraits F>
const std::shared_ptr<const FactorType>& factor_type() {
  static const std::shared_ptr<const FactorType> type = define_factor<F>();
  return type;
}

/// The variable type that a struct describes: one object for the whole process.
template <VariableTraits V>
const std::shared_ptr<const VariableType>& variable_type() {
  static const std::shared_ptr<const VariableType> type = define_variable<V>();
  return type;
}

/// A measurement of a factor of one's own (`define_factor.hpp`). It needs no plugin: where neither
/// the graph nor the registry has a factor type of that tag, `factor_type<F>()` is used.
///
///     graph.add(Measurement<Range>({X(3), L(7)}, {5.2}), Information::sigmas(0.1));
template <FactorTraits F>
struct Measurement {
  static constexpr std::string_view kTag = F::kTag;
  static constexpr std::size_t kArity = std::tuple_size_v<typename F::Variables>;
  std::array<Id, kArity> ids;
  std::array<double, F::kMeasurement> measured;

  Measurement(const std::array<Id, kArity>& variable_ids,
              const std::array<double, F::kMeasurement>& numbers_measured)
      : ids(variable_ids), measured(numbers_measured) {}
  /// With a value, such as a `Pose2`, for the numbers.
  template <StateValue T>
  requires(T::Traits::kAmbient == F::kMeasurement)
      Measurement(const std::array<Id, kArity>& variable_ids, const T& value)
      : ids(variable_ids) {
    for (std::size_t k = 0; k < measured.size(); ++k) measured[k] = value.state()[k];
  }
  std::vector<Id> variables() const { return {ids.begin(), ids.end()}; }
  std::vector<double> numbers() const { return {measured.begin(), measured.end()}; }
  static const std::shared_ptr<const FactorType>& own_type() { return factor_type<F>(); }
};

}  // namespace cairn
