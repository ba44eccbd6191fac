// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

namespace cairn::test {

/// A pose of the plane or of space by its matrices; a point where R is empty.
struct DensePose {
  Eigen::MatrixXd R;
  Eigen::VectorXd t;

  DensePose inverse() const { return {R.transpose(), -R.transpose() * t}; }
  DensePose operator*(const DensePose& b) const { return {R * b.R, t + R * b.t}; }
};

/// The rotation vector of a rotation matrix, of one number in the plane.
Eigen::VectorXd rotation_vector(const Eigen::MatrixXd& R);
Eigen::MatrixXd rotation(const Eigen::VectorXd& omega);

/// A problem on poses solved with nothing of cairn: errors by matrices, Jacobians by differences,
/// dense normal equations.
class DensePoses {
 public:
  using Error = std::function<Eigen::VectorXd(const std::vector<DensePose>&)>;

  std::vector<DensePose> poses;

  /// A measurement of the poses `on` whose error has that information, which may be singular.
  void add(std::vector<int> on, Error error, const Eigen::MatrixXd& information);
  double chi2() const;
  /// JᵀJ for a step of R·exp(ω) and t + R·v, with (v, ω) of each pose in turn; of a point, t + v.
  Eigen::MatrixXd H() const { return normal_equations().H; }
  /// Gauss-Newton until the steps are nothing.
  void solve();

 private:
  struct Measurement {
    std::vector<int> on;
    Error error;
    Eigen::MatrixXd root;
  };
  struct Normal {
    Eigen::MatrixXd H;
    Eigen::VectorXd g;
  };
  Normal normal_equations() const;
  /// Whitened Jacobian by the step of one pose, from differences of the fourth order.
  Eigen::MatrixXd jacobian(const Measurement& one, int pose) const;
  Eigen::VectorXd residual(const Measurement& one) const { return one.root * one.error(poses); }
  /// Degrees of freedom of a pose or point, and of all before it.
  Eigen::Index size(int pose) const { return poses[pose].t.size() + turns(poses[pose]); }
  Eigen::Index before(int pose) const;
  static Eigen::Index turns(const DensePose& pose);
  static DensePose moved(const DensePose& pose, const Eigen::VectorXd& step);

  std::vector<Measurement> measurements_;
};

}  // namespace cairn::test
