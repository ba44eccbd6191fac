// SPDX-License-Identifier: BSD-3-Clause
// Drives with an altimeter or with GNSS: whether the estimate is as good as its covariance says.
#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/cairn.hpp"
#include "support/dense_system.hpp"
#include "support/pose_world.hpp"

namespace cairn::test {
namespace {

using Eigen::VectorXd;

constexpr double kUnknown = std::numeric_limits<double>::infinity();

/// The quantile of χ² with n degrees of freedom at z standard deviations of the normal
/// distribution (Wilson and Hilferty); exact to 1e-4 of it for n above 100.
double quantile(double n, double z) {
  const double spread = 2.0 / (9.0 * n);
  return n * std::pow(1.0 - spread + z * std::sqrt(spread), 3.0);
}
void expect_within_band(double sum, double n, const char* what) {
  EXPECT_GT(sum, quantile(n, -1.96)) << what << " " << sum / n << " per degree of freedom";
  EXPECT_LT(sum, quantile(n, 1.96)) << what << " " << sum / n << " per degree of freedom";
}

/// A drive along true poses: odometry from one to the next, and what else is measured.
class Drive {
 public:
  Drive(std::vector<Pose3> truth, const VectorXd& odometry, unsigned seed)
      : truth_(std::move(truth)), draw_(seed) {
    for (int k = 0; k < std::ssize(truth_); ++k) graph_.add(k, moved(truth_[k], 0.01));
    for (int k = 0; k + 1 < std::ssize(truth_); ++k) {
      const VectorXd noise = odometry.cwiseProduct(draw_.normals(6));
      const Pose3 error(Rot3::exp(noise.tail(3)), Point3(noise[0], noise[1], noise[2]));
      graph_.add(Between(k, k + 1, truth_[k].between(truth_[k + 1]) * error.inverse()),
                 Information::sigmas(std::span(odometry.data(), 6)));
    }
  }
  void hold_first() {
    graph_.set_state(0, truth_.front());
    graph_.set_fixed(0);
  }
  /// The position of a pose with these standard deviations [m], infinite for what is not measured:
  /// as a prior on the pose, or as what it is.
  void measure_position(int k, const Eigen::Vector3d& sigma, bool as_prior) {
    Point3 z = truth_[k].translation();
    for (int axis = 0; axis < 3; ++axis)
      z[axis] = std::isinf(sigma[axis]) ? 0.0 : z[axis] + sigma[axis] * draw_.normal();
    if (as_prior) {
      graph_.add(Prior(k, Pose3(Rot3(), z)),
                 Information::sigmas(sigma[0], sigma[1], sigma[2], kUnknown, kUnknown, kUnknown));
    } else {
      graph_.add(Position(k, z), Information::sigmas(sigma[0], sigma[1], sigma[2]));
    }
  }

  struct Result {
    double nees = 0.0, chi2 = 0.0;
    double unknowns = 0.0, freedom = 0.0;
  };
  /// NEES of the whole trajectory and chi2, with their degrees of freedom.
  Result run() {
    const Summary summary = optimize_from_states(graph_);
    EXPECT_EQ(summary.status, Status::converged);
    const DenseSystem system = dense_system(graph_);
    VectorXd error(system.H.rows());
    for (const auto& [id, rows] : system.rows) {
      error.segment(rows.first, rows.size) =
          graph_.at<Pose3>(id).local(truth_[static_cast<std::size_t>(id)]);
    }
    Result result{.nees = error.dot(system.H * error),
                  .chi2 = summary.final_chi2,
                  .unknowns = static_cast<double>(error.size())};
    for (int f = 0; f < graph_.factor_count(); ++f) result.freedom += graph_.information_rank(f);
    result.freedom -= result.unknowns;
    return result;
  }

 private:
  Pose3 moved(const Pose3& pose, double by) { return pose.retract(by * draw_.normals(6)); }

  std::vector<Pose3> truth_;
  Draw draw_;
  Graph graph_;
};

std::vector<Pose3> straight_ahead() {
  std::vector<Pose3> poses;
  for (int k = 0; k <= 20; ++k) poses.emplace_back(Rot3(), Point3(10.0 * k, 0.0, 0.0));
  return poses;
}
std::vector<Pose3> circle() {
  std::vector<Pose3> poses;
  for (int k = 0; k < 40; ++k) {
    const double angle = 0.2 * k;
    poses.emplace_back(Rot3::yaw(angle),
                       Point3(20.0 * std::sin(angle), -20.0 * std::cos(angle), 0));
  }
  return poses;
}
VectorXd odometry(double translation, double rotation) {
  VectorXd sigma(6);
  sigma << VectorXd::Constant(3, translation), VectorXd::Constant(3, rotation);
  return sigma;
}

Drive::Result drive(unsigned seed) {
  const bool as_prior = seed % 2 == 0;
  if (seed % 4 < 2) {  // 200 m with an altimeter
    Drive drive(straight_ahead(), odometry(0.02, 0.003), seed);
    drive.hold_first();
    for (int k = 0; k <= 20; ++k) drive.measure_position(k, {kUnknown, kUnknown, 0.1}, as_prior);
    return drive.run();
  }
  Drive drive(circle(), odometry(0.05, 0.01), seed);  // GNSS at every fourth pose
  for (int k = 0; k < 40; k += 4) drive.measure_position(k, {0.5, 0.5, 1.0}, as_prior);
  return drive.run();
}

TEST(Drives, WithAltimeterOrGnssAreAsCertainAsTheirCovariance) {
  Drive::Result sum;
  for (unsigned seed = 0; seed < 200; ++seed) {
    const Drive::Result one = drive(seed);
    sum.nees += one.nees;
    sum.chi2 += one.chi2;
    sum.unknowns += one.unknowns;
    sum.freedom += one.freedom;
  }
  expect_within_band(sum.nees, sum.unknowns, "NEES");
  expect_within_band(sum.chi2, sum.freedom, "chi2");
}

}  // namespace
}  // namespace cairn::test
