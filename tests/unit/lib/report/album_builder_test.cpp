// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/album_builder.hpp"

#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "support/planar_graph.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class AlbumBuilderTest : public ::testing::Test {
 protected:
  /// Poses from `first` on a line, `step` apart, whose odometry measures 1 m: chi2 falls as `step`
  /// nears 1.
  Graph line(Id first, int poses, double step, bool factors = true) {
    Graph graph;
    for (int k = 0; k < poses; ++k)
      graph.add_variable(types_.pose, first + k, std::array{step * k, 0.0, 0.0});
    for (int k = 1; factors && k < poses; ++k) {
      graph.add_factor(types_.relative_pose, std::array{k - 1, k}, std::array{1.0, 0.0, 0.0},
                       std::vector<double>{1, 0, 0, 1, 0, 1});
    }
    return graph;
  }
  Album album() {
    Album made;
    builder_.finish(made);
    return made;
  }
  static std::vector<std::string> names(const Scene& scene) {
    std::vector<std::string> all;
    for (const SceneEstimate& estimate : scene.estimates)
      all.push_back(std::string(to_string(estimate.role)) + " " + estimate.name);
    return all;
  }
  RunReport run_of(const std::string& graph, const std::string& output, double chi2) {
    RunReport report;
    report.run.name = "run";
    report.run.summary.final_chi2 = chi2;
    report.graph = graph;
    report.output = output;
    return report;
  }

  test::PlanarTypes types_;
  std::map<std::string, Graph> files_;  ///< what reports may name
  std::vector<std::string> notes_;
  AlbumBuilder builder_with_notes() {
    return AlbumBuilder([](const std::string&) { return std::optional<Graph>(); },
                        [this](const std::string& sentence) { notes_.push_back(sentence); });
  }
  AlbumBuilder builder_{[this](const std::string& file) -> std::optional<Graph> {
                          const auto there = files_.find(file);
                          if (there == files_.end()) return std::nullopt;
                          return there->second.clone();
                        },
                        [this](const std::string& sentence) { notes_.push_back(sentence); }};
};

TEST_F(AlbumBuilderTest, GraphsWithTheSameIdsAreLaidOverTheFirst) {
  builder_.add_graph("maps/a.g2o", "a", line(0, 5, 1.5));
  builder_.add_graph("b.g2o", "b", line(0, 5, 1.0));
  builder_.add_graph("c.g2o", "c", line(0, 5, 1.2));
  builder_.add_graph("other.g2o", "other", line(10, 4, 1.0));
  const Album made = album();
  ASSERT_THAT(made.scenes, SizeIs(2));
  EXPECT_EQ(made.scenes[0].name, "a.g2o");
  EXPECT_THAT(names(made.scenes[0]), ElementsAre("peer a", "estimate b", "peer c"));
  EXPECT_THAT(names(made.scenes[1]), ElementsAre("estimate other"));
  EXPECT_NEAR(made.scenes[0].estimates[0].chi2, 4 * 0.25, 1e-12);
  EXPECT_THAT(notes_, IsEmpty());
}

TEST_F(AlbumBuilderTest, OfTwoGraphsTheFirstIsWhatTheOtherBeganWith) {
  builder_.add_graph("a.g2o", "a", line(0, 5, 1.5));
  builder_.add_graph("b.g2o", "b", line(0, 5, 1.0));
  EXPECT_THAT(names(album().scenes[0]), ElementsAre("initial a", "estimate b"));
}

TEST_F(AlbumBuilderTest, GraphsThatAreKeptApartStandByThemselves) {
  builder_.keep_apart();
  builder_.add_graph("a.g2o", "a", line(0, 5, 1.5));
  builder_.add_graph("b.g2o", "b", line(0, 5, 1.0));
  const Album made = album();
  ASSERT_THAT(made.scenes, SizeIs(2));
  EXPECT_THAT(names(made.scenes[0]), ElementsAre("estimate a"));
  EXPECT_THAT(names(made.scenes[1]), ElementsAre("estimate b"));
  EXPECT_EQ(made.scenes[1].name, "b");
}

TEST_F(AlbumBuilderTest, TheFirstTrajectoryIsTheTruth) {
  builder_.add_graph("t.tum", "t", line(0, 4, 1.1, false));  // comes after graphs all the same
  builder_.add_graph("u.tum", "u", line(0, 3, 1.2, false));
  builder_.add_graph("a.g2o", "a", line(0, 5, 1.0));
  const Album made = album();
  ASSERT_THAT(made.scenes, SizeIs(1));
  EXPECT_THAT(names(made.scenes[0]), ElementsAre("estimate a", "truth t", "peer u"));
}

TEST_F(AlbumBuilderTest, ATrajectoryLiesOverTheGraphThatHasMostOfItsPoses) {
  builder_.add_graph("a.g2o", "a", line(0, 8, 1.0));
  builder_.add_graph("sparse.g2o", "sparse", line(0, 4, 1.0));
  builder_.add_graph("t.tum", "t", line(0, 8, 1.1, false));
  builder_.add_graph("u.tum", "u", line(0, 3, 1.1, false));  // in both: with the last
  const Album made = album();
  ASSERT_THAT(made.scenes, SizeIs(2));
  EXPECT_THAT(names(made.scenes[0]), ElementsAre("estimate a", "truth t"));
  EXPECT_THAT(names(made.scenes[1]), ElementsAre("estimate sparse", "peer u"));
  EXPECT_THAT(notes_, IsEmpty());
}

TEST_F(AlbumBuilderTest, ATruthThatIsGivenMakesTrajectoriesPeers) {
  builder_.add_graph("a.g2o", "a", line(0, 5, 1.0));
  builder_.add_graph("t.tum", "t", line(0, 4, 1.1, false));
  builder_.set_truth("truth.tum", line(0, 5, 1.05, false));
  EXPECT_THAT(names(album().scenes[0]), ElementsAre("estimate a", "peer t", "truth ground truth"));
}

TEST_F(AlbumBuilderTest, ATruthOfOtherPosesIsRefused) {
  builder_.add_graph("a.g2o", "a", line(0, 5, 1.0));
  builder_.set_truth("truth.tum", line(50, 5, 1.0, false));
  EXPECT_THROW(album(), Error);
}

TEST_F(AlbumBuilderTest, ATrajectoryWithoutAGraphStandsByItself) {
  builder_.add_graph("a.g2o", "a", line(0, 5, 1.0));
  builder_.add_graph("t.tum", "t", line(70, 4, 1.0, false));
  EXPECT_THAT(album().scenes, SizeIs(2));
}

TEST_F(AlbumBuilderTest, ARunBringsItsGraphAndItsEstimate) {
  files_.emplace("a.g2o", line(0, 5, 1.5));
  files_.emplace("out.g2o", line(0, 5, 1.0));
  builder_.add_report("r.json", run_of("a.g2o", "out.g2o", 0.0));
  const Album made = album();
  ASSERT_THAT(made.scenes, SizeIs(1));
  EXPECT_THAT(names(made.scenes[0]), ElementsAre("initial a.g2o", "estimate out.g2o"));
  EXPECT_EQ(made.scenes[0].estimates[1].run, 0);
  EXPECT_THAT(made.scenes[0].runs, SizeIs(1));
}

TEST_F(AlbumBuilderTest, OneRunIsShownOnce) {
  builder_.add_graph("a.g2o", "a", line(0, 5, 1.0));
  builder_.add_report("r.json", run_of("a.g2o", "", 2.0));
  builder_.add_report("again.json", run_of("a.g2o", "", 2.0));
  builder_.add_report("other.json", run_of("a.g2o", "", 3.0));
  EXPECT_THAT(album().scenes[0].runs, SizeIs(2));
}

TEST_F(AlbumBuilderTest, ARunWhoseGraphIsGoneShowsItsCurvesAndSaysSo) {
  RunReport report = run_of("gone.g2o", "out.g2o", 2.0);
  report.has_covariances = true;
  builder_.add_report("runs/r.json", report);
  const Album made = album();
  ASSERT_THAT(made.scenes, SizeIs(1));
  EXPECT_EQ(made.scenes[0].name, "r.json");
  ASSERT_THAT(notes_, SizeIs(2));
  EXPECT_THAT(notes_[0], HasSubstr("its graph gone.g2o is not there"));
  EXPECT_THAT(notes_[1], HasSubstr("its covariances are not shown"));
  EXPECT_EQ(made.notes, notes_);
}

TEST_F(AlbumBuilderTest, CovariancesBecomeThoseOfPositions) {
  files_.emplace("out.g2o", line(0, 3, 1.0));
  builder_.add_graph("a.g2o", "a", line(0, 3, 1.5));
  RunReport report = run_of("a.g2o", "out.g2o", 0.0);
  report.has_covariances = true;
  report.covariances = {{0, std::vector<double>(9, 0.0)},  // held
                        {2, {0.5, 0.1, 0, 0.1, 0.25, 0, 0, 0, 0.01}},
                        {9, {1, 0, 0, 0, 1, 0, 0, 0, 1}}};  // of no variable
  builder_.add_report("r.json", report);
  const Album made = album();
  const SceneEstimate& estimate = made.scenes[0].estimates.back();
  EXPECT_THAT(estimate.covariance_variables, ElementsAre(2));
  EXPECT_THAT(estimate.covariance_upper, ElementsAre(0.5f, 0.1f, 0.25f));
}

TEST_F(AlbumBuilderTest, CovariancesMayComeWithTheGraph) {
  const std::vector<ReportedCovariance> covariances = {
      {2, {0.5, 0.1, 0, 0.1, 0.25, 0, 0, 0, 0.01}}};
  builder_.add_graph("a.g2o", "a", line(0, 3, 1.5));
  builder_.add_graph("b.g2o", "b", line(0, 3, 1.0), covariances);
  const Album made = album();
  const SceneEstimate& estimate = made.scenes[0].estimates.back();
  EXPECT_EQ(estimate.name, "b");
  EXPECT_THAT(estimate.covariance_variables, ElementsAre(2));
  EXPECT_THAT(estimate.covariance_upper, ElementsAre(0.5f, 0.1f, 0.25f));
  EXPECT_THAT(made.scenes[0].estimates.front().covariance_variables, IsEmpty());
}

/// The truth is the estimate, turned by 0.7 rad and moved: what is shown is where the truth is.
TEST_F(AlbumBuilderTest, EstimatesAreAlignedToTheTruth) {
  const double c = std::cos(0.7), s = std::sin(0.7);
  Graph estimate = line(0, 5, 1.0), truth;
  for (int k = 0; k < 5; ++k) {  // not all on a line
    const double y = k == 2 ? 0.5 : 0.0;
    estimate.set_state(k, std::array{1.0 * k, y, 0.1 * k});
    truth.add_variable(types_.pose, k,
                       std::array{3 + c * k - s * y, -2 + s * k + c * y, 0.1 * k + 0.7});
  }
  const std::vector<ReportedCovariance> covariances = {{0, {4, 0, 0, 0, 1, 0, 0, 0, 0.01}}};
  builder_.add_graph("a.g2o", "a", std::move(estimate), covariances);
  builder_.set_truth("truth.g2o", truth.clone());
  builder_.align_to_truth();
  const Album made = album();
  const SceneEstimate &shown = made.scenes[0].estimates[0], &over = made.scenes[0].estimates[1];
  ASSERT_EQ(over.role, EstimateRole::truth);
  for (std::size_t k = 0; k < shown.positions.size(); ++k)
    EXPECT_NEAR(shown.positions[k], over.positions[k], 1e-6) << k;  // orientations are floats
  for (std::size_t k = 0; k < shown.orientation.size(); ++k)
    EXPECT_NEAR(shown.orientation[k], over.orientation[k], 1e-6) << k;
  const float expected[] = {float(4 * c * c + s * s), float(3 * c * s), float(4 * s * s + c * c)};
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_NEAR(shown.covariance_upper[k], expected[k], 1e-5) << k;
}

TEST_F(AlbumBuilderTest, APlanarAndASpatialGraphAreSaidToBeSo) {
  Registry registry;
  if (!registry.has("variable", "VERTEX_SE3:QUAT")) GTEST_SKIP() << "built without slam3d";
  const auto spatial = [&](double height) {
    Graph graph;
    for (int k = 0; k < 5; ++k)
      graph.add_variable(registry.variable_type("VERTEX_SE3:QUAT"), k,
                         std::array{1.0 * k, 0.0, height * k, 0.0, 0.0, 0.0, 1.0});
    return graph;
  };
  builder_.add_graph("a.g2o", "a", line(0, 5, 1.0));
  builder_.add_graph("flat.tum", "flat", spatial(0.0));
  album();
  EXPECT_THAT(notes_, IsEmpty());  // nothing of it is lost
  AlbumBuilder planar(builder_with_notes()), in_space(builder_with_notes());
  Album made;
  planar.add_graph("a.g2o", "a", line(0, 5, 1.0));
  planar.set_truth("truth.tum", spatial(0.1));
  planar.finish(made);
  EXPECT_THAT(notes_, ElementsAre("truth.tum: is in space, a.g2o of the plane: x, y and the "
                                  "heading are shown alone"));
  notes_.clear();
  in_space.add_graph("b.tum", "b", spatial(0.1));
  in_space.set_truth("truth.g2o", line(0, 5, 1.0, false));
  in_space.finish(made);
  EXPECT_THAT(notes_,
              ElementsAre("truth.g2o: is of the plane, b.tum in space: it is shown at z = 0"));
}

TEST_F(AlbumBuilderTest, TakesOneComparison) {
  files_.emplace("a.g2o", line(0, 5, 1.0));
  builder_.add_report("b.json", BenchReport{"{the text}", {"a.g2o"}});
  const Album made = album();
  EXPECT_EQ(made.bench, "{the text}");
  EXPECT_THAT(made.scenes, SizeIs(1));
}

TEST_F(AlbumBuilderTest, RefusesASecondComparison) {
  builder_.add_report("b.json", BenchReport{"{}", {}});
  builder_.add_report("c.json", BenchReport{"{}", {}});
  EXPECT_THROW(album(), Error);
}

TEST(ShortName, IsTheFileWithoutItsFolder) {
  EXPECT_EQ(short_name("maps/sphere.g2o"), "sphere.g2o");
  EXPECT_EQ(short_name("@city:poses=5"), "@city:poses=5");
  EXPECT_EQ(short_name("-"), "standard input");
}

}  // namespace
}  // namespace cairn
