// SPDX-License-Identifier: BSD-3-Clause
// The published data sets, with the counts that their README gives.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>
#include <ostream>

#include "formats/reading.hpp"
#include "support/data.hpp"

namespace cairn::test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

struct DataSet {
  std::string file;
  std::string format;
  std::string pose;
  int poses, landmarks;
  int relative, observations;
  bool vertices = true;
  int repaired = 0;
};
void PrintTo(const DataSet& set, std::ostream* out) { *out << set.file; }

DataSet planar(std::string file, std::string format, int poses, int edges, bool vertices = true) {
  return {std::move(file), std::move(format), "VERTEX_SE2", poses, 0, edges, 0, vertices};
}
DataSet spatial(std::string file, std::string format, int poses, int edges, bool vertices = true) {
  return {std::move(file), std::move(format), "VERTEX_SE3:QUAT", poses, 0, edges, 0, vertices};
}

const DataSet kDataSets[] = {
    planar("pose2d/M3500.g2o", "g2o", 3500, 5453),
    planar("pose2d/M3500a.graph", "toro", 3500, 5453),
    planar("pose2d/M3500c.graph", "toro", 3500, 5453),
    planar("pose2d/manhattanOlson3500.g2o", "g2o", 3500, 5598),
    planar("pose2d/manhattanOlson3500_isam.txt", "isam", 3500, 5598, false),
    planar("pose2d/intel1228_carlone.g2o", "g2o", 1228, 1483),
    planar("pose2d/intel943.g2o", "g2o", 943, 1837),
    planar("pose2d/intel1728.g2o", "g2o", 1728, 2512),
    planar("pose2d/intel729_slampp.graph", "toro", 729, 3070),
    planar("pose2d/MITb.g2o", "g2o", 808, 827),
    planar("pose2d/killian1941_slampp.graph", "toro", 1941, 3995),
    planar("pose2d/killian5489_glc.g2o", "g2o", 5489, 7626),
    planar("pose2d/eecs_flat_glc.g2o", "g2o", 615, 2134),
    planar("pose2d/duderstadt_flat_glc.g2o", "g2o", 545, 1800),
    planar("pose2d/FR079.graph", "toro", 989, 1217),
    planar("pose2d/FR079.g2o", "g2o", 989, 1217),
    planar("pose2d/CSAIL.graph", "toro", 1045, 1172),
    planar("pose2d/CSAIL_sesync.g2o", "g2o", 1045, 1172, false),
    planar("pose2d/city10000.g2o", "g2o", 10000, 20687),
    planar("pose2d/city10000_isam.txt", "isam", 10000, 20687, false),
    planar("pose2d/10kHog-man.graph.gz", "toro", 10000, 64311),
    planar("pose2d/10K.g2o.gz", "g2o", 10000, 64311),
    planar("pose2d/w20000_isam.txt", "isam", 20061, 26831, false),
    planar("pose2d/ring.g2o", "g2o", 434, 459),
    planar("pose2d/kitti_00.g2o", "g2o", 4541, 4677, false),
    planar("pose2d/kitti_02.g2o", "g2o", 4661, 4703, false),
    planar("pose2d/kitti_06.g2o", "g2o", 1101, 1150, false),
    spatial("pose3d/sphere2500.g2o", "g2o", 2500, 4949),
    spatial("pose3d/sphere2500_isam.txt", "isam", 2500, 4949, false),
    spatial("pose3d/sphere400_isam.txt", "isam", 400, 779, false),
    spatial("pose3d/sphere2500a.g2o", "g2o", 2500, 9799),
    spatial("pose3d/sphere_bignoise_vertex3.g2o", "g2o", 2200, 8647),
    spatial("pose3d/torus3D.g2o.gz", "g2o", 5000, 9048),
    spatial("pose3d/torus10000_isam.txt", "isam", 10000, 22280, false),
    spatial("pose3d/parking-garage.g2o", "g2o", 1661, 6275),
    {"pose3d/cubicle.g2o", "g2o", "VERTEX_SE3:QUAT", 5750, 0, 16869, 0, true, 5021},
    spatial("pose3d/smallGrid3D.g2o", "g2o", 125, 297),
    spatial("pose3d/tinyGrid3D.g2o", "g2o", 9, 11),
    spatial("pose3d/eecs_glc.g2o", "g2o", 615, 2134),
    spatial("pose3d/duderstadt_glc.g2o", "g2o", 545, 1800),
    {"landmark2d/victoriaPark_isam.txt", "isam", "VERTEX_SE2", 6969, 151, 6968, 3640, false},
    {"landmark2d/victoriaPark_slampp.graph", "toro", "VERTEX_SE2", 6969, 151, 6968, 3640},
    {"landmark2d/cityTrees10000_isam.txt", "isam", "VERTEX_SE2", 10000, 100, 9999, 4443, false},
    planar("groundtruth/manhattanOlson3500_groundtruth_isam.txt", "isam", 3500, 5598, false),
    planar("groundtruth/city10000_groundtruth_isam.txt", "isam", 10000, 20687, false),
    {"groundtruth/cityTrees10000_groundtruth_isam.txt", "isam", "VERTEX_SE2", 10000, 100, 9999,
     4443, false},
    spatial("groundtruth/sphere2500_groundtruth_isam.txt", "isam", 2500, 4949, false),
    planar("groundtruth/ring_groundtruth.g2o", "g2o", 434, 459),
    planar("groundtruth/ring_poses_groundtruth.txt", "table", 434, 0),
    planar("groundtruth/manhattanOlson3500_nodes_groundTruth.dat", "table", 3500, 0),
    spatial("groundtruth/kitti_00_poses.txt", "kitti", 4541, 0),
};

struct Loaded {
  Graph graph;
  ReadReport report;
};
Loaded load(const std::string& file, const ReadOptions& options = {}) {
  Loaded loaded;
  loaded.graph = read_graph(data_folder() / file, registry(), options, loaded.report);
  return loaded;
}

class PublishedData : public testing::TestWithParam<DataSet> {};

TEST_P(PublishedData, HasTheCountsOfItsReadme) {
  CAIRN_NEEDS_DATA();
  const DataSet& expected = GetParam();
  const auto [graph, report] = load(expected.file, {.repair_information = expected.repaired > 0});
  EXPECT_EQ(report.format, expected.format);
  EXPECT_EQ(report.repaired, expected.repaired);
  EXPECT_TRUE(report.skipped.empty());

  std::map<std::string_view, int> variables;
  for (int v = 0; v < graph.variable_count(); ++v) ++variables[graph.type(v).tag()];
  EXPECT_EQ(variables[expected.pose], expected.poses);
  EXPECT_EQ(graph.variable_count(), expected.poses + expected.landmarks);
  EXPECT_EQ(graph.id(0), 0);
  EXPECT_EQ(graph.id(graph.variable_count() - 1), graph.variable_count() - 1);

  int relative = 0;
  for (const FactorPool& pool : graph.factor_pools()) {
    if (pool.type->is_relative()) relative += static_cast<int>(pool.size());
  }
  EXPECT_EQ(relative, expected.relative);
  EXPECT_EQ(graph.factor_count(), expected.relative + expected.observations);

  const bool made = std::ranges::any_of(report.notes, [](const std::string& note) {
    return note.starts_with("the file has no vertices");
  });
  EXPECT_EQ(made, !expected.vertices);
}

TEST_P(PublishedData, ReadsBackFromG2oToTheLastBit) {
  CAIRN_NEEDS_DATA();
  const Graph graph = load(GetParam().file, {.repair_information = GetParam().repaired > 0}).graph;
  EXPECT_EQ(difference(graph, read("g2o", write("g2o", graph)).graph), "");
}

INSTANTIATE_TEST_SUITE_P(All, PublishedData, testing::ValuesIn(kDataSets), [](const auto& test) {
  std::string name = test.param.file;
  for (char& c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  }
  return name;
});

TEST(PublishedFiles, Fr079IsOneGraphInBothOrders) {
  CAIRN_NEEDS_DATA();
  const Graph toro = load("pose2d/FR079.graph").graph;
  const Graph g2o = load("pose2d/FR079.g2o").graph;
  const auto expect_near = [](std::span<const double> a, std::span<const double> b,
                              const std::string& what) {
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t k = 0; k < a.size(); ++k) {
      EXPECT_NEAR(a[k], b[k], 5.1e-6 * std::max(std::abs(a[k]), 1e-3)) << what << ", number " << k;
    }
  };
  ASSERT_EQ(toro.factor_count(), g2o.factor_count());
  for (int v = 0; v < toro.variable_count(); ++v) {
    expect_near(toro.state(v), g2o.state(v), toro.describe_variable(v));
  }
  for (int f = 0; f < toro.factor_count(); ++f) {
    ASSERT_EQ(toro.describe_factor(f), g2o.describe_factor(f));
    expect_near(toro.measurement(f), g2o.measurement(f), toro.describe_factor(f));
    expect_near(toro.information(f), g2o.information(f), toro.describe_factor(f));
  }
}

TEST(PublishedFiles, VictoriaParkIsOneWorldInBothFormats) {
  CAIRN_NEEDS_DATA();
  const Graph isam = load("landmark2d/victoriaPark_isam.txt").graph;
  const Graph toro = load("landmark2d/victoriaPark_slampp.graph").graph;
  ASSERT_EQ(isam.variable_count(), toro.variable_count());
  for (int v = 0; v < isam.variable_count(); ++v) {
    ASSERT_EQ(isam.describe_variable(v), toro.describe_variable(v));
  }
  // One writes landmarks as range and bearing, the other as Cartesian: the same pairs, at the same
  // places.
  using Seen = std::map<std::pair<Id, Id>, std::pair<double, double>>;
  Seen cartesian, polar;
  const auto collect = [](const Graph& graph, Seen& seen, auto to_xy) {
    for (int f = 0; f < graph.factor_count(); ++f) {
      const auto ends = graph.factor_variables(f);
      const auto z = graph.measurement(f);
      if (z.size() == 2) seen[{graph.id(ends[0]), graph.id(ends[1])}] = to_xy(z[0], z[1]);
    }
  };
  collect(isam, cartesian, [](double x, double y) { return std::pair(x, y); });
  collect(toro, polar, [](double bearing, double range) {
    return std::pair(range * std::cos(bearing), range * std::sin(bearing));
  });
  ASSERT_EQ(cartesian.size(), polar.size());
  for (const auto& [ends, xy] : cartesian) {
    ASSERT_TRUE(polar.count(ends));
    EXPECT_NEAR(xy.first, polar[ends].first, 2e-4);
    EXPECT_NEAR(xy.second, polar[ends].second, 2e-4);
  }
}

TEST(PublishedFiles, InitialChi2IsThatOfTheReadme) {
  CAIRN_NEEDS_DATA();
  EXPECT_NEAR(chi2(load("pose2d/manhattanOlson3500.g2o").graph), 69142.9, 0.05);
  EXPECT_NEAR(chi2(load("pose2d/intel943.g2o").graph), 1331.5, 0.05);
  EXPECT_NEAR(chi2(load("pose2d/intel1728.g2o").graph), 551.7, 0.05);
  EXPECT_NEAR(chi2(load("pose2d/MITb.g2o").graph), 4.4e9, 0.05e9);
}

TEST(PublishedFiles, NoiseFreeEdgesFitThePosesMadeFromThem) {
  CAIRN_NEEDS_DATA();
  // Root mean square of a whitened error of a few hundredths: rounding in the files, and nothing
  // else, such as another order of angles or a wrong direction of edges.
  for (const char* file :
       {"groundtruth/sphere2500_groundtruth_isam.txt", "groundtruth/city10000_groundtruth_isam.txt",
        "groundtruth/manhattanOlson3500_groundtruth_isam.txt",
        "groundtruth/cityTrees10000_groundtruth_isam.txt"}) {
    const Graph graph = load(file).graph;
    EXPECT_LT(std::sqrt(chi2(graph) / static_cast<double>(graph.residual_size())), 0.05) << file;
  }
}

TEST(PublishedFiles, CubicleIsRefusedWithoutRepair) {
  CAIRN_NEEDS_DATA();
  try {
    load("pose3d/cubicle.g2o");
    ADD_FAILURE() << "not refused";
  } catch (const std::exception& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("cubicle.g2o:5753: the information of EDGE_SE3:QUAT 1 2 is not positive "
                          "semidefinite"));
    EXPECT_THAT(error.what(), HasSubstr("ReadOptions::repair_information"));
  }
}

TEST(PublishedFiles, CollidingLandmarksAreReported) {
  CAIRN_NEEDS_DATA();
  EXPECT_THAT(load("landmark2d/cityTrees10000_isam.txt").report.notes,
              Contains("100 landmark ids are also ids of poses: landmark 0 became variable 10000, "
                       "and so on for all "
                       "100 landmarks"));
}

}  // namespace
}  // namespace cairn::test
