// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/graph_survey.hpp"

#include <array>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/planar_graph.hpp"

namespace cairn {
namespace {

using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;

const std::vector<double> kUnit3 = {1, 0, 0, 1, 0, 1};

/// Poses one metre apart on a line, and factors between them that measure what is there, but for
/// an error along the line.
class GraphSurveyTest : public ::testing::Test {
 protected:
  int pose(Id id) { return graph_.add_variable(types_.pose, id, std::array{double(id), 0.0, 0.0}); }
  /// A factor from a to b whose chi2 is error².
  void between(int a, int b, double error = 0.0) {
    const double apart = static_cast<double>(graph_.id(b) - graph_.id(a));
    graph_.add_factor(types_.relative_pose, std::array{a, b}, std::array{apart + error, 0.0, 0.0},
                      kUnit3);
  }
  /// Poses 0 … n-1 in a chain; each factor with the same error.
  void chain(int n, double error) {
    for (int k = 0; k < n; ++k) pose(k);
    for (int k = 1; k < n; ++k) between(k - 1, k, error);
  }
  std::vector<std::string> suspicions() const { return survey_graph(graph_).suspicions; }

  test::PlanarTypes types_;
  Graph graph_;
};

TEST_F(GraphSurveyTest, CountsWhatThereIs) {
  chain(4, 1.0);
  between(0, 3, 2.0);
  graph_.set_fixed(0);
  const int point = graph_.add_variable(types_.point, 100, std::array{2.0, 1.0});
  graph_.add_factor(types_.point_seen, std::array{2, point}, std::array{0.0, 1.5},
                    std::vector<double>{1, 0, 1});

  const GraphSurvey s = survey_graph(graph_);
  ASSERT_THAT(s.variables, SizeIs(2));
  EXPECT_EQ(s.variables[0].tag, "VERTEX_SE2");
  EXPECT_EQ(s.variables[0].count, 4);
  EXPECT_EQ(s.variables[0].tangent_size, 3);
  EXPECT_EQ(s.variables[0].fixed, 1);
  EXPECT_EQ(s.variables[1].count, 1);
  EXPECT_EQ(s.variables[1].fixed, 0);
  ASSERT_THAT(s.factors, SizeIs(2));
  EXPECT_EQ(s.factors[0].tag, "EDGE_SE2");
  EXPECT_EQ(s.factors[0].count, 4);
  EXPECT_EQ(s.factors[0].residual_size, 3);
  EXPECT_NEAR(s.factors[0].chi2, 3 * 1.0 + 4.0, 1e-12);
  EXPECT_NEAR(s.factors[1].chi2, 0.25, 1e-12);
  EXPECT_NEAR(s.chi2, 7.25, 1e-12);
  EXPECT_EQ(s.odometry, 3);
  EXPECT_EQ(s.loops, 1);
  EXPECT_EQ(s.degrees_of_freedom, (4 * 3 + 2) - (3 * 3 + 2));
  EXPECT_EQ(s.gauge_freedoms, 0);  // pose 0 is fixed
  EXPECT_THAT(s.suspicions, IsEmpty());
}

TEST_F(GraphSurveyTest, ListsTheWorstFactorsByFallingChi2) {
  chain(8, 0.5);
  between(0, 2, 3.0);
  between(1, 5, 4.0);
  const GraphSurvey s = survey_graph(graph_);
  ASSERT_THAT(s.worst, SizeIs(5));
  EXPECT_EQ(s.worst[0].name, "EDGE_SE2 1 5");
  EXPECT_NEAR(s.worst[0].chi2, 16.0, 1e-12);
  EXPECT_EQ(s.worst[1].name, "EDGE_SE2 0 2");
  EXPECT_EQ(s.worst[2].name, "EDGE_SE2 0 1");  // of equal ones the first
}

TEST_F(GraphSurveyTest, AnEmptyGraphHasNothingToOptimise) {
  EXPECT_THAT(suspicions(), Contains(HasSubstr("there are no factors")));
  pose(0);
  pose(1);
  EXPECT_THAT(suspicions(), ElementsAre("there are no factors: nothing to optimise"));
}

TEST_F(GraphSurveyTest, NamesAVariableWithoutFactors) {
  chain(4, 0.5);
  between(0, 2, 0.5);
  graph_.add_variable(types_.point, 77, std::array{0.0, 0.0});
  const GraphSurvey s = survey_graph(graph_);
  EXPECT_THAT(s.gauge.unconstrained, SizeIs(1));
  EXPECT_THAT(s.suspicions, SizeIs(1));
  EXPECT_THAT(s.suspicions[0], StartsWith("1 variable without any factor"));
  EXPECT_THAT(s.suspicions[0], HasSubstr("VERTEX_XY 77"));
}

TEST_F(GraphSurveyTest, FindsPartsThatNoFactorJoins) {
  chain(6, 0.5);
  between(0, 2, 0.5);
  const int a = pose(6), b = pose(7), c = pose(8);
  between(a, b, 0.5);
  between(b, c, 0.5);
  between(a, c, 0.5);
  const GraphSurvey s = survey_graph(graph_);
  EXPECT_EQ(s.gauge.components, 2);
  EXPECT_EQ(s.gauge_freedoms, 2 * 3);
  EXPECT_EQ(s.chain_gaps, 1);  // 5 to 6
  EXPECT_THAT(s.suspicions, Contains(StartsWith("2 parts that no factor joins")));
  EXPECT_THAT(s.suspicions, Contains(HasSubstr("has 1 gap:")));
}

TEST_F(GraphSurveyTest, FindsDoubledFactorsWhicheverWayRound) {
  chain(4, 0.5);
  between(0, 3, 0.5);
  EXPECT_EQ(survey_graph(graph_).doubled, 0);
  between(3, 0, 0.5);
  between(1, 2, 0.5);
  const GraphSurvey s = survey_graph(graph_);
  EXPECT_EQ(s.doubled, 2);
  EXPECT_THAT(s.suspicions, Contains(StartsWith("2 factors on variables")));
}

TEST_F(GraphSurveyTest, TwoPriorsOnOneVariableAreNotDoubled) {
  chain(3, 0.5);
  between(0, 2, 0.5);
  for (int k = 0; k < 2; ++k)
    graph_.add_factor(types_.prior, std::array{0}, std::array{0.5, 0.0, 0.0}, kUnit3);
  EXPECT_EQ(survey_graph(graph_).doubled, 0);
}

TEST_F(GraphSurveyTest, FindsGapsInTheOdometryByIdNotByOrder) {
  const int c = pose(30), a = pose(10), b = pose(20);
  between(a, b, 0.5);
  between(b, c, 0.5);
  between(c, a, 0.5);
  EXPECT_EQ(survey_graph(graph_).chain_gaps, 0);
  const int d = pose(40), e = pose(50);
  between(a, d, 0.5);
  between(d, e, 0.5);
  const GraphSurvey s = survey_graph(graph_);
  EXPECT_EQ(s.chain_gaps, 1);  // 30 to 40
  EXPECT_THAT(s.suspicions, Contains(HasSubstr("has 1 gap:")));
}

TEST_F(GraphSurveyTest, FindsMoreUnknownsThanMeasurements) {
  chain(3, 0.0);
  EXPECT_EQ(survey_graph(graph_).degrees_of_freedom, 0);
  EXPECT_THAT(suspicions(), IsEmpty());
  graph_.add_variable(types_.pose, 3, std::array{3.0, 0.0, 0.0});
  const int point = graph_.add_variable(types_.point, 9, std::array{3.0, 1.0});
  graph_.add_factor(types_.point_seen, std::array{3, point}, std::array{0.0, 1.0},
                    std::vector<double>{1, 0, 1});
  graph_.add_factor(types_.point_seen, std::array{2, point}, std::array{1.0, 1.0},
                    std::vector<double>{1, 0, 1});
  EXPECT_EQ(survey_graph(graph_).degrees_of_freedom, -1);
  EXPECT_THAT(suspicions(), Contains(StartsWith("1 more unknowns than measurements")));
}

/// A landmark of which only one coordinate is measured, twice: each time one row counts.
TEST_F(GraphSurveyTest, CountsTheRankOfTheInformation) {
  chain(3, 0.0);
  const int point = graph_.add_variable(types_.point, 9, std::array{3.0, 1.0});
  for (const std::vector<double>& information :
       {std::vector<double>{1, 0, 0}, std::vector<double>{4, 2, 1}, std::vector<double>{1, 0, 1}})
    graph_.add_factor(types_.point_seen, std::array{2, point}, std::array{1.0, 1.0}, information);
  EXPECT_EQ(survey_graph(graph_).degrees_of_freedom, 1 + 1 + 2 - 2);
}

TEST_F(GraphSurveyTest, ComparesChi2WithItsDegreesOfFreedom) {
  chain(4, 1.0);
  between(0, 3, 1.0);
  const GraphSurvey fair = survey_graph(graph_);
  EXPECT_EQ(fair.degrees_of_freedom, 3);
  EXPECT_THAT(fair.suspicions, IsEmpty());

  between(0, 2, 100.0);
  EXPECT_THAT(suspicions(), Contains(StartsWith("chi2 is 1.67e+03 times")));

  Graph perfect;
  std::swap(perfect, graph_);
  chain(4, 0.0);
  between(0, 3, 0.1);
  EXPECT_THAT(suspicions(), Contains(StartsWith("chi2 is only 0.00333 times")));
}

TEST_F(GraphSurveyTest, SuspectsOutliersAmongManyFactors) {
  chain(102, 1.0);
  for (int k = 0; k < 4; ++k) between(k, k + 50, 4.0);
  EXPECT_THAT(suspicions(), Each(Not(HasSubstr("outliers"))));
  for (int k = 0; k < 3; ++k) between(k, k + 60, 8.0);
  // 3 · 64 + 2 · 16 of 101 + 4 · 16 + 3 · 64.
  EXPECT_THAT(suspicions(), Contains(StartsWith("the 5 worst of 108 factors make 63 % of chi2")));
}

}  // namespace
}  // namespace cairn
