// SPDX-License-Identifier: BSD-3-Clause
// What a measurement says of components that it does not measure: nothing, neither by their numbers
// nor by the weight of the others.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <iomanip>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "cairn/cairn.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/io/format.hpp"
#include "cairn/types/define_factor.hpp"
#include "dense_poses.hpp"
#include "support/pose_world.hpp"

namespace cairn::test {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kUnknown = std::numeric_limits<double>::infinity();

double heading(const Pose3& pose) {
  const Eigen::Matrix3d R = pose.rotation().matrix();
  return std::atan2(R(1, 0), R(0, 0));
}

// What users met ----------------------------------------------------------------------------------

TEST(PartialInformation, OfAPositionWeighsTheSameAtEveryHeading) {
  const auto position = Information::sigmas(1.0, 1.0, 1.0, kUnknown, kUnknown, kUnknown);
  for (const double yaw : {0.0, 1.0, 2.0, 3.0}) {
    SCOPED_TRACE(yaw);
    const Pose3 pose(Rot3::yaw(yaw), Point3(3.0, 4.0, 0.0));
    const Point3 beside(3.0, 5.0, 0.0);
    Graph prior;
    prior.add(0, pose);
    prior.add(Prior(0, Pose3(Rot3(), beside)), position);
    EXPECT_NEAR(chi2(prior), 1.0, 1e-12);
    Graph alone;
    alone.add(0, pose);
    alone.add(Position(0, beside), Information::isotropic(3, 1.0));
    EXPECT_NEAR(chi2(alone), 1.0, 1e-12);
    Graph between;
    between.add(0, Pose3(Rot3(), Point3()));
    between.add(1, pose);
    between.add(Between(0, 1, Pose3(Rot3(), beside)), position);
    EXPECT_NEAR(chi2(between), 1.0, 1e-12);
  }
}

TEST(PartialInformation, OfRollAndPitchWeighsTheSameAtEveryHeadingAsADirection) {
  for (const double yaw : {0.0, 1.0, 2.0, 3.0}) {
    const Rot3 turn = Rot3::yaw(yaw) * Rot3::roll_pitch_yaw(0.06, 0.08, 0.0);
    Graph graph;
    graph.add(0, Pose3(turn, Point3()));
    graph.add(Direction(0, Point3(0.0, 0.0, -9.81), Point3(0.0, 0.0, -1.0)),
              Information::isotropic(3, 0.1));
    EXPECT_NEAR(chi2(graph), 1.0, 0.002) << yaw;
  }
}

/// A pose 100 m ahead, pitched by 0.05 rad, and an altimeter that differs by a metre.
TEST(PartialInformation, OfAnAltimeterLeavesThePitchAlone) {
  const Pose3 pitched(Rot3::roll_pitch_yaw(0.0, 0.05, 0.0), Point3(100.0, 0.0, 1.0));
  const auto both = Information::sigmas(1.0, 1.0, 1.0, 0.1, 0.1, 0.1);
  for (const bool as_prior : {true, false}) {
    Graph graph;
    graph.add(0, pitched);
    graph.add(Prior(0, pitched), both);
    if (as_prior) {
      graph.add(Prior(0, Pose3()),
                Information::sigmas(kUnknown, kUnknown, 1.0, kUnknown, kUnknown, kUnknown));
    } else {
      graph.add(Position(0, Point3()), Information::sigmas(kUnknown, kUnknown, 1.0));
    }
    EXPECT_NEAR(chi2(graph), 1.0, 1e-9);
    const Summary summary = optimize(graph);
    EXPECT_EQ(summary.status, Status::converged);
    EXPECT_NEAR(summary.final_chi2, 0.5, 1e-9);
    EXPECT_NEAR(graph.at<Pose3>(0).z(), 0.5, 1e-9);
    EXPECT_NEAR(graph.at<Pose3>(0).rotation().roll_pitch_yaw()[1], 0.05, 1e-9);
  }
}

/// Positions from GPS as front ends dump them, and their heading.
TEST(PartialInformation, OfPositionsFindsTheHeadingOfATrajectory) {
  Graph graph;
  for (int k = 0; k < 3; ++k) graph.add(k, Pose3(Rot3(), Point3(k, 0.0, 0.0)));
  const auto odometry = Information::sigmas(0.1, 0.1, 0.1, 0.05, 0.05, 0.05);
  for (int k = 0; k < 2; ++k)
    graph.add(Between(k, k + 1, Pose3(Rot3(), Point3(1.0, 0.0, 0.0))), odometry);
  MatrixXd Omega = MatrixXd::Zero(3, 3);
  Omega.diagonal() << 66.6667, 66.6667, 33.3333;
  const auto gps = Information::matrix(Omega);
  graph.add(Position(0, Point3()), gps);
  graph.add(Position(1, Point3(0.6, 0.8, 0.0)), gps);
  graph.add(Position(2, Point3(1.2, 1.6, 0.1)), gps);
  const Summary summary = optimize(graph);
  EXPECT_EQ(summary.status, Status::converged);
  EXPECT_NEAR(summary.final_chi2, 0.0495, 5e-5);
  const Point3 expected[] = {{0.0004, 0.0006, -0.015}, {0.6, 0.8, 0.030}, {1.1995, 1.5994, 0.085}};
  for (int k = 0; k < 3; ++k) {
    const Pose3 pose = graph.at<Pose3>(k);
    EXPECT_LT((pose.translation() - expected[k]).cwiseAbs().maxCoeff(), 1e-3) << pose;
    EXPECT_NEAR(heading(pose), 0.926, 2e-3);
  }
}

/// The numbers of what is not measured may be anything.
TEST(PartialInformation, DoesNotDependOnTheNumbersOfWhatIsNotMeasured) {
  Draw draw(3);
  const auto along = Information::sigmas(0.1, kUnknown, 0.2, kUnknown, kUnknown, kUnknown);
  for (int k = 0; k < 50; ++k) {
    const Pose3 x = Pose3::exp(draw.uniforms(6, -3.0, 3.0)),
                a = Pose3::exp(draw.uniforms(6, -3, 3));
    const Rot3 axes = Rot3::exp(draw.uniforms(3, -1.5, 1.5));
    const Point3 z(Vector3d(draw.uniforms(3, -5.0, 5.0)));
    std::vector<double> of_priors, of_edges;
    for (int other = 0; other < 2; ++other) {
      // Along the second axis of the measurement anything; its axes are those of what is measured.
      const Pose3 measured(axes, Point3(z + other * 17.0 * axes.matrix().col(1)));
      Graph graph;
      graph.add(0, x);
      graph.add(Prior(0, measured), along);
      of_priors.push_back(chi2(graph));
      Graph two;
      two.add(0, a);
      two.add(1, x);
      two.add(Between(0, 1, measured), along);
      of_edges.push_back(chi2(two));
      const auto full = Information::isotropic(3, 0.3);
      Graph turned;  // an orientation, wherever the pose is
      turned.add(0, Pose3(x.rotation(), Point3(x.translation() + Point3(other * 9.0, 0.0, 0.0))));
      turned.add(Orientation(0, axes), full);
      turned.add(Direction(0, Point3(0.1, 0.2, 1.0), z), full);
      of_edges.push_back(chi2(turned));
    }
    EXPECT_NEAR(of_priors[0], of_priors[1], 1e-9 * (1.0 + of_priors[0]));
    EXPECT_NEAR(of_edges[0], of_edges[2], 1e-9 * (1.0 + of_edges[0]));
    EXPECT_NEAR(of_edges[1], of_edges[3], 1e-9 * (1.0 + of_edges[1]));
  }
}

TEST(Orientation, HasTheRotationVectorAsItsError) {
  Draw draw(5);
  for (int k = 0; k < 20; ++k) {
    const Rot3 known = Rot3::exp(draw.uniforms(3, -1.8, 1.8));
    const Vector3d apart = draw.uniforms(3, -1.0, 1.0);
    Graph graph;
    graph.add(0, Pose3(known * Rot3::exp(apart), Point3(1.0, 2.0, 3.0)));
    graph.add(Orientation(0, known), Information::sigmas(0.5, 2.0, kUnknown));
    EXPECT_NEAR(chi2(graph), 4.0 * apart[0] * apart[0] + 0.25 * apart[1] * apart[1], 1e-12);
  }
}

TEST(Direction, RefusesADirectionWithoutLength) {
  Graph graph;
  graph.add(0, Pose3());
  EXPECT_THROW(graph.add(Direction(0, Point3(), Point3(0, 0, 1)), Information::unit(3)), Error);
  EXPECT_THROW(graph.add(Direction(0, Point3(0, 0, 1), Point3()), Information::unit(3)), Error);
}

// Random graphs, against a solution that has nothing of cairn -------------------------------------

/// The position z of an antenna that sits at l on the robot, as from GNSS: error = R l + t − z
/// along the axes of the world. Measured: l, then z.
struct PlanarAntenna {
  static constexpr std::string_view kTag = "EDGE_SE2_ANTENNA";
  static constexpr int kResidual = 2, kMeasurement = 4;
  using Variables = std::tuple<Se2>;

  template <class S>
  static Vector<S, 2> residual(const BasicPose2<S>& robot, const Vector<double, 4>& m) {
    const BasicPoint2<S> at = robot.transform_from(BasicPoint2<S>(S(m[0]), S(m[1])));
    return {at[0] - m[2], at[1] - m[3]};
  }
};
struct SpatialAntenna {
  static constexpr std::string_view kTag = "EDGE_SE3_ANTENNA";
  static constexpr int kResidual = 3, kMeasurement = 6;
  using Variables = std::tuple<Se3>;

  template <class S>
  static Vector<S, 3> residual(const BasicPose3<S>& robot, const Vector<double, 6>& m) {
    const BasicPoint3<S> at = robot.transform_from(BasicPoint3<S>(S(m[0]), S(m[1]), S(m[2])));
    return {at[0] - m[3], at[1] - m[4], at[2] - m[5]};
  }
};

/// With all their digits, a blank before each.
std::string text_of(const auto& numbers) {
  std::ostringstream text;
  for (const double number : numbers) text << ' ' << std::setprecision(17) << number;
  return text.str();
}
/// The tag and ids of a line.
std::string line_of(std::string_view tag, std::initializer_list<int> ids) {
  std::string line = "\n" + std::string(tag);
  for (const int id : ids) line += " " + std::to_string(id);
  return line;
}

DensePose dense(const MatrixXd& T) {
  const Eigen::Index d = T.rows() - 1;
  return {T.topLeftCorner(d, d), T.topRightCorner(d, 1)};
}

Pose2 value(const DensePose& pose, const Pose2&) {
  return {pose.t[0], pose.t[1], rotation_vector(pose.R)[0]};
}
Pose3 value(const DensePose& pose, const Pose3&) {
  return {Rot3(Eigen::Matrix3d(pose.R)), Point3(pose.t[0], pose.t[1], pose.t[2])};
}

/// The same random problem twice, for cairn and dense: poses, and landmarks that some of them see.
/// `Pose`: Pose2 or Pose3. Sensors and antennas sit beside the origin of the pose (lever arms); the
/// offset of a sensor is that of the file from which the graph is read.
template <class Pose>
class RandomProblem {
  static constexpr int kD = std::is_same_v<Pose, Pose2> ? 2 : 3;
  static constexpr int kTurns = kD == 2 ? 1 : 3;
  static constexpr int kPoses = 4, kLandmarks = 2, kSensors = 2;
  // So small that chi2, by which the optimizer chooses the best of its last steps, differs between
  // states that are nearer to each other than what is compared.
  static constexpr double kNoise = 0.002;
  using Point = std::conditional_t<kD == 2, Point2, Point3>;
  using Antenna = std::conditional_t<kD == 2, PlanarAntenna, SpatialAntenna>;

 public:
  Graph graph;
  DensePoses problem;

  explicit RandomProblem(unsigned seed) : draw_(seed) {
    for (int k = 0; k < kPoses; ++k) {
      truth_.push_back(random_pose());
      problem.poses.push_back(noisy(truth_.back(), 0.05));
      graph.add(k, value(problem.poses.back(), Pose()));
    }
    for (int k = 0; k + 1 < kPoses; ++k) {
      for (int edge = 0; edge < 2; ++edge) add_edge(k, k + 1);
    }
    add_edge(0, kPoses - 1);
    add_edge(kPoses - 1, 1);
    for (int k = 0; k < kPoses; ++k) {
      if (draw_.chance(0.6)) add_prior(k);
      if (draw_.chance(0.4)) add_position(k);
      if (draw_.chance(0.4)) add_antenna(k);
      if constexpr (kD == 3) {
        if (draw_.chance(0.5)) add_orientation(k);
        if (draw_.chance(0.5)) add_direction(k);
      }
    }
    if constexpr (kD == 3) add_sensors();
    for (int k = kPoses; k < kPoses + kLandmarks; ++k) add_landmark(k);
    graph = read_with_sensors();
  }

  /// Whether all measurements together determine everything well: else minima are not comparable.
  bool is_determined() const {
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(problem.H(), Eigen::EigenvaluesOnly);
    return eigen.eigenvalues()[0] > 10.0;
  }
  /// Whether the measurements, without the states of the others, lack information anywhere.
  int lacking() const { return lacking_; }

  void compare() {
    const double before = problem.chi2();
    EXPECT_NEAR(chi2(graph), before, 1e-9 * before);
    problem.solve();
    optimize_from_states(graph, "gauss_newton", {.max_iterations = 100, .tolerance = 0.0});
    const double least = problem.chi2();
    EXPECT_NEAR(chi2(graph), least, 1e-8 * (1.0 + least));
    for (int k = 0; k < kPoses; ++k) {
      const DensePose found = dense(graph.at<Pose>(k).matrix());
      EXPECT_LT((found.t - problem.poses[k].t).norm(), 1e-8) << "pose " << k;
      EXPECT_LT((found.R - problem.poses[k].R).norm(), 1e-8) << "pose " << k;
    }
    for (int k = kPoses; k < kPoses + kLandmarks; ++k)
      EXPECT_LT((graph.at<Point>(k) - problem.poses[k].t).norm(), 1e-8) << "landmark " << k;
  }

 private:
  DensePose random_pose() {
    VectorXd axis = draw_.normals(kTurns);
    axis *= draw_.uniform(0.0, 3.1) / axis.norm();
    return {rotation(axis), draw_.uniforms(kD, -10.0, 10.0)};
  }
  DensePose noisy(const DensePose& pose, double sigma) {
    return pose * DensePose{rotation(sigma * draw_.normals(kTurns)), sigma * draw_.normals(kD)};
  }
  /// A full matrix for the components that are measured, zero for the rest.
  MatrixXd information(const std::vector<bool>& measured) {
    const auto n = std::ssize(measured);
    MatrixXd A(n, n);
    for (double& number : A.reshaped()) number = draw_.uniform(-1.0, 1.0);
    MatrixXd Omega = 100.0 * (A * A.transpose() + 0.3 * MatrixXd::Identity(n, n));
    for (Eigen::Index k = 0; k < n; ++k) {
      if (measured[k]) continue;
      Omega.row(k).setZero();
      Omega.col(k).setZero();
      ++lacking_;
    }
    return Omega;
  }
  std::vector<bool> mask(int components) {
    std::vector<bool> measured(components);
    for (int k = 0; k < components; ++k) measured[k] = draw_.chance(0.7);
    measured[draw_.integer(kD)] = true;  // nothing at all is no measurement
    return measured;
  }
  /// What is measured where `truth` is so, with noise; of what is not measured, anything. Only the
  /// whole of a rotation can be anything: parts of one depend on the rest.
  struct Measured {
    DensePose z;
    MatrixXd Omega;
  };
  Measured measured(const DensePose& truth) {
    std::vector<bool> known = mask(kD + kTurns);
    if (draw_.chance(0.3)) std::fill(known.begin() + kD, known.end(), false);
    DensePose z = noisy(truth, kNoise);
    if (std::none_of(known.begin() + kD, known.end(), [](bool k) { return k; }))
      z.R = random_pose().R;
    VectorXd anything = VectorXd::Zero(kD);
    for (int k = 0; k < kD; ++k) anything[k] = known[k] ? 0.0 : draw_.uniform(-8.0, 8.0);
    z.t += z.R * anything;
    return {z, information(known)};
  }
  static VectorXd error(const DensePose& z, const DensePose& x) {
    const DensePose E = z.inverse() * x;
    VectorXd e(kD + kTurns);
    e << E.t, rotation_vector(E.R);
    return e;
  }

  void add_edge(int a, int b) {
    const auto [z, Omega] = measured(truth_[a].inverse() * truth_[b]);
    graph.add(Between(a, b, value(z, Pose())), Information::matrix(Omega));
    problem.add(
        {a, b}, [a, b, z = z](const auto& x) { return error(z, x[a].inverse() * x[b]); }, Omega);
  }
  void add_prior(int k) {
    const auto [z, Omega] = measured(truth_[k]);
    graph.add(Prior(k, value(z, Pose())), Information::matrix(Omega));
    problem.add(
        {k}, [k, z = z](const auto& x) { return error(z, x[k]); }, Omega);
  }
  void add_position(int k) {
    const MatrixXd Omega = information(mask(kD));
    const VectorXd z = truth_[k].t + kNoise * draw_.normals(kD);
    graph.add(Position(k, Point(z.template head<kD>())), Information::matrix(Omega));
    problem.add(
        {k}, [=](const auto& x) { return VectorXd(x[k].t - z); }, Omega);
  }
  void add_antenna(int k) {
    const MatrixXd Omega = information(mask(kD));
    const VectorXd lever = draw_.uniforms(kD, -2.0, 2.0);
    const VectorXd z = truth_[k].R * lever + truth_[k].t + kNoise * draw_.normals(kD);
    std::array<double, 2 * kD> numbers{};
    std::ranges::copy(lever, numbers.begin());
    std::ranges::copy(z, numbers.begin() + kD);
    graph.add(Measurement<Antenna>({k}, numbers), Information::matrix(Omega));
    problem.add(
        {k}, [=](const auto& x) { return VectorXd(x[k].R * lever + x[k].t - z); }, Omega);
  }
  /// Parameter 0 is that of the writer: no offset.
  void add_sensors() {
    for (int k = 0; k < kSensors; ++k) {
      sensors_.push_back({random_pose().R, draw_.uniforms(kD, -2.0, 2.0)});
      const VectorXd q = Rot3(Eigen::Matrix3d(sensors_[k].R)).state();
      lines_ += line_of("PARAMS_SE3OFFSET", {k + 1}) + text_of(sensors_[k].t) + text_of(q);
    }
  }
  /// Seen by three poses, and its position known in part.
  void add_landmark(int k) {
    truth_.push_back({MatrixXd(0, 0), draw_.uniforms(kD, -10.0, 10.0)});
    problem.poses.push_back({MatrixXd(0, 0), truth_[k].t + 0.05 * draw_.normals(kD)});
    graph.add(k, Point(problem.poses[k].t.template head<kD>()));
    for (int seen = 0; seen < 3; ++seen) add_sighting((k + seen) % kPoses, k);
    const MatrixXd Omega = information(mask(kD));
    const VectorXd z = truth_[k].t + kNoise * draw_.normals(kD);
    graph.add(Prior(k, Point(z.template head<kD>())), Information::matrix(Omega));
    problem.add(
        {k}, [=](const auto& x) { return VectorXd(x[k].t - z); }, Omega);
  }
  /// By a sensor in space, from the pose itself in the plane.
  void add_sighting(int pose, int landmark) {
    const int sensor = draw_.integer(kSensors);
    const DensePose on_robot =
        kD == 3 ? sensors_[sensor] : DensePose{MatrixXd::Identity(2, 2), VectorXd::Zero(2)};
    const auto seen = [=](const std::vector<DensePose>& x) {
      const DensePose eye = x[pose] * on_robot;
      return VectorXd(eye.R.transpose() * (x[landmark].t - eye.t));
    };
    const MatrixXd Omega = information(mask(kD));
    const VectorXd z = seen(truth_) + kNoise * draw_.normals(kD);
    lines_ += kD == 3 ? line_of("EDGE_SE3_TRACKXYZ", {pose, landmark, sensor + 1})
                      : line_of("EDGE_SE2_XY", {pose, landmark});
    lines_ += text_of(z) + text_of(pack(Omega));
    problem.add(
        {pose, landmark}, [=](const auto& x) { return VectorXd(seen(x) - z); }, Omega);
  }
  /// The graph, and what only lines of a file say.
  Graph read_with_sensors() const {
    const auto g2o = make<Format>("g2o");
    ReadReport report;
    Graph all = g2o->read(g2o->write(graph) + lines_, "random", default_registry(), {}, report);
    EXPECT_TRUE(report.notes.empty()) << report.notes.front();
    return all;
  }

  void add_orientation(int k) {
    const MatrixXd Omega = information(mask(kTurns)), R = noisy(truth_[k], kNoise).R;
    graph.add(Orientation(k, Rot3(Eigen::Matrix3d(R))), Information::matrix(Omega));
    problem.add(
        {k}, [=](const auto& x) { return rotation_vector(R.transpose() * x[k].R); }, Omega);
  }
  void add_direction(int k) {
    const MatrixXd Omega = information(mask(3));
    const Vector3d world = draw_.normals(3);
    const Vector3d seen = truth_[k].R.transpose() * world.normalized() + kNoise * draw_.normals(3);
    graph.add(Direction(k, Point3(world), Point3(seen)), Information::matrix(Omega));
    problem.add(
        {k},
        [=](const auto& x) {
          return VectorXd(x[k].R.transpose() * world.normalized() - seen.normalized());
        },
        Omega);
  }

  Draw draw_;
  std::vector<DensePose> truth_, sensors_;
  std::string lines_;
  int lacking_ = 0;
};

template <class Pose>
void compare_random_graphs(int wanted) {
  int compared = 0;
  for (unsigned seed = 1; compared < wanted; ++seed) {
    SCOPED_TRACE(seed);
    ASSERT_LT(seed, 20u * static_cast<unsigned>(wanted)) << "hardly any graph is determined";
    RandomProblem<Pose> random(seed);
    if (random.lacking() == 0 || !random.is_determined()) continue;
    random.compare();
    ++compared;
    if (testing::Test::HasFailure()) return;
  }
}

/// `CAIRN_PARTIAL_GRAPHS`: how many, of the plane and of space each.
int partial_graphs() {
  const char* count = std::getenv("CAIRN_PARTIAL_GRAPHS");
  return count ? std::atoi(count) : 200;
}

TEST(PartialInformation, OfRandomGraphsInThePlaneGivesTheDenseSolution) {
  default_registry().add(factor_type<PlanarAntenna>(), "position of an antenna");
  compare_random_graphs<Pose2>(partial_graphs());
}
TEST(PartialInformation, OfRandomGraphsInSpaceGivesTheDenseSolution) {
  default_registry().add(factor_type<SpatialAntenna>(), "position of an antenna");
  compare_random_graphs<Pose3>(partial_graphs());
}

}  // namespace
}  // namespace cairn::test
