// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/check_wrapping.hpp"

#include <cmath>
#include <cstddef>
#include <functional>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/lie/so2.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/types/define_factor.hpp"

namespace cairn::test {
namespace {

using std::numbers::pi;

// Along one path
// -----------------------------------------------------------------------------------

std::optional<AngleJump> jump_of(const std::function<double(double)>& error, bool turn = false) {
  return find_angle_jump(
      [&](double t) {
        return std::vector<double>{0.0, error(t)};
      },
      0.0, 2.0 * pi, turn);
}

TEST(FindAngleJump, FindsTheJumpOfAnAngleAtItsPlace) {
  const auto jump = jump_of([](double t) { return wrap_angle(t - 0.4) - 0.3; });
  ASSERT_TRUE(jump);
  EXPECT_EQ(jump->row, 1);
  EXPECT_NEAR(jump->moved, pi + 0.4, 1e-9);
  EXPECT_NEAR(jump->before, pi - 0.3, 1e-9);
  EXPECT_NEAR(jump->after, -pi - 0.3, 1e-9);
  EXPECT_FALSE(jump->of_a_turn);
}

TEST(FindAngleJump, FindsAnAngleThatGoesOnAfterATurn) {
  const auto angle = [](double t) { return t - 0.4; };
  EXPECT_FALSE(jump_of(angle));
  const auto jump = jump_of(angle, true);
  ASSERT_TRUE(jump);
  EXPECT_TRUE(jump->of_a_turn);
  EXPECT_NEAR(jump->after - jump->before, 2.0 * pi, 1e-12);
}

TEST(FindAngleJump, TakesNothingElseForOne) {
  EXPECT_FALSE(jump_of([](double t) { return wrap_angle(t - 0.7); }, true));
  EXPECT_FALSE(jump_of([](double t) { return 6.0 * std::sin(t); }, true));
  EXPECT_FALSE(jump_of([](double t) { return t < 2.0 ? 0.0 : 6.2; }));  // not by 2π
  // By more than 2π, however steep, without a jump.
  EXPECT_FALSE(jump_of([](double t) { return 4.0 * std::atan(1e6 * (t - 2.0)); }));
  EXPECT_FALSE(jump_of([](double t) { return t < 2.0 ? std::nan("") : t; }));
}

// Factors
// ------------------------------------------------------------------------------------------

/// The direction from one point to another, and the direction in which a robot sees a point.
template <bool wrapped>
struct Line {
  static constexpr std::string_view kTag = "EDGE_LINE";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<PointXY, PointXY>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 2>& a, const Vector<S, 2>& b,
                               const Vector<double, 1>& z) {
    using std::atan2;
    const S error = atan2(b[1] - a[1], b[0] - a[0]) - z[0];
    return Vector<S, 1>(wrapped ? wrap_angle<S>(error) : error);
  }
};
template <bool wrapped>
struct Bearing {
  static constexpr std::string_view kTag = "EDGE_BEARING";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<Se2, PointXY>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 3>& a, const Vector<S, 2>& b,
                               const Vector<double, 1>& z) {
    using std::atan2;
    const S error = atan2(b[1] - a[1], b[0] - a[0]) - a[2] - z[0];
    return Vector<S, 1>(wrapped ? wrap_angle<S>(error) : error);
  }
};

/// At the identity of all variables, which is where an angle that is not wrapped looks best.
std::optional<UnwrappedAngle> angle_of(const FactorType& type,
                                       const std::vector<const VariableType*>& variables) {
  std::vector<std::vector<double>> states;
  std::vector<const double*> x;
  for (const VariableType* variable : variables) {
    states.emplace_back(static_cast<std::size_t>(variable->ambient_size()));
    variable->identity(states.back().data());
  }
  for (const auto& state : states) x.push_back(state.data());
  std::vector<double> z(static_cast<std::size_t>(type.measurement_size()));
  for (int attempt = 0; attempt < 2 && !type.normalize(z.data()).empty(); ++attempt) {
    z.assign(z.size(), 0.0);
    z.back() = 1.0;
  }
  return find_unwrapped_angle(type, variables, x, z);
}

TEST(FindUnwrappedAngle, NamesTheFactorsVariableAndDirection) {
  const auto pose = define_variable<Se2>();
  const auto point = define_variable<PointXY>();
  const auto bearing = angle_of(*define_factor<Bearing<false>>(), {pose.get(), point.get()});
  ASSERT_TRUE(bearing);
  EXPECT_NEAR(std::abs(bearing->jump.after - bearing->jump.before), 2.0 * pi, 1e-6);
  EXPECT_THAT(to_text(*bearing), testing::StartsWith("row 0 "));
  const auto line = angle_of(*define_factor<Line<false>>(), {point.get(), point.get()});
  ASSERT_TRUE(line);
  EXPECT_EQ(line->direction, 1);  // it is crossed sideways
  EXPECT_FALSE(line->jump.of_a_turn);
  EXPECT_FALSE(angle_of(*define_factor<Bearing<true>>(), {pose.get(), point.get()}));
  EXPECT_FALSE(angle_of(*define_factor<Line<true>>(), {point.get(), point.get()}));
}

TEST(FindUnwrappedAngle, ThereIsNoneInAnyFactorOnOffer) {
  Registry registry;
  int seen = 0;
  for (const std::string& tag : registry.names("factor")) {
    SCOPED_TRACE(tag);
    const auto type = registry.factor_type(tag);
    std::vector<std::shared_ptr<const VariableType>> owners;
    std::vector<const VariableType*> variables;
    for (const std::string_view variable : type->variable_tags()) {
      owners.push_back(registry.variable_type(variable));
      variables.push_back(owners.back().get());
    }
    const auto angle = angle_of(*type, variables);
    EXPECT_FALSE(angle) << to_text(*angle);
    ++seen;
  }
  EXPECT_GE(seen, registry.has("types", "slam2d") ? 5 : 0);
}

}  // namespace
}  // namespace cairn::test
