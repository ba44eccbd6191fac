// SPDX-License-Identifier: BSD-3-Clause
#include "support/sample_graphs.hpp"

#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>

#include "cairn/graph/gauge.hpp"
#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/types/define_factor.hpp"
#include "support/block_systems.hpp"
#include "support/sample_matrices.hpp"

namespace cairn::test {
namespace {

struct RelativePose {
  static constexpr std::string_view kTag = "TEST_RELATIVE_POSE";
  static constexpr int kResidual = 3, kMeasurement = 3;
  using Variables = std::tuple<Se2, Se2>;
  template <class S>
  static Vector<S, 3> residual(const Vector<S, 3>& a, const Vector<S, 3>& b,
                               const Vector<double, 3>& z) {
    const Vector<S, 3> measured = z.cast<S>();
    return Se2::between<S>(measured, Se2::between<S>(a, b));
  }
};

struct SeenPoint {
  static constexpr std::string_view kTag = "TEST_SEEN_POINT";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<Se2, PointXY>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 3>& pose, const Vector<S, 2>& point,
                               const Vector<double, 2>& z) {
    const Vector<S, 3> seen = Se2::between<S>(pose, Vector<S, 3>(point[0], point[1], S(0.0)));
    return {seen[0] - z[0], seen[1] - z[1]};
  }
};

struct AbsolutePose {
  static constexpr std::string_view kTag = "TEST_ABSOLUTE_POSE";
  static constexpr int kResidual = 3, kMeasurement = 3;
  using Variables = std::tuple<Se2>;
  template <class S>
  static Vector<S, 3> residual(const Vector<S, 3>& pose, const Vector<double, 3>& z) {
    return Se2::between<S>(z.cast<S>(), pose);
  }
};

struct Arctangent {
  static constexpr std::string_view kTag = "TEST_ARCTANGENT";
  static constexpr int kResidual = 2, kMeasurement = 1;
  using Variables = std::tuple<PointXY>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 2>& x, const Vector<double, 1>& z) {
    using std::atan2;
    return {atan2(z[0] * x[0], S(1.0)), x[1]};
  }
};

struct Valley {
  static constexpr std::string_view kTag = "TEST_VALLEY";
  static constexpr int kResidual = 2, kMeasurement = 1;
  using Variables = std::tuple<PointXY>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 2>& x, const Vector<double, 1>& z) {
    return {z[0] * (x[1] - x[0] * x[0]), 1.0 - x[0]};
  }
};

struct LargeResidual {
  static constexpr std::string_view kTag = "TEST_LARGE_RESIDUAL";
  static constexpr int kResidual = 3, kMeasurement = 1;
  using Variables = std::tuple<PointXY>;
  template <class S>
  static Vector<S, 3> residual(const Vector<S, 2>& x, const Vector<double, 1>& z) {
    return {x[0] + 1.0, z[0] * (x[0] * x[0]) + x[0] - 1.0, x[1]};
  }
};

/// Reproducible noise in [-1, 1].
class Noise {
 public:
  explicit Noise(std::uint32_t seed) : state_(seed) {}
  double operator()() {
    state_ = state_ * 1664525U + 1013904223U;
    return static_cast<double>(state_ >> 8) * 0x1p-23 - 1.0;
  }

 private:
  std::uint32_t state_;
};

using Pose = Vector<double, 3>;

Pose noisy(const Pose& pose, double amount, Noise& noise) {
  return Se2::retract<double>(pose, amount * Pose(noise(), noise(), noise()));
}

template <int N>
std::vector<double> information(double weight) {
  std::vector<double> upper;
  for (int row = 0; row < N; ++row) {
    for (int column = row; column < N; ++column)
      upper.push_back(row == column ? weight * (1 + row) : 0.1 * weight);
  }
  return upper;
}

template <class V>
std::span<const double> numbers(const V& v) {
  return {v.data(), static_cast<std::size_t>(v.size())};
}

template <class Factor>
Graph one_point(double x, double y, double measurement) {
  Graph graph;
  const int point = graph.add_variable(define_variable<PointXY>(), 7, std::vector{x, y});
  std::vector<double> upper;
  for (int row = 0; row < Factor::kResidual; ++row) {
    for (int column = row; column < Factor::kResidual; ++column)
      upper.push_back(row == column ? 1.0 : 0.0);
  }
  graph.add_factor(define_factor<Factor>(), std::vector{point}, std::vector{measurement}, upper);
  return graph;
}

}  // namespace

Graph ring_of_poses(int poses, double noise, int outliers) {
  Graph graph;
  Noise random(17);
  const auto type = define_variable<Se2>();
  const auto factor = define_factor<RelativePose>();
  std::vector<Pose> truth;
  for (int k = 0; k < poses; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / poses;
    truth.push_back(
        {5.0 * std::cos(angle), 5.0 * std::sin(angle), wrap_angle(angle + std::numbers::pi / 2)});
    graph.add_variable(type, k, numbers(noisy(truth[k], k == 0 ? 0.0 : noise, random)));
  }
  const auto measure = [&](int a, int b, const Pose& error) {
    const Pose z =
        Se2::compose<double>(noisy(Se2::between<double>(truth[a], truth[b]), noise, random), error);
    graph.add_factor(factor, std::vector{a, b}, numbers(z), information<3>(1.0 / (noise * noise)));
  };
  for (int k = 1; k < poses; ++k) measure(k - 1, k, Pose::Zero());
  measure(poses - 1, 0, Pose::Zero());
  for (int k = 0; k + poses / 2 < poses; k += 3) {
    measure(k, k + poses / 2, outliers-- > 0 ? Pose(2.0, -1.0, 0.5) : Pose(0.0, 0.0, 0.0));
  }
  return graph;
}

Graph poses_and_points(int poses, double noise) {
  Graph graph;
  Noise random(23);
  const auto pose_type = define_variable<Se2>();
  const auto point_type = define_variable<PointXY>();
  const auto odometry = define_factor<RelativePose>();
  const auto seen = define_factor<SeenPoint>();
  const auto truth = [](int k) { return Pose(1.0 * k, std::sin(0.3 * k), 0.1 * k); };
  int previous = -1;
  for (int k = 0; k < poses; ++k) {
    const int pose =
        graph.add_variable(pose_type, k, numbers(noisy(truth(k), k == 0 ? 0.0 : noise, random)));
    if (k > 0) {
      const Pose z = noisy(Se2::between<double>(truth(k - 1), truth(k)), noise, random);
      graph.add_factor(odometry, std::vector{previous, pose}, numbers(z),
                       information<3>(1.0 / (noise * noise)));
    }
    previous = pose;
  }
  for (int k = 0; k < poses / 2; ++k) {
    const Vector<double, 2> position(2.0 * k + 0.5, 2.0 + 0.1 * k);
    const Vector<double, 2> guess = position + noise * Vector<double, 2>(random(), random());
    const int point = graph.add_variable(point_type, 1000 + k, numbers(guess));
    for (int pose = 2 * k; pose < std::min(poses, 2 * k + 4); ++pose) {
      const Vector<double, 2> z =
          Se2::between<double>(truth(pose), Pose(position[0], position[1], 0.0)).head<2>() +
          noise * Vector<double, 2>(random(), random());
      graph.add_factor(seen, std::vector{*graph.find(pose), point}, numbers(z),
                       information<2>(1.0 / (noise * noise)));
    }
  }
  return graph;
}

Graph stiff_chain(int poses, double strong) {
  Graph graph;
  const auto type = define_variable<Se2>();
  const auto odometry = define_factor<RelativePose>();
  const Pose step(100.0, 0.0, 0.0);
  const auto diagonal = [](double x) { return std::vector{x, 0.0, 0.0, x, 0.0, x}; };
  for (int k = 0; k < poses; ++k) {
    graph.add_variable(type, k, numbers(Pose(100.0 * k, 0.0, 0.0)));
    if (k > 0) graph.add_factor(odometry, std::vector{k - 1, k}, numbers(step), diagonal(strong));
  }
  graph.add_factor(define_factor<AbsolutePose>(), std::vector{0}, numbers(Pose(0.0, 0.0, 0.0)),
                   diagonal(1.0));
  return graph;
}

Graph held_by_a_point(int poses) {
  Graph graph = poses_and_points(poses, 0.01);
  graph.set_fixed(*graph.find(1000));
  return graph;
}

Graph overshooting(double x) { return one_point<Arctangent>(x, 0.5, 10.0); }
Graph rosenbrock() { return one_point<Valley>(-1.2, 1.0, 10.0); }
Graph large_residuals(double lambda) { return one_point<LargeResidual>(0.3, 0.1, lambda); }

Graph everything_held() {
  Graph graph = ring_of_poses(5, 0.1);
  for (int v = 0; v < graph.variable_count(); ++v) graph.set_fixed(v);
  return graph;
}

double dense_minimum(const Graph& graph) {
  Linearizer linearizer(graph, resolve_gauge(graph).held);
  BlockMatrix H(linearizer.structure());
  Values values = graph.values();
  Eigen::VectorXd g(linearizer.structure().size());
  const std::span<double> g_span(g.data(), static_cast<std::size_t>(g.size()));
  double lowest = linearizer.chi2(values);
  for (int iteration = 0; iteration < 400; ++iteration) {
    lowest = std::min(lowest, linearizer.linearize(values, H, g_span));
    const Eigen::VectorXd step = dense(H).ldlt().solve(g);
    linearizer.retract(values, {step.data(), static_cast<std::size_t>(step.size())}, values);
    if (step.norm() < 1e-14) break;
  }
  return std::min(lowest, linearizer.chi2(values));
}

double chi2_of(const Graph& graph) {
  const std::vector<double> norms = squared_norms(graph);
  double sum = 0.0;
  for (int position = 0; position < graph.factor_count(); ++position) {
    double rho = norms[position];
    if (const Loss* loss = graph.loss(position))
      loss->evaluate({&norms[position], 1}, {&rho, 1}, {});
    sum += rho;
  }
  return sum;
}

}  // namespace cairn::test
