// SPDX-License-Identifier: BSD-3-Clause
// The code of docs/cpp.md, which a test of the documentation compares with this file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <numbers>
#include <string>
#include <string_view>
#include <tuple>

#include "cairn/cairn.hpp"
#include "cairn/sparsification/map_sparsifier.hpp"
#include "support/components.hpp"

namespace {

using namespace cairn;
using namespace cairn::symbols;

/// The distance from a robot to a radio beacon: r = |l - t| - z, with t the position of the pose.
struct Range {
  static constexpr std::string_view kTag = "EDGE_RANGE_SE2_XY";
  static constexpr int kResidual = 1;
  static constexpr int kMeasurement = 1;  // measured distance [m]
  using Variables = std::tuple<Se2, PointXY>;

  template <class S>
  static Vector<S, 1> residual(const BasicPose2<S>& robot, const BasicPoint2<S>& beacon,
                               const Vector<double, 1>& measured) {
    using std::sqrt;  // that of double; dual numbers bring their own
    const BasicPoint2<S> seen = robot.transform_to(beacon);
    return Vector<S, 1>(sqrt(seen[0] * seen[0] + seen[1] * seen[1]) - measured[0]);
  }
};

/// rho(s) = c^2 (sqrt(1 + s / c^2) - 1) * 2: quadratic near zero, linear far away.
class SoftL1 final : public Loss {
 public:
  explicit SoftL1(double scale) : square_(scale * scale) {}

  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    for (std::size_t k = 0; k < s.size(); ++k) {
      const double root = std::sqrt(1.0 + s[k] / square_);
      if (!rho.empty()) rho[k] = 2.0 * square_ * (root - 1.0);
      if (!weight.empty()) weight[k] = 1.0 / root;
    }
  }
  double second_derivative(double s) const override {
    return -0.5 / (square_ * std::pow(1.0 + s / square_, 1.5));
  }

 private:
  double square_;
};

/// Prints each iteration, and stops when the robot needs the computer.
class Progress final : public Observer {
 public:
  bool on_iteration(const Iteration& iteration, const Graph&, const Values&) override {
    std::cout << iteration.number << ": chi2 " << iteration.chi2 << "\n";
    return !needed_elsewhere;
  }
  bool needed_elsewhere = false;
};

/// A corridor of poses a metre apart, with two beacons, all a little off.
Graph corridor() {
  Graph graph;
  for (int k = 0; k < 10; ++k) graph.add(X(k), Pose2(1.02 * k, 0.01 * k, 0.0));
  for (int k = 1; k < 10; ++k)
    graph.add(Between(X(k - 1), X(k), Pose2(1.0, 0.0, 0.0)), Information::sigmas(0.1, 0.1, 0.02));
  graph.add(Between(X(0), X(9), Pose2(9.0, 0.1, 0.0)), Information::sigmas(0.1, 0.1, 0.02));
  return graph;
}

TEST(Guide, Values) {
  const Pose2 robot(2.0, 1.0, std::numbers::pi / 2);   // x y [m], heading [rad]
  const Pose2 ahead = robot * Pose2(1.0, 0.0, 0.0);    // a metre ahead of it
  const Pose2 seen = robot.between(ahead);             // robot.inverse() * ahead
  const Point2 wall = robot * Point2(3.0, 0.0);        // a point of its frame, in the world
  const Point2 back = robot.transform_to(wall);        // and back
  const Vector<double, 3> twist = robot.local(ahead);  // log: robot.retract(twist) is ahead
  const Pose3 drone(Rot3::roll_pitch_yaw(0.0, 0.1, 1.5), Point3(0.0, 0.0, 10.0));

  EXPECT_TRUE(ahead.equals({2.0, 2.0, std::numbers::pi / 2}));
  EXPECT_TRUE(seen.equals({1.0, 0.0, 0.0}));
  EXPECT_TRUE(wall.equals({2.0, 4.0}));
  EXPECT_TRUE(back.equals({3.0, 0.0}));
  EXPECT_TRUE(robot.retract(twist).equals(ahead));
  EXPECT_DOUBLE_EQ(drone.z(), 10.0);
}

TEST(Guide, Building) {
  Graph graph;
  graph.add(X(0), Pose2());                   // x0: a pose
  graph.add(X(1), Pose2(1.0, 0.0, 0.0));      // x1
  graph.add(L(0), Point2(3.0, 1.0));          // l0: a landmark
  graph.set_fixed(graph.find(X(0)).value());  // otherwise x0 would be anchored, to the same effect
  graph.add(Between(X(0), X(1), Pose2(1.1, 0.0, 0.0)), Information::sigmas(0.1, 0.1, 0.05));
  graph.add(Observation(X(0), L(0), Point2(3.1, 0.9)), Information::isotropic(2, 0.2));
  graph.add(BearingRange(X(1), L(0), 0.45, 2.2), Information::sigmas(0.02, 0.1));
  print(graph);

  const double before = chi2(graph);
  const Summary summary = optimize(graph);
  EXPECT_EQ(summary.status, Status::converged);
  EXPECT_LT(chi2(graph), before);
}

TEST(Guide, Optimizing) {
  Graph graph = corridor();
  Stop stop;
  stop.max_iterations = 20;
  stop.max_seconds = 0.5;
  const Summary summary = optimize(graph, "dogleg:linear_solver=cholmod", stop);
  if (summary.status != Status::converged) std::cout << summary;

  EXPECT_EQ(summary.status, Status::converged);

  graph = corridor();
  const auto optimizer = make<Optimizer>("levenberg_marquardt");
  Progress progress;
  optimizer->optimize(graph, stop, progress);

  EXPECT_NEAR(chi2(graph), summary.final_chi2, 1e-6);
  graph = corridor();
  progress.needed_elsewhere = true;
  const Summary stopped = optimizer->optimize(graph, stop, progress);
  EXPECT_EQ(stopped.status, Status::interrupted);
  EXPECT_EQ(stopped.iterations.size(), 1U);
}

TEST(Guide, InitialEstimate) {
  Graph graph = corridor();
  make<InitialGuess>("spanning_tree")->compute(graph);
  optimize_from_states(graph);
  Graph other = corridor();
  EXPECT_NEAR(chi2(graph), optimize(other).final_chi2, 1e-9);
}

TEST(Guide, Losses) {
  Graph graph = corridor();
  graph.set_loss(make<Loss>("cauchy:scale=2"), FactorSelector::loops());
  EXPECT_LT(chi2(graph), chi2(corridor()) + 1e-12);

  graph.set_loss(std::make_shared<SoftL1>(1.5));
  EXPECT_EQ(optimize(graph).status, Status::converged);
}

TEST(Guide, LossOfOneFactor) {
  Graph graph = corridor();
  const auto closure = Information::sigmas(0.1, 0.1, 0.02);
  graph.add(Between(X(2), X(7), Pose2(1.0, 3.0, 0.0)), closure, make<Loss>("cauchy:scale=2"));

  EXPECT_LT(chi2(graph), chi2(corridor()) + 100.0);  // without the loss: thousands
}

TEST(Guide, Covariances) {
  Graph graph = corridor();
  optimize(graph);
  const Eigen::MatrixXd Sigma = covariance(graph, X(9));  // 3 x 3: forward, left [m], turn [rad]
  const std::vector<Id> some{X(3), X(6), X(9)};
  const std::vector<Eigen::MatrixXd> each = covariances(graph, some);  // factorises once
  const Eigen::MatrixXd cross = cross_covariance(graph, X(3), X(9));

  EXPECT_LT((each[2] - Sigma).norm(), 1e-12);
  EXPECT_EQ(cross.rows(), 3);
}

TEST(Guide, FixedLag) {
  constexpr int kLag = 20;
  const auto estimator = make<Estimator>("incremental_cholesky");
  for (int k = 0; k < 100; ++k) {
    GraphUpdate update;
    if (k == 0) {
      update.add(X(0), Pose2());
      update.add(Prior(X(0), Pose2()), Information::sigmas(0.01, 0.01, 0.01));
    } else {
      update.add<Pose2>(X(k));
      update.add(Between(X(k - 1), X(k), Pose2(1.0, 0.0, 0.0)), Information::isotropic(3, 0.05));
    }
    if (k >= kLag) update.marginalized = {X(k - kLag)};  // leaves; its information stays
    const UpdateReport report = estimator->update(update, {.max_seconds = 0.01});
    if (!report.ok) std::cout << "the measurements so far do not determine every pose\n";
  }
  EXPECT_EQ(estimator->variable_count(), kLag);
  EXPECT_TRUE(estimate<Pose2>(*estimator, X(99)).equals({99.0, 0.0, 0.0}, 1e-6));
}

TEST(Guide, FixedNumberOfPoses) {
  CAIRN_NEEDS("sparsifier", "sparsify");
  const auto estimator = make<Estimator>("incremental_cholesky");
  MapSparsifier sparsifier(default_registry());
  for (int k = 0; k < 60; ++k) {
    GraphUpdate update;
    if (k == 0) {
      update.add(X(0), Pose2());
      update.add(Prior(X(0), Pose2()), Information::sigmas(0.01, 0.01, 0.01));
    } else {
      update.add<Pose2>(X(k));
      update.add(Between(X(k - 1), X(k), Pose2(1.0, 0.0, 0.0)), Information::isotropic(3, 0.05));
    }
    sparsifier.make_room(*estimator, 20, update).add_to(update);
    estimator->update(update);
  }
  EXPECT_EQ(estimator->variable_count(), 20);
  EXPECT_TRUE(estimate<Pose2>(*estimator, X(59)).equals({59.0, 0.0, 0.0}, 1e-6));
}

TEST(Guide, TakingBack) {
  const auto estimator = make<Estimator>("incremental_cholesky");
  GraphUpdate first;
  for (int k = 0; k < 3; ++k) first.add(X(k), Pose2(1.0 * k, 0.0, 0.0));
  for (int k = 1; k < 3; ++k)
    first.add(Between(X(k - 1), X(k), Pose2(1.0, 0.0, 0.0)), Information::isotropic(3, 0.5));
  estimator->update(first);

  GraphUpdate update;
  update.add(Between(X(0), X(2), Pose2(5.0, 0.0, 0.0)), Information::isotropic(3, 0.1));
  const auto what_if = estimator->clone();  // the two are independent
  const FactorId closure = what_if->update(update).first_factor;
  if (what_if->chi2() > 10.0) {  // it contradicts the others
    GraphUpdate undo;
    undo.removed_factors = {closure};
    what_if->update(undo);
  }
  EXPECT_EQ(what_if->factor_count(), 2);
  EXPECT_NEAR(what_if->chi2(), 0.0, 1e-6);
}

TEST(Guide, FactorOfOnesOwn) {
  Graph graph = corridor();
  graph.add(L(0), Point2(5.0, 3.0));
  for (const auto& [pose, distance] : {std::pair(0, 5.8), std::pair(4, 3.2), std::pair(9, 5.1)})
    graph.add(Measurement<Range>({X(pose), L(0)}, {distance}), Information::sigmas(0.1));
  EXPECT_EQ(optimize(graph).status, Status::converged);
}

TEST(Guide, FilesWithAFactorOfOnesOwn) {
  CAIRN_NEEDS("format", "g2o");
  std::string folder = (std::filesystem::temp_directory_path() / "cairn-guide-XXXXXX").string();
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  const auto file = std::filesystem::path(folder) / "beacons.g2o";
  std::ofstream(file) << "VERTEX_SE2 0 0 0 0\nVERTEX_XY 1 3 4\nEDGE_RANGE_SE2_XY 0 1 4.5 4\n";

  Registry registry;
  registry.add(factor_type<Range>(), "distance from a pose to a beacon");
  registry.add<Loss>("soft_l1", OptionTable{}.real("scale", 1.0, 1e-6, 1e6, "where it bends"),
                     [](const Options& options, Registry&) {
                       return std::make_unique<SoftL1>(options.real("scale"));
                     });
  Graph graph = read(file, registry);  // EDGE_RANGE_SE2_XY 0 1 4.5 4
  graph.set_loss(make<Loss>("soft_l1:scale=2", registry));

  std::filesystem::remove_all(folder);
  EXPECT_EQ(graph.factor_count(), 1);
  EXPECT_NEAR(squared_norms(graph)[0], 1.0, 1e-12);  // ((5 - 4.5) * 2)^2
}

TEST(Guide, CheckingAFactor) {
  const Pose2 robot(1.0, 2.0, 0.3);
  const Point2 beacon(4.0, 6.0);
  const VariableType* types[] = {variable_type<Se2>().get(), variable_type<PointXY>().get()};
  const double* states[] = {robot.state().data(), beacon.data()};
  const double distance[] = {4.5};
  EXPECT_LT(check_factor(*factor_type<Range>(), types, states, distance).largest_deviation, 1e-7);
}

TEST(Guide, PartOfAPose) {
  Graph drone, car;
  drone.add(X(0), Pose3(Rot3::yaw(3.0) * Rot3::roll_pitch_yaw(0.0, -0.02, 0.0), Point3(5, 6, 9.2)));
  car.add(X(0), Pose2(2.6, 0.9, 1.65));
  const double unknown = std::numeric_limits<double>::infinity();
  drone.add(Position(X(0), Point3(0.0, 0.0, 9.8)), Information::sigmas(unknown, unknown, 0.3));
  car.add(Position(X(0), Point2(2.1, 0.9)), Information::isotropic(2, 0.5));
  car.add(Prior(X(0), Pose2(0.0, 0.0, 1.6)), Information::sigmas(unknown, unknown, 0.05));
  const Point3 down(0.0, 0.0, -1.0);  // in the world; the other as the robot sees it
  drone.add(Direction(X(0), down, Point3(0.1, 0.0, -9.8)), Information::isotropic(3, 0.02));

  // 2 sigma of the height; the robot sees down at 0.1 / 9.8 rad where its pitch says 0.02.
  const double tilt = 0.02 + 0.1 / 9.8;
  EXPECT_NEAR(chi2(drone), 4.0 + tilt * tilt / (0.02 * 0.02), 0.01);
  EXPECT_NEAR(chi2(car), 1.0 + 1.0, 1e-12);
}

TEST(Guide, Errors) {
  Graph graph = corridor();
  std::string message;
  try {
    optimize(graph, "levenberg_marquardt:linear_slover=cholmod");
  } catch (const Error& error) {
    message = error.what();  // levenberg_marquardt has no option 'linear_slover'; did you mean …
  }
  EXPECT_THAT(message, testing::HasSubstr("did you mean 'linear_solver'?"));
}

TEST(Guide, Threads) {
  Graph graph = corridor();
  set_threads(2);  // 0: all cores; results do not depend on it, to the last bit
  optimize(graph);
  EXPECT_EQ(threads(), 2);
}

}  // namespace
