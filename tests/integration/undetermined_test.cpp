// SPDX-License-Identifier: BSD-3-Clause
// What the measurements do not determine is named, in the same words by every command.
#include <sstream>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

using testing::HasSubstr;
using testing::Not;

class Undetermined : public testing::Test {
 protected:
  std::string file(const std::string& text) {
    const std::string name = folder_.file("graph.g2o");
    write_text(name, text);
    return name;
  }
  TemporaryFolder folder_;
};

/// A landmark of which one pose has measured the bearing.
const char* const kBearing =
    "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 7 1 0 0\nVERTEX_XY 2 4 4\nFIX 0\n"
    "EDGE_SE2 0 7 1 0 0 100 0 0 100 0 100\n"
    "EDGE_BEARING_RANGE_SE2_XY 7 2 0.95 5 400 0 0\n";

/// A landmark whose height nothing measures, and measurements without noise.
const char* const kHeight =
    "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nFIX 0\nVERTEX_SE3:QUAT 1 1 0 0 0 0 0 1\n"
    "VERTEX_TRACKXYZ 5 2.1 0.9 4\nPARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n"
    "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1 100 0 0 0 0 0 100 0 0 0 0 100 0 0 0 400 0 0 400 0 400\n"
    "EDGE_SE3_TRACKXYZ 0 5 0 2 1 0 100 0 0 100 0 0\n"
    "EDGE_SE3_TRACKXYZ 1 5 0 1 1 0 100 0 0 100 0 0\n";

/// Four poses behind one whose position alone is measured.
std::string hinged() {
  std::string text = "VERTEX_SE2 0 0 0 0\nFIX 0\nVERTEX_SE2 295 1 0 0\n";
  for (int k = 1; k <= 4; ++k)
    text += "VERTEX_SE2 " + std::to_string(295 + k) + " " + std::to_string(1 + k) + " 0 0\n";
  text +=
      "EDGE_SE2 0 295 1 0 0 100 0 0 100 0 100\n"
      "EDGE_SE2 296 295 -1 0 0 100 0 0 100 0 0\n";
  for (int k = 1; k < 4; ++k) {
    text += "EDGE_SE2 " + std::to_string(295 + k) + " " + std::to_string(296 + k) +
            " 1 0 0 100 0 0 100 0 100\n";
  }
  return text;
}

constexpr const char* kSentence =
    "VERTEX_XY 2 is free along its bearing from pose 7; it stays at the initial estimate";

/// The output without line breaks and the blanks that tables put in front.
std::string unwrapped(std::string text) {
  std::string all;
  for (const char c : text) {
    const bool blank = c == '\n' || c == ' ';
    if (!blank || all.empty() || all.back() != ' ') all += blank ? ' ' : c;
  }
  return all;
}

TEST_F(Undetermined, IsNamedByInfoAndEveryOptimizer) {
  const std::string name = file(kBearing);
  EXPECT_THAT(unwrapped(cairn({"info", name}).out), HasSubstr(kSentence));
  for (const char* optimizer : {"levenberg_marquardt", "dogleg", "ceres", "ceres_line_search"}) {
    if (!Registry().has("optimizer", optimizer)) continue;
    const Outcome outcome = cairn({"optimize", name, "--optimizer", optimizer});
    EXPECT_EQ(outcome.exit_code, 0) << optimizer << outcome.out;
    EXPECT_THAT(unwrapped(outcome.out), HasSubstr(kSentence)) << optimizer;
  }
  const Outcome outcome = cairn({"optimize", name, "--optimizer", "gauss_newton"});
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(unwrapped(outcome.out), HasSubstr(kSentence));
}

TEST_F(Undetermined, IsNoReasonForManyIterations) {
  const std::string name = file(kHeight);
  for (const char* optimizer : {"levenberg_marquardt", "dogleg", "ceres", "ceres_line_search"}) {
    if (!Registry().has("optimizer", optimizer)) continue;
    const Outcome outcome = cairn({"optimize", name, "--optimizer", optimizer, "--iterations", "15",
                                   "--initial", "as_given"});
    EXPECT_EQ(outcome.exit_code, 0) << optimizer << outcome.out;
    EXPECT_THAT(unwrapped(outcome.out),
                HasSubstr("VERTEX_TRACKXYZ 5 is free along (0, 0, 1); it stays at the initial "
                          "estimate"))
        << optimizer;
  }
}

TEST_F(Undetermined, HasNoCovariances) {
  for (const char* text : {kHeight, kBearing}) {
    const Outcome outcome = cairn({"marginals", file(text)});
    EXPECT_EQ(outcome.exit_code, 4);
    EXPECT_THAT(unwrapped(outcome.err), HasSubstr(" is free along "));
    EXPECT_THAT(unwrapped(outcome.err), Not(HasSubstr("initial estimate")));
  }
}

TEST_F(Undetermined, NamesPosesThatTurnTogether) {
  for (const char* command : {"info", "optimize"}) {
    EXPECT_THAT(unwrapped(cairn({command, file(hinged())}).out),
                HasSubstr("the 4 poses after 295 can turn about it; a prior or one more "
                          "measurement holds them"))
        << command;
  }
}

/// Poses along (0.6, 0.8, 0), of which two are turned, each with a measured position.
TEST_F(Undetermined, NamesTheLineAboutWhichPosesTurn) {
  const std::string text =
      "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 0.6 0.8 0 0 0 1 0\n"
      "VERTEX_SE3:QUAT 2 1.2 1.6 0 1 0 0 0\n"
      "EDGE_SE3:QUAT 0 1 0.6 0.8 0 0 0 1 0 100 0 0 0 0 0 100 0 0 0 0 100 0 0 0 400 0 0 400 0 400\n"
      "EDGE_SE3:QUAT 1 2 -0.6 -0.8 0 0 1 0 0 100 0 0 0 0 0 100 0 0 0 0 100 0 0 0 400 0 0 400 0 "
      "400\n"
      "EDGE_SE3_PRIORXYZ 0 0 0 0 100 0 0 100 0 100\n"
      "EDGE_SE3_PRIORXYZ 2 1.2 1.6 0 100 0 0 100 0 100\n";
  EXPECT_THAT(unwrapped(cairn({"info", file(text)}).out),
              HasSubstr("all 3 poses can turn about the line through pose 0 along (0.6, 0.8, 0); a "
                        "prior or one more measurement holds them"));
}

/// A map in space with one altitude is shifted, not tilted.
TEST_F(Undetermined, StaysAsItWasWhereOneAltitudeIsMeasured) {
  std::string text;
  const int places[][2] = {{0, 0}, {1, 0}, {2, 0}, {2, 1}, {2, 2}};
  for (int k = 0; k < 5; ++k) {
    const auto [x, y] = places[k];
    text += fmt::format("VERTEX_SE3:QUAT {} {} {} 0 0 0 0 1\n", k, x, y);
    if (k == 0) continue;
    text += fmt::format(
        "EDGE_SE3:QUAT {} {} {} {} 0 0 0 0 1 100 0 0 0 0 0 100 0 0 0 0 100 0 0 0 400 0 0 400 0 "
        "400\n",
        k - 1, k, x - places[k - 1][0], y - places[k - 1][1]);
  }
  text += "EDGE_SE3_PRIORXYZ 4 0 0 1 0 0 0 0 0 100\n";
  for (const char* optimizer : {"levenberg_marquardt", "dogleg"}) {
    SCOPED_TRACE(optimizer);
    const std::string out = folder_.file("out.g2o");
    const Outcome outcome = cairn(
        {"optimize", file(text), "--optimizer", optimizer, "--initial", "as_given", "-o", out});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_THAT(outcome.out, Not(HasSubstr("does not solve")));
    std::istringstream lines(read_text(out));
    std::string tag;
    for (int k = 0; k < 5; ++k) {
      int id = -1;
      double x[7];
      while (lines >> tag && tag != "VERTEX_SE3:QUAT") {
      }
      lines >> id;
      for (double& number : x) lines >> number;
      ASSERT_TRUE(lines) << k;
      const double expected[] = {double(places[id][0]), double(places[id][1]), 1, 0, 0, 0, 1};
      for (int c = 0; c < 7; ++c) EXPECT_NEAR(x[c], expected[c], 1e-5) << id << " " << c;
    }
  }
}

TEST_F(Undetermined, IsSingularOnlineWithTheNameWhateverTheEstimator) {
  const std::string lines =
      "VERTEX_SE2 0 0 0 0\nFIX 0\nNEW VERTEX_SE2 7\nEDGE_SE2 0 7 1 0 0 100 0 0 100 0 100\n"
      "VERTEX_XY 2 4 4\n"
      "EDGE_BEARING_RANGE_SE2_XY 7 2 0.95 5 400 0 0\nSOLVE\nQUIT\n";
  for (const char* estimator : {"batch", "periodic_batch", "incremental_cholesky", "incremental_qr",
                                "ekf", "eif", "seif"}) {
    if (!Registry().has("estimator", estimator)) continue;
    const Outcome outcome = cairn({"online", "--estimator", estimator}, {}, lines);
    EXPECT_THAT(outcome.out, HasSubstr(kSentence)) << estimator;
    EXPECT_THAT(outcome.out, HasSubstr("SINGULAR")) << estimator;
  }
}

TEST_F(Undetermined, IsOverWithTheNextMeasurement) {
  const std::string lines =
      "VERTEX_SE2 0 0 0 0\nFIX 0\nNEW VERTEX_SE2 7\nEDGE_SE2 0 7 1 0 0 100 0 0 100 0 100\n"
      "VERTEX_XY 2 4 4\n"
      "EDGE_BEARING_RANGE_SE2_XY 7 2 0.95 5 400 0 0\n"
      "EDGE_BEARING_RANGE_SE2_XY 0 2 0.8 5 400 0 0\nSOLVE\nQUIT\n";
  for (const char* estimator : {"batch", "periodic_batch", "incremental_cholesky", "incremental_qr",
                                "ekf", "eif", "seif"}) {
    if (!Registry().has("estimator", estimator)) continue;
    const Outcome outcome = cairn({"online", "--estimator", estimator}, {}, lines);
    const std::string end = outcome.out.substr(outcome.out.rfind("SINGULAR"));
    EXPECT_THAT(end, HasSubstr("OK")) << estimator << outcome.out;
  }
}

}  // namespace
}  // namespace cairn::test
