// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <optional>

#include "cairn/runtime/enum_names.hpp"
#include "rigid_group.hpp"

namespace cairn::compact {

/// P(−v < x < v) of x ~ N(μ, σ²) (equation 18); a step where σ = 0.
double probability_within(double mean, double sigma, double range);
/// The smallest v with P(−v < x < v) ≥ s, 0 < s < 1.
double range_within(double mean, double sigma, double probability);
/// How far the mean may be out of range, as a multiple of v, for the probability to exceed s
/// whatever σ is: the largest m with max_σ P > s. Infinite for s = 0, 1 from ½ on.
double reach(double probability);

/// Which quantity of the rotation must be below the threshold (section 4.1).
enum class RotationTest {
  elements,   ///< each element of the rotation vector
  magnitude,  ///< the angle
  view,       ///< the angle between the two view directions, whatever the roll
};
constexpr auto enum_names(RotationTest) {
  return std::to_array<EnumName<RotationTest>>({{RotationTest::elements, "elements"},
                                                {RotationTest::magnitude, "magnitude"},
                                                {RotationTest::view, "view"}});
}

/// From where a sensor sees the same as from another pose.
struct SensorRange {
  std::array<double, 3> translation{};  ///< along each axis of the earlier pose [m]
  double rotation = 0.0;                ///< [rad]
  double probability = 0.0;             ///< s, of being within, in each dimension
  double noise_scale = 1.0;             ///< by which standard deviations are multiplied
  RotationTest test = RotationTest::magnitude;
  int view_axis = 2;  ///< of the body: 0 x, 1 y, 2 z

  /// No pose farther away than this can pass, whatever its covariance [m].
  double radius(int dimension) const;
};

/// A displacement by dimensions, each a Gaussian by itself.
struct Dimensions {
  int translations = 0, rotations = 0;
  std::array<double, 3> t_mean{}, t_sigma{};  ///< [m]
  /// The rotation vector's elements or the angle [rad]; for `view` the cosine of the angle between
  /// the view directions.
  std::array<double, 3> r_mean{}, r_sigma{};
};

/// The distance test of section 4.1.
class DistanceTest {
 public:
  DistanceTest(const RigidGroup& group, const SensorRange& range);

  const SensorRange& range() const { return range_; }
  /// False if no covariance could make the displacement pass: its mean alone is too far off.
  bool possible(const Pose& displacement) const;
  Dimensions dimensions(const Displacement& displacement) const;
  bool passes(const Dimensions& dimensions) const;
  /// How probable being within range is, beside a displacement with the same covariance and mean
  /// zero; nothing if that is s or less in a dimension. Where the deviation is large against the
  /// range, equation 18 excludes all others, whatever the mean: this does not.
  std::optional<double> relative_probability(const Dimensions& dimensions) const;
  /// The smallest translation and rotation thresholds with which it would pass.
  SensorRange least_range(const Dimensions& dimensions) const;

 private:
  double rotation_probability(double mean, double sigma) const;

  const RigidGroup* group_;
  SensorRange range_;
  double reach_;
};

}  // namespace cairn::compact
