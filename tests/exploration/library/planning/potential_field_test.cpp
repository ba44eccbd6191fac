// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/potential_field.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "cairn/runtime/error.hpp"
#include "planning_maps.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Two rooms with a door, each cell of them free for the body.
FloorMap two_rooms() {
  return test::drawn_map({"#############", "#.....#.....#", "#.....#.....#", "#...........#",
                          "#.....#.....#", "#.....#.....#", "#############"});
}
constexpr double kRadius = 0.5;  // fits in each free cell

/// (5.9) with its boundary, row by row; `mirrored`: what a neighbour that is not there is, as a
/// multiple of the configuration beside it.
MatrixXd equations(const ConfigurationSpace& space, const PotentialField& field, double mirrored) {
  const auto size = static_cast<Eigen::Index>(space.size());
  MatrixXd A = MatrixXd::Identity(size, size);
  for (std::size_t k = 0; k < space.size(); ++k) {
    if (field.is_attractor(k)) continue;
    const auto row = static_cast<Eigen::Index>(k);
    const std::int32_t cell = space.cells()[static_cast<std::size_t>(space.number_of(k))];
    const int x = cell % space.frame().width, y = cell / space.frame().width;
    const auto add = [&](std::int32_t number, int orientation) {
      if (number < 0)
        A(row, row) -= mirrored / 6.0;
      else
        A(row, static_cast<Eigen::Index>(space.index(number, orientation))) -= 1.0 / 6.0;
    };
    const int turn = space.orientation_of(k);
    add(space.number(x - 1, y), turn);
    add(space.number(x + 1, y), turn);
    add(space.number(x, y - 1), turn);
    add(space.number(x, y + 1), turn);
    add(space.number_of(k), turn - 1);
    add(space.number_of(k), turn + 1);
  }
  return A;
}

std::vector<float> one_attractor(const ConfigurationSpace& space, int x, int y, int turn,
                                 float value = 2.0F) {
  std::vector<float> decrease(space.size(), 0.1F);
  decrease[space.index(space.number(x, y), turn)] = value;
  return decrease;
}

/// Those that this machine can run.
std::vector<std::string> kernel_sets() {
  const FloorMap map = two_rooms();
  const ConfigurationSpace space(map, kRadius, 4);
  std::vector<std::string> sets;
  for (const char* name : {"portable", "avx2", "avx512"}) {
    try {
      const PotentialField field(space, std::vector<float>(space.size()), {}, name);
      sets.emplace_back(name);
    } catch (const Error&) {
    }
  }
  return sets;
}

class PotentialFieldOf : public testing::TestWithParam<int> {};

/// Also with an odd number of orientations, of which the first and the last are swept one after
/// the other.
TEST_P(PotentialFieldOf, OrientationsSolvesTheEquationsAsADenseSolverDoes) {
  const FloorMap map = two_rooms();
  const ConfigurationSpace space(map, kRadius, GetParam());
  std::vector<float> decrease = one_attractor(space, 10, 4, 3);
  decrease[space.index(space.number(2, 1), 0)] = 1.5F;
  std::vector<PotentialField> fields;
  for (const std::string& kernels : kernel_sets())
    fields.emplace_back(space, decrease, PotentialFieldOptions{.tolerance = 3e-12}, kernels);
  PotentialField& field = fields.front();
  for (const double weight : {1.0, 1.1, 1.5, 3.0}) {
    for (PotentialField& one : fields) EXPECT_TRUE(one.solve(weight).converged);
    VectorXd right = VectorXd::Zero(static_cast<Eigen::Index>(space.size()));
    int attractors = 0;
    for (std::size_t k = 0; k < space.size(); ++k) {
      if (!field.is_attractor(k)) continue;
      right[static_cast<Eigen::Index>(k)] = decrease[k];
      ++attractors;
    }
    EXPECT_EQ(attractors, 2);
    const VectorXd expected = equations(space, field, 1.0 / weight).partialPivLu().solve(right);
    EXPECT_GT(expected.minCoeff(), 0.0);
    for (std::size_t k = 0; k < space.size(); ++k) {
      const double value = expected[static_cast<Eigen::Index>(k)];
      for (std::size_t set = 0; set < fields.size(); ++set)
        ASSERT_NEAR(fields[set].value(k), value, 1e-9 * value) << weight << kernel_sets()[set];
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Numbers, PotentialFieldOf, testing::Values(2, 4, 5, 6, 9, 14, 16, 20, 34));

/// Multiplying by w at obstacles, as a potential that is positive would have it, has no limit: the
/// iteration matrix of (5.9) has an eigenvalue above 1, whereas dividing keeps all below it.
TEST(PotentialField, MultiplyingAtObstaclesWouldNotConverge) {
  std::vector<std::string> rows(5, "#" + std::string(24, '.') + "#");
  rows.front() = rows.back() = std::string(26, '#');
  const FloorMap map = test::drawn_map(rows);
  const ConfigurationSpace space(map, kRadius, 4);
  const PotentialField field(space, one_attractor(space, 1, 2, 0));
  const auto radius = [&](double mirrored) {
    const MatrixXd A = equations(space, field, mirrored);
    const MatrixXd iteration = MatrixXd::Identity(A.rows(), A.cols()) - A;
    return iteration.eigenvalues().cwiseAbs().maxCoeff();
  };
  EXPECT_LT(radius(1.0), 1.0);
  EXPECT_LT(radius(1.0 / 1.1), 1.0);
  EXPECT_GT(radius(1.1), 1.0);
}

TEST(PotentialField, LeadsThroughTheDoorToTheAttractor) {
  const FloorMap map = two_rooms();
  const ConfigurationSpace space(map, kRadius, 8);
  PotentialField field(space, one_attractor(space, 10, 5, 6), {.tolerance = 1e-8});
  for (const double weight : {1.25, 2.0}) {
    field.solve(weight);
    const Eigen::Vector2d from = space.position(space.number(2, 1));
    const PotentialField::Descent descent = field.descend({from.x(), from.y(), 0.3});
    ASSERT_EQ(descent.end, PotentialField::End::minimum);
    const auto last = space.nearest(descent.path.back());
    ASSERT_TRUE(last);
    EXPECT_EQ(*last, space.index(space.number(10, 5), 6));
    for (const Pose2& pose : descent.path) EXPECT_TRUE(space.nearest(pose));
    const auto corners = straightened(space, descent.path);
    EXPECT_LT(corners.size(), descent.path.size() / 2);
    EXPECT_EQ(corners.front(), descent.path.front().translation());
    EXPECT_EQ(corners.back(), descent.path.back().translation());
  }
}

TEST(PotentialField, WithoutAGradientItEndsElsewhere) {
  const FloorMap map = test::drawn_map({"#######", "#..#..#", "#..#..#", "#######"});
  const ConfigurationSpace space(map, kRadius, 4);
  PotentialField field(space, one_attractor(space, 5, 1, 0));
  field.solve(1.5);
  const Eigen::Vector2d from = space.position(space.number(1, 1));  // the other room
  const PotentialField::Descent descent = field.descend({from.x(), from.y(), 0.0});
  EXPECT_EQ(descent.end, PotentialField::End::elsewhere);
  EXPECT_EQ(descent.path.size(), 1U);
}

/// On a larger floor, through coarser grids, against sweeps without them.
TEST(PotentialField, CoarserGridsChangeTheTimeAlone) {
  test::Draw draw(4);
  const FloorMap map = test::random_map(draw, 40, 30, 0.1);
  const ConfigurationSpace space(map, 0.1, 12);
  std::vector<float> decrease(space.size());
  for (float& value : decrease) value = static_cast<float>(draw.uniform(0.0, 0.55));
  decrease[space.size() / 3] = 1.0F;
  PotentialField field(space, decrease, {.tolerance = 1e-12});
  ASSERT_TRUE(field.solve(1.5).converged);
  double largest = 0.0;
  for (std::size_t k = 0; k < space.size(); ++k) {
    if (field.is_attractor(k)) continue;
    const std::int32_t cell = space.cells()[static_cast<std::size_t>(space.number_of(k))];
    const int x = cell % map.frame.width, y = cell / map.frame.width;
    const int turn = space.orientation_of(k);
    double sum = field.value(space.index(space.number_of(k), turn - 1)) +
                 field.value(space.index(space.number_of(k), turn + 1));
    for (const auto& [dx, dy] : {std::pair(-1, 0), {1, 0}, {0, -1}, {0, 1}}) {
      const std::int32_t other = space.number(x + dx, y + dy);
      sum += other < 0 ? field.value(k) / 1.5 : field.value(space.index(other, turn));
    }
    // (5.9) holds, relative to each value.
    const double value = field.value(k);
    if (value > 0.0) largest = std::max(largest, std::abs(sum / 6.0 - value) / value);
  }
  EXPECT_LT(largest, 1e-9);
}

/// What is far from attractors needs a larger factor of over-relaxation than it begins with.
TEST(PotentialField, SweepsOfALongHallAreFew) {
  const FloorMap map = test::drawn_map(std::vector<std::string>(40, std::string(200, '.')));
  const ConfigurationSpace space(map, kRadius, 4);
  std::vector<float> decrease = one_attractor(space, 4, 4, 0);
  decrease[space.index(space.number(195, 35), 2)] =
      0.7F * decrease[space.index(space.number(4, 4), 0)];
  PotentialField field(space, decrease, {.tolerance = 1e-8});
  const PotentialField::Solution solution = field.solve(1.0);
  EXPECT_TRUE(solution.converged);
  EXPECT_LT(solution.sweeps, 1500);  // with the factor 1.8 alone 5000 are too few
}

TEST(PotentialField, WithoutTimeItIsSmoothFromTheAttractorsOn) {
  const FloorMap map = two_rooms();
  const ConfigurationSpace space(map, kRadius, 8);
  const std::vector<float> decrease = one_attractor(space, 10, 4, 3);
  PotentialField field(space, decrease, {.tolerance = 1e-12}), solved = field;
  const PotentialField::Solution solution = field.solve(1.1, 0.0);
  EXPECT_FALSE(solution.converged);
  EXPECT_EQ(solution.sweeps, 1);
  EXPECT_GT(solution.change, 1e-12);
  EXPECT_TRUE(solved.solve(1.1, 1e9).converged);
  for (std::size_t k = 0; k < space.size(); ++k) {
    EXPECT_GE(field.value(k), 0.0);
    EXPECT_LE(field.value(k), 2.0);
  }
  // And time that is left afterwards is used.
  EXPECT_TRUE(field.solve(1.1).converged);
  for (std::size_t k = 0; k < space.size(); ++k) EXPECT_EQ(field.value(k), solved.value(k));
}

TEST(PotentialField, AnInterruptEndsItAfterOneSweepOfEachGrid) {
  const FloorMap map = two_rooms();
  const ConfigurationSpace space(map, kRadius, 8);
  PotentialField field(space, one_attractor(space, 10, 4, 3), {.tolerance = 1e-12});
  const std::atomic<bool> interrupt = true;
  const PotentialField::Solution solution =
      field.solve(1.1, std::numeric_limits<double>::infinity(), &interrupt);
  EXPECT_FALSE(solution.converged);
  EXPECT_EQ(solution.sweeps, 1);
}

/// In a corridor that is one cell wide the potential falls so fast that over-relaxation overshoots.
TEST(PotentialField, StandsInANarrowCorridor) {
  for (const int length : {100, 900}) {
    const FloorMap map = test::drawn_map(
        {std::string(length, '#'), std::string(length, '.'), std::string(length, '#')});
    const ConfigurationSpace space(map, kRadius, 4);
    for (const double weight : {1.1, 1.5, 3.0}) {
      PotentialField field(space, one_attractor(space, 1, 1, 0), {.tolerance = 1e-6});
      const PotentialField::Solution solution = field.solve(weight);
      EXPECT_TRUE(solution.converged) << length << ' ' << weight;
      double before = 2.0;
      for (int x = 2; x < std::min(length - 1, 500); ++x) {
        const double value = field.value(space.index(space.number(x, 1), 2));
        EXPECT_GT(value, 0.0) << x;
        EXPECT_LT(value, before) << x;
        before = value;
      }
    }
  }
}

/// Several sweeps are made at a time; a limit ends them where it would end single ones.
TEST(PotentialField, MakesAsManySweepsAsItMay) {
  const FloorMap map = two_rooms();
  const ConfigurationSpace space(map, kRadius, 4);
  for (const int most : {1, 2, 3, 5, 7, 12}) {
    PotentialField field(space, one_attractor(space, 10, 4, 3),
                         {.tolerance = 1e-14, .sweeps = most});
    const PotentialField::Solution solution = field.solve(1.1);
    EXPECT_EQ(solution.sweeps, most);
    EXPECT_FALSE(solution.converged);
  }
}

TEST(PotentialField, OfNoCellIsSolvedAtOnce) {
  const FloorMap map = test::drawn_map({"###", "###"});
  const ConfigurationSpace space(map, kRadius, 4);
  PotentialField field(space, {});
  EXPECT_TRUE(field.solve(1.1).converged);
}

TEST(PotentialField, RefusesWhatMakesNoSense) {
  const FloorMap map = two_rooms();
  const ConfigurationSpace space(map, kRadius, 4);
  EXPECT_THROW(PotentialField(space, std::vector<float>(3)), Error);
  EXPECT_THROW(PotentialField(space, std::vector<float>(space.size()), {}, "sse"), Error);
  PotentialField field(space, one_attractor(space, 1, 1, 0));
  EXPECT_THROW(field.solve(0.9), Error);
}

}  // namespace
}  // namespace cairn
