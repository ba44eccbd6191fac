// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/grid/floor_survey.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "support/pose_world.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;
using testing::HasSubstr;
using testing::SizeIs;

/// Rows from the top: '.' free, '#' occupied, '?' unknown; cells of 1 m.
OccupancyGrid drawn(const std::vector<std::string>& rows) {
  OccupancyGrid grid{{.width = static_cast<int>(std::ssize(rows.front())),
                      .height = static_cast<int>(std::ssize(rows)),
                      .resolution = 1.0},
                     {}};
  for (auto row = rows.rbegin(); row != rows.rend(); ++row) {
    for (const char c : *row)
      grid.occupancy.push_back(c == '.' ? 0 : c == '#' ? 100 : kUnknownCell);
  }
  return grid;
}

FloorSurvey survey(const OccupancyGrid& grid, const FloorSurveyOptions& options) {
  return Registry().make<FloorSurveyor>("round_body")->survey(grid, options);
}

std::string refusal(const OccupancyGrid& grid, const FloorSurveyOptions& options) {
  try {
    survey(grid, options);
  } catch (const Error& error) {
    return error.what();
  }
  return "fits";
}

/// The definitions, cell by cell against cell.
struct Literal {
  Literal(const OccupancyGrid& grid, double radius) : frame(grid.frame) {
    const double reach = radius / frame.resolution + 0.5;
    const auto is_free = [&](int x, int y) {
      return frame.contains(x, y) && grid.occupancy[frame.index(x, y)] == 0;
    };
    const int margin = static_cast<int>(reach) + 1;
    for (int y = 0; y < frame.height; ++y) {
      for (int x = 0; x < frame.width; ++x) {
        bool fits = is_free(x, y);
        for (int v = y - margin; v <= y + margin; ++v) {
          for (int u = x - margin; u <= x + margin; ++u)
            fits = fits && (is_free(u, v) || std::hypot(u - x, v - y) >= reach - 1e-9);
        }
        standing.push_back(fits);
      }
    }
    std::vector<bool> left = standing;
    for (std::size_t begin = 0; begin < left.size(); ++begin) {
      if (left[begin]) parts.push_back(take_part(begin, left));
    }
    std::ranges::stable_sort(parts, std::greater{}, [](const auto& part) { return part.size(); });
  }

  int covered(const OccupancyGrid& grid, double radius) const {
    int count = 0;
    for (int y = 0; y < frame.height; ++y) {
      for (int x = 0; x < frame.width; ++x) {
        if (grid.occupancy[frame.index(x, y)] != 0) continue;
        count += std::ranges::any_of(parts.front(), [&](std::size_t k) {
          const int u = static_cast<int>(k) % frame.width, v = static_cast<int>(k) / frame.width;
          return std::hypot(u - x, v - y) <= radius / frame.resolution + 0.5 + 1e-9;
        });
      }
    }
    return count;
  }

  std::vector<std::size_t> take_part(std::size_t begin, std::vector<bool>& left) const {
    std::vector<std::size_t> part{begin};
    left[begin] = false;
    for (std::size_t done = 0; done < part.size(); ++done) {
      const int x = static_cast<int>(part[done]) % frame.width,
                y = static_cast<int>(part[done]) / frame.width;
      for (const auto& [u, v] :
           {std::pair{x - 1, y}, std::pair{x + 1, y}, std::pair{x, y - 1}, std::pair{x, y + 1}}) {
        if (!frame.contains(u, v) || !left[frame.index(u, v)]) continue;
        left[frame.index(u, v)] = false;
        part.push_back(frame.index(u, v));
      }
    }
    return part;
  }

  GridFrame frame;
  std::vector<bool> standing;
  std::vector<std::vector<std::size_t>> parts;  ///< the largest first
};

TEST(FloorSurvey, IsWhatItsDefinitionsSayOnRandomFloors) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    test::Draw draw(seed);
    OccupancyGrid grid{{.width = 31, .height = 23, .resolution = 0.25}, {}};
    for (std::int64_t k = 0; k < grid.frame.size(); ++k)
      grid.occupancy.push_back(draw.integer(14) == 0 ? (draw.integer(2) == 0 ? 100 : -1) : 0);
    for (const double radius : {0.0, 0.2, 0.3}) {
      const Literal literal(grid, radius);
      if (literal.parts.size() > 1 && literal.parts[0].size() == literal.parts[1].size()) continue;
      const FloorSurvey found = survey(grid, {.radius = radius});
      const double cell = grid.frame.cell_area();
      EXPECT_DOUBLE_EQ(found.standing_area, cell * std::ssize(literal.parts.front()));
      EXPECT_DOUBLE_EQ(found.covered_area, cell * literal.covered(grid, radius));
      ASSERT_EQ(found.covered.size(), grid.occupancy.size());
      EXPECT_DOUBLE_EQ(found.covered_area, cell * std::ranges::count(found.covered, 1));
      EXPECT_EQ(found.unreachable_parts, std::ssize(literal.parts) - 1);
      EXPECT_NEAR(found.unreachable_area + found.standing_area,
                  cell * std::ranges::count(literal.standing, true), 1e-9);
      EXPECT_DOUBLE_EQ(found.free_area, cell * std::ranges::count(grid.occupancy, 0));
      EXPECT_DOUBLE_EQ(found.occupied_area, cell * std::ranges::count(grid.occupancy, 100));
    }
  }
}

TEST(FloorSurvey, FromAPocketTheLargestPartIsNamedAndFromThereNothingIs) {
  const OccupancyGrid floor = drawn({"############",  //
                                     "#..#.......#",  //
                                     "#..#.......#",  //
                                     "#..#.......#",  //
                                     "############"});
  const double side = floor.frame.resolution;
  const auto from = [&](int x, int y) {
    return survey(floor, {.radius = 0.0, .start = floor.frame.centre(x, y)});
  };
  const FloorSurvey pocket = from(1, 2);
  ASSERT_TRUE(pocket.larger_part.has_value());
  EXPECT_EQ(*pocket.larger_part, floor.frame.centre(4, 2));
  EXPECT_DOUBLE_EQ(pocket.larger_area, 21 * side * side);
  EXPECT_DOUBLE_EQ(pocket.standing_area, 6 * side * side);
  EXPECT_FALSE(from(8, 2).larger_part.has_value());
  EXPECT_FALSE(survey(floor, {.radius = 0.0}).larger_part.has_value());
}

TEST(FloorSurvey, TheNearestPlaceIsNamedFromFarAwayToo) {
  const OccupancyGrid floor = drawn({"#####",  //
                                     "#...#",  //
                                     "#...#",  //
                                     "#####"});
  const auto from = [&](double x, double y) {
    return refusal(floor, {.radius = 0.0, .start = Vector2d(x, y)});
  };
  const Vector2d right = floor.frame.centre(3, 1), left = floor.frame.centre(1, 1);
  const auto place = [](const Vector2d& at) {
    return fmt::format("({:.3f}, {:.3f})", at.x(), at.y());
  };
  EXPECT_THAT(from(1e300, -1e300), HasSubstr(place(right)));
  EXPECT_THAT(from(-1e300, -1e300), HasSubstr(place(left)));
  EXPECT_THAT(from(-5.0, -7.0), HasSubstr(place(left)));
}

TEST(FloorSurvey, ALeakIsWhereFreeFloorBordersOnUnknownOrTheEdge) {
  const FloorSurvey found = survey(drawn({"###########",  //
                                          "#.........#",  //
                                          "#.........?",  //
                                          "#.........?",  //
                                          "#.........#",  //
                                          "###.#######"}),
                                   {.radius = 0.4});
  ASSERT_THAT(found.leaks, SizeIs(2));
  EXPECT_EQ(found.leaks[0].length, 2.0);
  EXPECT_FALSE(found.leaks[0].at_edge);
  EXPECT_EQ(found.leaks[0].at.x(), 9.5);
  EXPECT_EQ(found.leaks[1].length, 1.0);
  EXPECT_TRUE(found.leaks[1].at_edge);
  EXPECT_EQ(found.leaks[1].at, Vector2d(3.5, 0.5));
}

TEST(FloorSurvey, AWallNotTheEdgeKeepsTheFloorTight) {
  const FloorSurvey found = survey(drawn({"#####", "#...#", "#...#", "#...#", "#####"}), {});
  EXPECT_THAT(found.leaks, SizeIs(0));
  EXPECT_EQ(found.start, Vector2d(2.5, 2.5));
  EXPECT_DOUBLE_EQ(found.start_clearance, 1.5);
  EXPECT_EQ(found.covered_area, 9.0);
}

TEST(FloorSurvey, ABodyDoesNotPassADoorThatIsTooNarrow) {
  const OccupancyGrid grid = drawn({"#########",  //
                                    "#...#...#",  //
                                    "#.......#",  //
                                    "#...#...#",  //
                                    "#########"});
  EXPECT_EQ(survey(grid, {.radius = 0.5}).standing_area, 19.0);
  const FloorSurvey wide = survey(grid, {.radius = 0.6, .start = Vector2d(6.4, 2.6)});
  EXPECT_EQ(wide.unreachable_parts, 1);
  EXPECT_EQ(wide.standing_area, 2.0);  // the middle, and that before the door, 0.7 m from its posts
  EXPECT_EQ(wide.unreachable_area, 2.0);
  EXPECT_EQ(wide.start, Vector2d(6.4, 2.6));
}

TEST(FloorSurvey, AStartThatDoesNotFitIsRefusedWithTheNearestThatDoes) {
  const OccupancyGrid grid = drawn({"######", "#....#", "#....#", "#....#", "#...?#", "######"});
  EXPECT_THAT(refusal(grid, {.radius = 1.0, .start = Vector2d(0.5, 3.5)}), HasSubstr("in a wall"));
  EXPECT_THAT(refusal(grid, {.radius = 1.0, .start = Vector2d(4.5, 1.5)}), HasSubstr("unknown"));
  EXPECT_THAT(refusal(grid, {.radius = 1.0, .start = Vector2d(-1e300, 3.5)}), HasSubstr("outside"));
  EXPECT_THAT(refusal(grid, {.radius = 1.0, .start = Vector2d(1.5, 3.5)}),
              HasSubstr("too close to a wall for a body with a radius of 1 m; the nearest place "
                        "where it fits is (2.500, 3.500)"));
}

TEST(FloorSurvey, AStartThatIsNoNumberIsRefused) {
  EXPECT_THAT(refusal(drawn({"###", "#.#", "###"}), {.radius = 0.1, .start = Vector2d(1.5, NAN)}),
              HasSubstr("finite"));
}

TEST(FloorSurvey, AFloorWithoutRoomIsRefused) {
  EXPECT_THAT(refusal(drawn({"##", "#?"}), {}), HasSubstr("no free cell"));
  EXPECT_THAT(refusal(drawn({"###", "#.#", "###"}), {.radius = 1.0}),
              HasSubstr("the widest place has room for one of 0.5 m"));
}

}  // namespace
}  // namespace cairn
