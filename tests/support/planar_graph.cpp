// SPDX-License-Identifier: BSD-3-Clause
#include "support/planar_graph.hpp"

#include <array>
#include <cmath>
#include <random>
#include <string_view>
#include <tuple>
#include <vector>

#include <Eigen/Core>

#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/types/define_factor.hpp"

namespace cairn::test {
namespace {

/// Relative pose, differentiated automatically.
struct RelativePose {
  static constexpr std::string_view kTag = "EDGE_SE2";
  static constexpr int kResidual = 3, kMeasurement = 3;
  static constexpr bool kRelative = true;
  using Variables = std::tuple<Se2, Se2>;
  template <class S>
  static Vector<S, 3> residual(const Vector<S, 3>& a, const Vector<S, 3>& b,
                               const Vector<double, 3>& z) noexcept {
    const Vector<S, 3> measured = z.template cast<S>();
    return Se2::between<S>(measured, Se2::between<S>(a, b));
  }
  static bool propagate(int target, const double* const* x, const double* z, double* out) {
    using Pose = Vector<double, 3>;
    const Pose measured = Eigen::Map<const Pose>(z);
    const Pose other = Eigen::Map<const Pose>(x[1 - target]);
    Eigen::Map<Pose>{out} =
        Se2::compose<double>(other, target == 1 ? measured : Pose(Se2::inverse<double>(measured)));
    return true;
  }
};

struct PosePrior {
  static constexpr std::string_view kTag = "EDGE_PRIOR_SE2";
  static constexpr int kResidual = 3, kMeasurement = 3;
  using Variables = std::tuple<Se2>;
  template <class S>
  static Vector<S, 3> residual(const Vector<S, 3>& a, const Vector<double, 3>& z) noexcept {
    return Se2::between<S>(z.template cast<S>(), a);
  }
};

struct PointPrior {
  static constexpr std::string_view kTag = "EDGE_PRIOR_XY";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<PointXY>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 2>& a, const Vector<double, 2>& z) noexcept {
    return a - z.template cast<S>();
  }
};

/// A point seen from a pose.
struct PointSeen {
  static constexpr std::string_view kTag = "EDGE_SE2_XY";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<Se2, PointXY>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 3>& pose, const Vector<S, 2>& point,
                               const Vector<double, 2>& z) noexcept {
    using std::cos;
    using std::sin;
    const S c = cos(pose[2]), s = sin(pose[2]), dx = point[0] - pose[0], dy = point[1] - pose[1];
    return {c * dx + s * dy - z[0], c * dy - s * dx - z[1]};
  }
};

}  // namespace

PlanarTypes::PlanarTypes()
    : pose(define_variable<Se2>()),
      point(define_variable<PointXY>()),
      relative_pose(define_factor<RelativePose>()),
      prior(define_factor<PosePrior>()),
      point_prior(define_factor<PointPrior>()),
      point_seen(define_factor<PointSeen>()) {}

Graph random_graph(const PlanarTypes& types, int poses, int points, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto numbers = [&](int n, double scale) {
    std::vector<double> x(n);
    for (double& v : x) v = scale * uniform(rng);
    return x;
  };
  // Ω = AᵀA + I/2, packed.
  const auto information = [&](int n) {
    Eigen::MatrixXd A(n, n);
    for (double& v : A.reshaped()) v = uniform(rng);
    const Eigen::MatrixXd omega = A.transpose() * A + 0.5 * Eigen::MatrixXd::Identity(n, n);
    std::vector<double> packed;
    for (int r = 0; r < n; ++r) {
      for (int c = r; c < n; ++c) packed.push_back(omega(r, c));
    }
    return packed;
  };
  Graph graph;
  for (int k = 0; k < poses; ++k) graph.add_variable(types.pose, k, numbers(3, 3.0));
  for (int k = 0; k < points; ++k) graph.add_variable(types.point, poses + k, numbers(2, 3.0));
  const auto connect = [&](int a, int b) {
    graph.add_factor(types.relative_pose, std::array{a, b}, numbers(3, 2.0), information(3));
  };
  for (int k = 1; k < poses; ++k) connect(k - 1, k);
  for (int k = 0; k < 2 * poses; ++k) {
    const int a = static_cast<int>(rng() % poses), b = static_cast<int>(rng() % poses);
    if (a != b) connect(a, b);
  }
  for (int k = 0; k < 3 * points; ++k) {
    graph.add_factor(types.point_seen,
                     std::array{static_cast<int>(rng() % poses), poses + k % points},
                     numbers(2, 2.0), information(2));
  }
  graph.add_factor(types.prior, std::array{poses / 2}, numbers(3, 2.0), information(3));
  return graph;
}

}  // namespace cairn::test
