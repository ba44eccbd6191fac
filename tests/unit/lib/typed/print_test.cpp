// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/typed/print.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "cairn/typed/build.hpp"
#include "cairn/typed/run.hpp"

namespace cairn {
namespace {

using symbols::L;
using symbols::X;
using ::testing::HasSubstr;
using ::testing::StartsWith;

Graph small() {
  Graph graph;
  graph.add(X(0), Pose2());
  graph.add(X(1), Pose2(1.0, 0.5, 0.25));
  graph.add(L(0), Point2(2.0, -1.0));
  graph.add(Between(X(0), X(1), Pose2(1.0, 0.5, 0.25)), Information::unit(3));
  graph.add(Observation(X(1), L(0), Point2(1.0, -1.5)), Information::unit(2));
  graph.set_fixed(0);
  return graph;
}

TEST(Print, ShowsVariablesAndFactorsWithTheirSymbols) {
  std::ostringstream text;
  text << small();
  EXPECT_EQ(text.str(),
            "3 variables (2 VERTEX_SE2, 1 VERTEX_XY), 2 factors (1 EDGE_SE2, 1 EDGE_SE2_XY)\n"
            "  VERTEX_SE2 x0: 0 0 0  (fixed)\n"
            "  VERTEX_SE2 x1: 1 0.5 0.25\n"
            "  VERTEX_XY l0: 2 -1\n"
            "  EDGE_SE2 x0 x1: 1 0.5 0.25\n"
            "  EDGE_SE2_XY x1 l0: 1 -1.5\n");
}

TEST(Print, IsShortForLargeGraphsUnlessAskedForAll) {
  Graph graph;
  for (int k = 0; k < 30; ++k) graph.add(k, Point2());
  EXPECT_THAT(to_string(graph), HasSubstr("  ... 10 more\n"));
  std::ostringstream text;
  print(graph, text);
  EXPECT_THAT(text.str(), HasSubstr("VERTEX_XY 29: 0 0\n"));
  EXPECT_EQ(to_string(Graph()), "0 variables, 0 factors\n");
}

TEST(Print, SumsUpAnOptimisation) {
  Graph graph = small();
  std::ostringstream text;
  text << optimize_from_states(graph);
  EXPECT_THAT(text.str(), StartsWith("converged: chi2 0.202069 -> "));
}

}  // namespace
}  // namespace cairn
