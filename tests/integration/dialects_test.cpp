// SPDX-License-Identifier: BSD-3-Clause
// Files of other programs, from the file to the estimate: each with the answer of a dense solution
// by hand.
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "integration/process.hpp"
#include "support/components.hpp"
#include "support/data.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// The program's words on one line: it folds them for the width of the output.
std::string unfolded(std::string text) {
  std::string out;
  for (const char c : text) {
    const bool blank = c == '\n' || c == ' ';
    if (!blank || out.empty() || out.back() != ' ') out += blank ? ' ' : c;
  }
  return out;
}

class Dialect : public ::testing::Test {
 protected:
  void SetUp() override { CAIRN_NEEDS("optimizer", "levenberg_marquardt"); }

  std::string write(const std::string& name, const std::string& text) {
    write_text(folder_.file(name), text);
    return folder_.file(name);
  }
  Outcome optimize(const std::string& file, Arguments more = {}) {
    Arguments words = {
        "optimize", file, "-o", folder_.file("best.g2o"), "--json", folder_.file("report.json")};
    words.insert(words.end(), more.begin(), more.end());
    return cairn(words);
  }
  /// The state of a variable of the estimate.
  std::vector<double> state(const std::string& id) const {
    for (const std::string& line : lines(read_text(folder_.file("best.g2o")))) {
      std::istringstream in(line);
      std::string tag, of;
      in >> tag >> of;
      if (!tag.starts_with("VERTEX") || of != id) continue;
      std::vector<double> numbers;
      for (double number; in >> number;) numbers.push_back(number);
      return numbers;
    }
    return {};
  }
  double chi2() const {
    return parse_json(read_text(folder_.file("report.json")))
        .at("chi2")
        .at("final")
        .to_number<double>();
  }
  void expect_state(const std::string& id, const std::vector<double>& expected) const {
    const std::vector<double> found = state(id);
    ASSERT_GE(found.size(), expected.size()) << id;
    for (std::size_t k = 0; k < expected.size(); ++k)
      EXPECT_NEAR(found[k], expected[k], 6e-6) << id << ", number " << k;
  }

  TemporaryFolder folder_;
};

TEST_F(Dialect, InformationOfACorridorInSixDigits) {
  const std::string file = write("corridor.g2o",
                                 "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nFIX 0\n"
                                 "EDGE_SE2 0 1 1 0 0 100 0 0 100 0 100\n"
                                 "EDGE_SE2 0 1 1.01 0 0.01 307121 -243387 -342143 192879 271141 "
                                 "1.6817e+07\n");
  const Outcome outcome = optimize(file);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  expect_state("1", {1.00624, -0.00484, 0.01});
  EXPECT_THAT(unfolded(outcome.err),
              HasSubstr("1 factor had information that was not positive "
                        "semidefinite by less than rounding changes its numbers"));
}

TEST_F(Dialect, SkippedVerticesTakeTheirFactorsAlong) {
  const std::string file =
      write("skipped.g2o",
            "VERTEX_SE2 0 0 0 0\nFIX 0\nVERTEX_SE2 1 1 0 0\n"
            "VERTEX_CORNER_XY 10 2 1\nEDGE_SE2 0 1 1 0 0 100 0 0 100 0 100\n"
            "EDGE_SE2_XY 0 10 2 1 100 0 100\nEDGE_SE2_XY 1 10 1 1 100 0 100\n");
  const Outcome outcome = optimize(file, {"--skip-unknown"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(
      unfolded(outcome.err),
      HasSubstr("2 lines left out, on vertices of skipped lines: the first is EDGE_SE2_XY 0 "
                "10 in line 6, on VERTEX_CORNER_XY 10 of line 4"));
  expect_state("1", {1, 0, 0});
  EXPECT_NEAR(chi2(), 0.0, 1e-20);
}

TEST_F(Dialect, EdgesWithoutInformation) {
  const std::string file =
      write("plain.g2o",
            "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1.1 0 0\nVERTEX_SE2 2 2.1 0.1 0\n"
            "EDGE_SE2 0 1 1 0 0\nEDGE_SE2 1 2 1 0 0\nEDGE_SE2 0 2 2.03 0 0\n");
  const Outcome refused = optimize(file);
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(unfolded(refused.err), HasSubstr("(--unit-information takes it as the identity)"));
  EXPECT_EQ(optimize(file, {"--unit-information"}).exit_code, 0);
  expect_state("1", {1.01, 0, 0});
  expect_state("2", {2.02, 0, 0});
  EXPECT_NEAR(chi2(), 0.0003, 1e-9);
}

TEST_F(Dialect, ToroWithVerticesThatAreOne) {
  const std::string file =
      write("equiv.graph",
            "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0\nVERTEX2 2 2 0.1 0\nVERTEX2 3 2.1 0 0\n"
            "EDGE2 0 1 1 0 0 100 0 100 400 0 0\nEDGE2 1 2 1 0 0 100 0 100 400 0 0\n"
            "EDGE2 0 3 2.1 0 0 100 0 100 400 0 0\nEQUIV 2 3\n");
  EXPECT_EQ(optimize(file).exit_code, 0);
  expect_state("1", {1.03333, 0, 0});
  expect_state("2", {2.06667, 0, 0});
  EXPECT_NEAR(chi2(), 1.0 / 3.0, 1e-9);
}

TEST_F(Dialect, ToroInSpace) {
  const std::string information = " 100 0 0 0 0 0 100 0 0 0 0 100 0 0 0 400 0 0 400 0 400\n";
  const std::string file = write("space.graph",
                                 "VERTEX3 0 0 0 0 0 0 0\nVERTEX3 1 1.1 0 0 0 0 0.1\n"
                                 "VERTEX3 2 2 0 0.1 0 0 0\nEDGE3 0 1 1 0 0 0 0 0" +
                                     information + "EDGE3 1 2 1 0 0 0 0 0" + information +
                                     "EDGE3 0 2 2.03 0 0 0 0 0" + information);
  EXPECT_EQ(optimize(file).exit_code, 0);
  expect_state("1", {1.01, 0, 0});
  expect_state("2", {2.02, 0, 0});
  EXPECT_NEAR(chi2(), 0.03, 1e-9);
  const std::string again = folder_.file("again.graph");
  ASSERT_EQ(cairn({"convert", file, again}).exit_code, 0);
  EXPECT_THAT(read_text(again), HasSubstr("VERTEX3 1 1.1 0 0 0 0 0."));
  EXPECT_EQ(optimize(again).exit_code, 0);
  EXPECT_NEAR(chi2(), 0.03, 1e-9);
}

constexpr const char* kTwoFixed =
    "VERTEX_SE2 0 0 0 0\nFIX 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 2 0 0\n"
    "EDGE_SE2 0 1 1 0 0 100 0 0 100 0 400\nEDGE_SE2 1 2 1 0 0 100 0 0 100 0 400\n"
    "VERTEX_SE2 10000 0 0 0\nFIX 10000\nVERTEX_SE2 10001 1 0 0\nVERTEX_SE2 10002 2 0 0\n"
    "EDGE_SE2 10000 10001 1 0 0 100 0 0 100 0 400\nEDGE_SE2 10001 10002 1 0 0 100 0 0 100 0 400\n"
    "EDGE_SE2 2 10000 1 5 1.5708 100 0 0 100 0 400\nEDGE_SE2 1 10002 2 7 1.5708 100 0 0 100 0 "
    "400\n";

TEST_F(Dialect, TwoFixedPosesThatContradictEachOtherAreNamed) {
  const std::string file = write("two.g2o", kTwoFixed);
  const std::string named =
      "VERTEX_SE2 0 and VERTEX_SE2 10000 are both fixed, and contradict each "
      "other";
  EXPECT_THAT(unfolded(cairn({"info", file}).out), HasSubstr(named));
  const Outcome outcome = optimize(file);
  EXPECT_THAT(unfolded(outcome.out + outcome.err), HasSubstr(named));
  std::string one(kTwoFixed);
  one.erase(one.find("FIX 10000\n"), 10);
  const std::string good = write("one.g2o", one);
  EXPECT_THAT(unfolded(cairn({"info", good}).out), Not(HasSubstr("contradict")));
  EXPECT_EQ(optimize(good).exit_code, 0);
  EXPECT_LT(chi2(), 1e-4);
}

TEST_F(Dialect, OneRobotOfTwo) {
  const std::string file =
      write("robot.g2o",
            "VERTEX_SE2 100 0 0 0\nVERTEX_SE2 101 1.1 0 0\nVERTEX_SE2 102 2 0.1 0\n"
            "EDGE_SE2 100 101 1 0 0 100 0 0 100 0 400\nEDGE_SE2 101 102 1 0 0 100 0 0 100 0 400\n"
            "EDGE_SE2 102 200 1 1 0 100 0 0 100 0 400\n"
            "EDGE_SE2 100 102 2.02 0 0 100 0 0 100 0 400\n");
  EXPECT_THAT(unfolded(optimize(file).err), HasSubstr("--skip-dangling leaves out what leads"));
  const Outcome outcome = optimize(file, {"--skip-dangling"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(unfolded(outcome.err), HasSubstr("1 line left out, on vertices that this file does "
                                               "not have: EDGE_SE2 102 200 in line 6"));
  expect_state("102", {2.01333, 0, 0});
  EXPECT_NEAR(chi2(), 0.0133333, 1e-6);
}

TEST_F(Dialect, ZeroInformationAndOddQuaternionsAreNoted) {
  const std::string zero = write("zero.g2o",
                                 "VERTEX_SE2 0 0 0 0\nFIX 0\nVERTEX_SE2 1 1.1 0 0\n"
                                 "EDGE_SE2 0 1 1 0 0 100 0 0 100 0 400\n"
                                 "EDGE_SE2 0 1 5 5 1 0 0 0 0 0 0\n");
  const Outcome outcome = optimize(zero);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(unfolded(outcome.err), HasSubstr("1 factor has zero information and no effect"));
  expect_state("1", {1, 0, 0});
  const std::string quaternions = write("angles.g2o",
                                        "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n"
                                        "VERTEX_SE3:QUAT 1 1 0 0 0.02 0.01 0.31 1\n");
  EXPECT_THAT(unfolded(cairn({"info", quaternions}).err),
              HasSubstr("1 quaternion is not of norm 1 and normalised (expected qx qy qz qw): "
                        "VERTEX_SE3:QUAT 1 in line 2 with the norm 1.04"));
}

TEST_F(Dialect, PointsFromEachOther) {
  const std::string file = write(
      "points.g2o",
      "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nFIX 0\nVERTEX_TRACKXYZ 1 1 0 0\nVERTEX_TRACKXYZ 2 2 0 "
      "0\nPARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\nPARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n"
      "EDGE_SE3_TRACKXYZ 0 1 0 1 0 0 100 0 0 100 0 100\n"
      "EDGE_SE3_TRACKXYZ 0 2 0 2 0.3 0 100 0 0 100 0 100\n"
      "EDGE_POINTXYZ 1 2 1 0 0 100 0 0 100 0 100\n");
  EXPECT_EQ(optimize(file).exit_code, 0);
  expect_state("1", {1, 0.1, 0});
  expect_state("2", {2, 0.2, 0});
  EXPECT_NEAR(chi2(), 3.0, 1e-9);
  EXPECT_THAT(read_text(folder_.file("best.g2o")), HasSubstr("EDGE_POINTXYZ 1 2 1 0 0 100 "));
}

// PyFactorGraph -----------------------------------------------------------------------------------

const std::string kPyfg =
    "VERTEX_SE2 0.0 A0 5 5 0.5\nVERTEX_SE2 1.5 A1 5.877583 5.479426 0.5\n"
    "VERTEX_SE2 2.5 A2 6.755165 5.958851 0.5\nVERTEX_XY L0 7.0 6.0\n"
    "EDGE_SE2 0.0 A0 A1 1.0 0.0 0.0 0.25 0.0 -0.0 0.5 -0.0 0.01\n"
    "EDGE_SE2 1.5 A1 A2 1.0 0.0 0.0 0.25 0.0 -0.0 0.5 -0.0 0.01\n";

TEST_F(Dialect, PyFactorGraphKeepsItsTruthBesideTheEstimate) {
  const std::string file = write("drive.pyfg", kPyfg);
  EXPECT_EQ(optimize(file).exit_code, 0);
  const std::string truth = folder_.file("truth.g2o"), start = folder_.file("start.g2o");
  ASSERT_EQ(cairn({"convert", file, start, "--ground-truth", truth}).exit_code, 0);
  EXPECT_THAT(read_text(truth), HasSubstr(" 5.877583 5.479426 0.5\n"));
  EXPECT_THAT(read_text(start), Not(HasSubstr("5.877583")));
  const auto ate = [&](const std::string& against) {
    const Outcome outcome = cairn({"evaluate", folder_.file("best.g2o"), against, "--json", "-"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return parse_json(outcome.out).at("ate").at("translation").to_number<double>();
  };
  EXPECT_NEAR(ate(file), 0.0, 1e-6);
  EXPECT_NEAR(ate(truth), 0.0, 1e-6);
  const Outcome without =
      cairn({"convert", start, folder_.file("x.g2o"), "--ground-truth", folder_.file("y.g2o")});
  EXPECT_EQ(without.exit_code, 2);
  EXPECT_THAT(without.err, HasSubstr("has no truth beside its states"));
}

TEST_F(Dialect, PyFactorGraphWithRangesIsRefusedByTheirNumber) {
  CAIRN_NEEDS_DATA();
  const std::string file = (data_folder() / "range" / "single_drone.pyfg").string();
  const Outcome refused = cairn({"info", file});
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(unfolded(refused.err),
              HasSubstr("EDGE_RANGE in 1754 lines: ranges are not read yet"));
  EXPECT_EQ(optimize(file, {"--skip-unknown"}).exit_code, 0);
  // Of the truth only the vertices are wanted.
  const Outcome compared = cairn({"evaluate", folder_.file("best.g2o"), file});
  EXPECT_EQ(compared.exit_code, 0) << compared.err;
  EXPECT_THAT(unfolded(compared.err),
              HasSubstr("skipped 1754 lines with unknown tag 'EDGE_RANGE'"));
}

// What is no graph --------------------------------------------------------------------------------

TEST_F(Dialect, ATrajectoryHasNothingToOptimise) {
  const std::string file = write("k.tum", "0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n");
  const Outcome outcome = optimize(file);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(unfolded(outcome.err), HasSubstr("k.tum has no factors: nothing to optimise"));
  EXPECT_THAT(outcome.err, Not(HasSubstr("initial guess")));
}

TEST_F(Dialect, AnImageOfAnotherFormatIsSaidToBeNone) {
  CAIRN_NEEDS("grid_format", "image");
  const std::string file = write("office.jpg", "\xff\xd8\xff\xe0 an image");
  for (const std::string& name : {file, file + ":resolution=0.05"}) {
    const Outcome outcome = cairn({"info", name});
    EXPECT_EQ(outcome.exit_code, 3) << name;
    EXPECT_THAT(unfolded(outcome.err), HasSubstr("of floors end in .")) << name;
    EXPECT_THAT(outcome.err, Not(HasSubstr("cannot be opened"))) << name;
  }
}

}  // namespace
}  // namespace cairn::test
