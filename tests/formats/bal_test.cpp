// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numeric>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "formats/reading.hpp"
#include "support/data.hpp"

namespace cairn::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Two cameras, two points, three observations; the first camera is turned a right angle about x.
const std::string kHeader = "2 2 3\n";
const std::string kObservations = "0 0   -3.5 2.25\n1 0 3 4\n1 1 -5 1e1\n";
const std::string kCameras =
    "1.5707963267948966\n0\n0\n1\n2\n-3\n500\n-1e-2\n0.5\n"
    "\n0.1\n-0.2\n0.3\n0.5\n0.25\n-2\n600\n0\n0\n";
const std::string kPoints = "1.5\n-30\n-2\n0.1\n0.2\n-9.5\n";
const std::string kFile = kHeader + kObservations + kCameras + kPoints;

TEST(Bal, NumbersCamerasFirstAndPointsAfterThem) {
  const Reading reading = read("bal", kFile);
  ASSERT_EQ(reading.graph.variable_count(), 4);
  EXPECT_EQ(reading.variable_tag(0), "VERTEX_CAMERA_BAL");
  EXPECT_EQ(reading.variable_tag(1), "VERTEX_CAMERA_BAL");
  EXPECT_THAT(reading.state(2), ElementsAre(1.5, -30, -2));
  EXPECT_THAT(reading.state(3), ElementsAre(0.1, 0.2, -9.5));
  ASSERT_EQ(reading.graph.factor_count(), 3);
  EXPECT_EQ(reading.factor_tag(0), "EDGE_PROJECT_BAL");
  EXPECT_THAT(reading.ids(0), ElementsAre(0, 2));
  EXPECT_THAT(reading.ids(1), ElementsAre(1, 2));
  EXPECT_THAT(reading.ids(2), ElementsAre(1, 3));
  EXPECT_THAT(reading.measurement(0), ElementsAre(-3.5, 2.25));
  EXPECT_THAT(reading.information(0), ElementsAre(1, 0, 1));
}

TEST(Bal, KeepsTheLensAndTurnsRAndTIntoAPlace) {
  const std::vector<double> x = read("bal", kFile).state(0);
  EXPECT_THAT(std::vector(x.begin(), x.begin() + 3), ElementsAre(500, -1e-2, 0.5));
  // R X + T = 0 for R = a right angle about x, (x, y, z) → (x, −z, y), and T = (1, 2, −3).
  EXPECT_NEAR(x[3], -1.0, 1e-15);
  EXPECT_NEAR(x[4], 3.0, 1e-15);
  EXPECT_NEAR(x[5], 2.0, 1e-15);
  EXPECT_NEAR(x[6], -std::sqrt(0.5), 1e-15) << "the inverse of R";
  EXPECT_NEAR(x[9], std::sqrt(0.5), 1e-15);
}

TEST(Bal, SaysHowManyPointsAreBehindTheirCamera) {
  EXPECT_THAT(read("bal", kFile).report.notes, IsEmpty());
  EXPECT_THAT(read("bal", kHeader + kObservations + kCameras + "1.5\n-30\n-2\n0.1\n0.2\n9.5\n")
                  .report.notes,
              ElementsAre("1 of 3 observations is of points behind their camera, as the file has "
                          "them"));
}

TEST(Bal, IsDetectedByItsCounts) {
  EXPECT_EQ(detected(kFile), "bal");
  EXPECT_EQ(detected(kHeader + kObservations), "bal") << "cut short: its reader will say so";
  EXPECT_EQ(detected(kHeader + "0 0 1 2 3\n" + kObservations.substr(16) + kCameras + kPoints),
            "bal")
      << "one bad line";
  EXPECT_EQ(detected("2 2 3\n1 2 3\n3 2 1\n"), "table");
  EXPECT_EQ(detected("1 2 3\n"), "bal") << "cut after its first line; a table has coordinates";
  EXPECT_EQ(detected("1 2 3.5\n"), "table");
  EXPECT_EQ(detected("0 2 3 1\n1 2 3 1\n"), "table");
  EXPECT_EQ(detected("2 0 3\n" + kObservations), "table") << "a scene has points";
}

TEST(Bal, NamesTheLineOfWhatIsWrong) {
  EXPECT_EQ(refusal("bal", "2 2\n"),
            "file:1: the header (cameras points observations) with 2 fields; expected 3 fields (3 "
            "ids)");
  EXPECT_THAT(refusal("bal", "2 -2 3\n"), HasSubstr("file:1: field 2 of the header"));
  EXPECT_THAT(refusal("bal", "2 4294967296 3\n"),
              HasSubstr("expected a count, an integer from 0 to 2147483647"));
  EXPECT_EQ(refusal("bal", kHeader + "2 0 1 1\n"),
            "file:2: an observation of camera 2; expected one of 0 to 1, by the header");
  EXPECT_EQ(refusal("bal", kHeader + "0 2 1 1\n"),
            "file:2: an observation of point 2; expected one of 0 to 1, by the header");
  EXPECT_EQ(refusal("bal", "0 2 1\n0 0 1 1\n"),
            "file:2: an observation of camera 0; expected none, by the header");
  EXPECT_EQ(refusal("bal", "2 2 4\n" + kObservations + kCameras + kPoints),
            "file:5: an observation (camera point u v) with 1 fields; expected 4 fields (2 ids, 2 "
            "numbers)");
  EXPECT_EQ(refusal("bal", "2 2 2\n" + kObservations + kCameras + kPoints),
            "file:4: a line of a camera with 4 fields; expected 1 field (1 number)");
  EXPECT_THAT(refusal("bal", kFile + "7\n"),
              HasSubstr("file:30: '7' after the last point; expected the end of the file"));
}

TEST(Bal, SaysWhereAFileWasCutShort) {
  EXPECT_THAT(refusal("bal", kHeader + "0 0 1 1\n"),
              HasSubstr("file:2: the file ends here, in observation 2 of 3"));
  EXPECT_THAT(refusal("bal", kHeader + kObservations + "1\n2\n"),
              HasSubstr("file:6: the file ends here, in camera 1 of 2"));
  EXPECT_THAT(refusal("bal", kHeader + kObservations + kCameras + "1\n2\n3\n4\n"),
              HasSubstr("file:27: the file ends here, in point 2 of 2; expected what the header "
                        "declares: 2 cameras, 2 points and 3 observations"));
}

TEST(Bal, DoesNotMakeRoomForWhatAHeaderOnlyPromises) {
  EXPECT_THAT(refusal("bal", "2147483647 2147483647 2147483647\n0 2147483646 1 1\n"),
              HasSubstr("file:2: the file ends here, in observation 2"));
}

TEST(Bal, RefusesACameraWithoutFocalLength) {
  std::string file = kFile;
  file.replace(file.find("500"), 3, "0");
  EXPECT_EQ(refusal("bal", file), "file:5: VERTEX_CAMERA_BAL 0: the focal length is zero");
}

TEST(Bal, WritesWhatItReads) {
  const Graph graph = read("bal", kFile).graph;
  const std::string text = write("bal", graph);
  EXPECT_THAT(text, testing::StartsWith("2 2 3\n0 0 -3.5 2.25\n1 0 3 4\n1 1 -5 10\n"));
  const Graph again = read("bal", text).graph;
  ASSERT_EQ(again.variable_count(), graph.variable_count());
  for (int v = 0; v < graph.variable_count(); ++v) {
    std::vector<double> delta(graph.type(v).tangent_size());
    graph.type(v).local(1, graph.state(v).data(), again.state(v).data(), delta.data());
    for (const double d : delta) EXPECT_NEAR(d, 0.0, 2e-15) << graph.describe_variable(v);
  }
  EXPECT_EQ(difference(again, read("g2o", write("g2o", again)).graph), "");
}

TEST(Bal, NumbersByRisingIdWhenWriting) {
  const std::string shuffled =
      "VERTEX_TRACKXYZ 3 7 8 -9\nVERTEX_CAMERA_BAL 40 500 0 0 0 0 0 0 0 0 1\n"
      "VERTEX_TRACKXYZ 90 1 2 -3\nVERTEX_CAMERA_BAL 5 600 0 0 0 0 0 0 0 0 1\n"
      "EDGE_PROJECT_BAL 40 3 1 2 1 0 1\nEDGE_PROJECT_BAL 5 90 3 4 1 0 1\n";
  const Reading again = read("bal", write("bal", read("g2o", shuffled).graph));
  EXPECT_EQ(again.state(0)[0], 600.0);
  EXPECT_EQ(again.state(1)[0], 500.0);
  EXPECT_THAT(again.state(2), ElementsAre(7, 8, -9));
  EXPECT_THAT(again.ids(0), ElementsAre(1, 2));
  EXPECT_THAT(again.ids(1), ElementsAre(0, 3));
}

TEST(Bal, RefusesToWriteWhatItCannotExpress) {
  EXPECT_THAT(write_refusal("bal", read("g2o", "VERTEX_SE2 0 0 0 0\n").graph),
              HasSubstr("format bal cannot express VERTEX_SE2 0"));
  const std::string vertices =
      "VERTEX_CAMERA_BAL 0 500 0 0 0 0 0 0 0 0 1\nVERTEX_TRACKXYZ 1 1 2 -3\n";
  EXPECT_THAT(
      write_refusal("bal", read("g2o", vertices + "EDGE_PROJECT_BAL 0 1 1 2 4 0 4\n").graph),
      HasSubstr("format bal cannot express the information of EDGE_PROJECT_BAL 0 1"));
  EXPECT_THAT(write_refusal("bal", read("g2o", vertices + "FIX 0\n").graph),
              HasSubstr("format bal cannot express FIX of VERTEX_CAMERA_BAL 0"));
  EXPECT_THAT(write_refusal(
                  "bal", read("g2o", vertices + "EDGE_PRIOR_TRACKXYZ 1 1 2 3 1 0 0 1 0 1\n").graph),
              HasSubstr("format bal cannot express EDGE_PRIOR_TRACKXYZ 1"));
}

/// Σ ‖r‖² straight from the numbers of a file, by the formula of the paper.
double chi2_of_file(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::size_t cameras = 0, points = 0, observations = 0;
  in >> cameras >> points >> observations;
  struct Seen {
    std::size_t camera, point;
    double u, v;
  };
  std::vector<Seen> seen(observations);
  for (Seen& s : seen) in >> s.camera >> s.point >> s.u >> s.v;
  std::vector<double> x(9 * cameras + 3 * points);
  for (double& number : x) in >> number;
  EXPECT_TRUE(in) << file;
  double sum = 0.0;
  for (const Seen& s : seen) {
    const double* c = x.data() + 9 * s.camera;
    const Eigen::Vector3d omega(c[0], c[1], c[2]), T(c[3], c[4], c[5]);
    const Eigen::Vector3d X = Eigen::Map<const Eigen::Vector3d>(&x[9 * cameras + 3 * s.point]);
    const Eigen::Vector3d P = Eigen::AngleAxisd(omega.norm(), omega.normalized()) * X + T;
    const Eigen::Vector2d p = -P.head<2>() / P[2];
    const double n = p.squaredNorm();
    sum += (c[6] * (1.0 + c[7] * n + c[8] * n * n) * p - Eigen::Vector2d(s.u, s.v)).squaredNorm();
  }
  return sum;
}

TEST(PublishedBal, HasTheCountsAndTheChi2OfItsReadme) {
  CAIRN_NEEDS_DATA();
  struct Expected {
    const char* file;
    int cameras, points, observations;
    double half_chi2, rounding;
  };
  for (const Expected& expected :
       {Expected{"ba/ladybug-problem-49-7776-pre.txt", 49, 7776, 31843, 850912.46, 0.005},
        Expected{"ba/dubrovnik-3-7-pre.txt", 3, 7, 19, 2764.2200, 0.00005}}) {
    SCOPED_TRACE(expected.file);
    const std::filesystem::path file = data_folder() / expected.file;
    ReadReport report;
    const Graph graph = read_graph(file, registry(), {}, report);
    EXPECT_EQ(report.format, "bal");
    EXPECT_EQ(graph.variable_count(), expected.cameras + expected.points);
    EXPECT_EQ(graph.type(expected.cameras - 1).tag(), "VERTEX_CAMERA_BAL");
    EXPECT_EQ(graph.type(expected.cameras).tag(), "VERTEX_TRACKXYZ");
    EXPECT_EQ(graph.factor_count(), expected.observations);
    EXPECT_NEAR(chi2(graph) / 2, expected.half_chi2, expected.rounding);
    EXPECT_NEAR(chi2(graph) / chi2_of_file(file), 1.0, 1e-12);

    EXPECT_NEAR(chi2(read("bal", write("bal", graph)).graph) / chi2(graph), 1.0, 1e-12);
    EXPECT_EQ(difference(graph, read("g2o", write("g2o", graph)).graph), "");
  }
}

}  // namespace
}  // namespace cairn::test
