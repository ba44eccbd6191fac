// SPDX-License-Identifier: BSD-3-Clause
// Random graphs with directions that nothing measures, by every optimizer and estimator: all are
// found, none is invented, and variables are named rightly. CAIRN_PLANTED_GRAPHS: how many (1000
// for the whole; a few else).
#include "cairn/graph/free_directions.hpp"

#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "cairn/graph/information.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/types/loss.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Contains;
using testing::HasSubstr;

int planted_graphs(int usual) {
  const char* count = std::getenv("CAIRN_PLANTED_GRAPHS");
  return count ? std::atoi(count) : usual;
}

struct Planted {
  Graph graph;
  int free = 0;                    ///< directions
  std::vector<std::string> names;  ///< what a sentence on them must contain
  std::vector<int> landmarks;      ///< that are free in part, and stay
};

/// Poses in a chain with loop closures and landmarks, all determined, and what is not.
class Planter {
 public:
  Planter(Registry& registry, int dimension, unsigned seed)
      : registry_(registry), planar_(dimension == 2), random_(seed) {}

  Planted plant() {
    poses_ = 6 + pick(15);
    for (int k = 0; k < poses_; ++k) add_pose(k);
    planted_.graph.set_fixed(0);
    for (int k = 1; k < poses_; ++k) relate(k - 1, k, whole());
    for (int k = 0; k < poses_ / 4; ++k) {
      const int a = pick(poses_ - 2);
      relate(a, a + 2 + pick(poses_ - a - 2), whole());
    }
    for (int k = 0; k < 3; ++k) see_from(new_landmark(), {pick(poses_), pick(poses_)}, full());
    if (pick(2) == 0) plant_weak();
    const int wanted = pick(4);
    while (planted_.free < wanted) plant_one(wanted - planted_.free);
    return std::move(planted_);
  }

 private:
  int pick(int count) { return static_cast<int>(random_() % static_cast<unsigned>(count)); }
  double uniform() { return std::uniform_real_distribution<double>(-1.0, 1.0)(random_); }
  int points() const { return planar_ ? 2 : 3; }
  int size() const { return planar_ ? 3 : 6; }

  std::vector<double> random_pose(double scale) {
    if (planar_) return {scale * uniform(), scale * uniform(), uniform()};
    Eigen::Quaterniond q(1.0, 0.5 * uniform(), 0.5 * uniform(), 0.5 * uniform());
    q.normalize();
    return {scale * uniform(), scale * uniform(), scale * uniform(), q.x(), q.y(), q.z(), q.w()};
  }
  int add_pose(Id id) {
    return planted_.graph.add_variable(
        registry_.variable_type(planar_ ? "VERTEX_SE2" : "VERTEX_SE3:QUAT"), id, random_pose(10.0));
  }
  int new_landmark() {
    std::vector<double> x;
    for (int k = 0; k < points(); ++k) x.push_back(25.0 + 10.0 * uniform());
    return planted_.graph.add_variable(
        registry_.variable_type(planar_ ? "VERTEX_XY" : "VERTEX_TRACKXYZ"), next_++, x);
  }

  /// A random positive definite matrix of that rank.
  MatrixXd information(int n, int rank, double size = 100.0) {
    while (true) {
      MatrixXd A(n, rank);
      for (double& entry : A.reshaped()) entry = uniform();
      const MatrixXd Q = A.householderQr().householderQ() * MatrixXd::Identity(n, rank);
      const MatrixXd Omega = size * Q * Q.transpose();
      try {  // rounding may make the zero eigenvalues negative
        detail::check_packed_information(pack(MatrixXd(0.5 * (Omega + Omega.transpose()))));
        return Omega;
      } catch (const Error&) {
      }
    }
  }
  MatrixXd whole() { return information(size(), size()); }
  MatrixXd full() { return information(points(), points()); }

  void add_factor(const char* tag, const std::vector<int>& variables,
                  const std::vector<double>& measurement, const MatrixXd& information) {
    planted_.graph.add_factor(registry_.factor_type(tag), variables, measurement,
                              pack(MatrixXd(0.5 * (information + information.transpose()))));
  }
  /// A measurement that the initial estimate fits but for some noise.
  void relate(int a, int b, const MatrixXd& information) {
    const auto type = registry_.factor_type(planar_ ? "EDGE_SE2" : "EDGE_SE3:QUAT");
    const LieGroup& group = *planted_.graph.type(a).lie_group();
    std::vector<double> inverse(planar_ ? 3 : 7), z(inverse.size());
    group.inverse(planted_.graph.state(a).data(), inverse.data());
    group.compose(inverse.data(), planted_.graph.state(b).data(), z.data());
    for (int k = 0; k < points(); ++k) z[static_cast<std::size_t>(k)] += 0.01 * uniform();
    if (planar_) z[2] += 0.01 * uniform();
    planted_.graph.add_factor(type, std::vector<int>{a, b}, z,
                              pack(MatrixXd(0.5 * (information + information.transpose()))));
  }
  void see_from(int landmark, const std::vector<int>& poses, const MatrixXd& information,
                double off = 0.0) {
    for (const int pose : poses) {
      const std::span<const double> x = planted_.graph.state(pose),
                                    l = planted_.graph.state(landmark);
      std::vector<double> z;
      if (planar_) {
        const Eigen::Vector2d p =
            Eigen::Rotation2Dd(-x[2]) * Eigen::Vector2d(l[0] - x[0], l[1] - x[1]);
        z = {p[0], p[1]};
      } else {
        const Eigen::Quaterniond q(x[6], x[3], x[4], x[5]);
        const Eigen::Vector3d p =
            q.conjugate() * Eigen::Vector3d(l[0] - x[0], l[1] - x[1], l[2] - x[2]);
        z = {p[0], p[1], p[2]};
      }
      for (double& number : z) number += off + 0.01 * uniform();
      add_factor(planar_ ? "EDGE_SE2_XY" : "EDGE_SE3_TRACKXYZ", {pose, landmark}, z, information);
    }
  }
  void see_by_bearing_and_range(int landmark, int pose, double bearing, double range) {
    const auto x = planted_.graph.state(pose), l = planted_.graph.state(landmark);
    const Eigen::Vector2d p = Eigen::Rotation2Dd(-x[2]) * Eigen::Vector2d(l[0] - x[0], l[1] - x[1]);
    const MatrixXd information = Eigen::Vector2d(bearing, range).asDiagonal();
    add_factor("EDGE_BEARING_RANGE_SE2_XY", {pose, landmark}, {std::atan2(p[1], p[0]), p.norm()},
               information);
  }

  std::string name(int variable) const { return planted_.graph.describe_variable(variable); }

  /// Determined, though weakly.
  void plant_weak() {
    const int landmark = new_landmark();
    see_from(landmark, {pick(poses_)}, information(points(), points() - 1));
    see_from(landmark, {pick(poses_)}, information(points(), points(), 1e-7));
  }

  void plant_one(int most) {
    const int kind = pick(planar_ ? 5 : 4);
    const int pose = pick(poses_);
    if (kind == 0) return plant_group();
    const int landmark = new_landmark();
    planted_.landmarks.push_back(landmark);
    if (kind == 1 && most >= points() && registry_.has("loss", "tukey")) {
      see_from(landmark, {pose}, full(), 1e4);  // so far off that the loss leaves it no weight
      planted_.graph.set_loss(planted_.graph.factor_count() - 1, registry_.make<Loss>("tukey"));
      planted_.free += points();
      planted_.names.push_back(
          fmt::format("{} is free in all of its {} directions", name(landmark), points()));
      return;
    }
    if (kind >= 3 && planar_) {
      see_by_bearing_and_range(landmark, pose, kind == 3 ? 400.0 : 0.0, kind == 3 ? 0.0 : 100.0);
      planted_.names.push_back(fmt::format("{} is free {} its bearing from pose {}", name(landmark),
                                           kind == 3 ? "along" : "across", pose));
      planted_.free += 1;
      return;
    }
    const int lacks = planar_ || most < 2 ? 1 : 1 + pick(2);
    see_from(landmark, {pose}, information(points(), points() - lacks));
    planted_.names.push_back(name(landmark) + " is free a");
    planted_.free += lacks;
  }

  /// Poses behind a relative pose that lacks one direction.
  void plant_group() {
    const int hinge = pick(poses_), count = 2 + pick(5);
    MatrixXd information = MatrixXd::Identity(size(), size()) * 100.0;
    information(size() - 1, size() - 1) = 0.0;
    int last = hinge;
    for (int k = 0; k < count; ++k) {
      const int pose = add_pose(next_++);
      relate(last, pose, k == 0 ? information : whole());
      last = pose;
    }
    planted_.free += 1;
    planted_.names.push_back(fmt::format("the {} poses after {} can", count, hinge));
  }

  Registry& registry_;
  bool planar_;
  std::mt19937 random_;
  int poses_ = 0;
  Id next_ = 1000;
  Planted planted_;
};

/// Eigenvalues of H scaled to unit diagonal that are zero to rounding: what is free, by dense
/// algebra.
int free_by_dense_algebra(const Graph& graph) {
  Linearizer linearizer(graph, resolve_gauge(graph).held);
  BlockMatrix H(linearizer.structure());
  std::vector<double> g(static_cast<std::size_t>(linearizer.structure().size()));
  linearizer.linearize(graph.values(), H, g);
  const auto n = static_cast<Eigen::Index>(g.size());
  MatrixXd dense(n, n);
  for (Eigen::Index k = 0; k < n; ++k)
    H.multiply({VectorXd::Unit(n, k).eval().data(), g.size()}, {dense.col(k).data(), g.size()});
  const VectorXd scale = dense.diagonal().unaryExpr(
      [&](double d) { return d > 0.0 ? 1.0 / std::sqrt(std::max(d, 1e-10)) : 1.0; });
  const MatrixXd scaled = scale.asDiagonal() * dense * scale.asDiagonal();
  const VectorXd values = Eigen::SelfAdjointEigenSolver<MatrixXd>(scaled).eigenvalues();
  return static_cast<int>((values.array() < 1e-12 * values.maxCoeff()).count());
}

void expect_named(const Planted& planted, const std::vector<std::string>& notes) {
  for (const std::string& name : planted.names) EXPECT_THAT(notes, Contains(HasSubstr(name)));
  if (planted.free > 0) return;
  for (const char* words : {" is free", " can turn", " can shift", " can move"})
    EXPECT_THAT(notes, testing::Not(Contains(HasSubstr(words))));
}

std::string history(const Summary& summary) {
  std::string text;
  for (const Iteration& each : summary.iterations) {
    text += fmt::format("\n{} {} {} {} {}", each.number, each.chi2, each.step_norm, each.lambda,
                        each.accepted);
  }
  return text;
}

class PlantedDirections : public testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    for (const char* types : {"EDGE_SE2", "EDGE_SE3:QUAT"}) {
      try {
        registry_.factor_type(types);
      } catch (const std::exception&) {
        GTEST_SKIP() << "there is no factor type " << types;
      }
    }
  }
  Planted planted(int seed) {
    return Planter(registry_, GetParam(), static_cast<unsigned>(seed)).plant();
  }
  Registry registry_;
};
INSTANTIATE_TEST_SUITE_P(Dimensions, PlantedDirections, testing::Values(2, 3));

TEST_P(PlantedDirections, AreFoundAndNamedAndNoOthers) {
  for (int seed = 0; seed < planted_graphs(300); ++seed) {
    SCOPED_TRACE(seed);
    const Planted planted = this->planted(seed);
    const FreeDirections found = find_free_directions(planted.graph);
    EXPECT_TRUE(found.complete);
    EXPECT_EQ(std::ssize(found.directions), planted.free);
    EXPECT_EQ(free_by_dense_algebra(planted.graph), planted.free);
    expect_named(planted, {found.describe(planted.graph)});
  }
}

TEST_P(PlantedDirections, AreNamedByEveryOptimizer) {
  for (const char* name :
       {"levenberg_marquardt", "dogleg", "gauss_newton", "ceres", "ceres_line_search"}) {
    if (!registry_.has("optimizer", name)) continue;
    const auto optimizer = registry_.make<Optimizer>(with_some_linear_solver(name));
    for (int seed = 0; seed < planted_graphs(40); ++seed) {
      SCOPED_TRACE(testing::Message() << name << ", seed " << seed);
      Planted planted = this->planted(seed);
      const Graph before = planted.graph.clone();
      const Summary summary = optimizer->optimize(planted.graph, {.max_iterations = 200});
      expect_named(planted, summary.notes);
      if (planted.free > 0 && std::string_view(name) == "gauss_newton") {
        EXPECT_EQ(summary.status, Status::not_positive_definite);
        continue;
      }
      if (std::string_view(name) != "ceres_line_search") {
        EXPECT_EQ(summary.status, Status::converged)
            << testing::PrintToString(summary.notes) << history(summary);
      }
      if (std::string_view(name).starts_with("ceres")) continue;  // has scales of its own
      for (const int v : planted.landmarks) {  // begin where the measurements are
        for (std::size_t k = 0; k < before.state(v).size(); ++k)
          EXPECT_NEAR(planted.graph.state(v)[k], before.state(v)[k], 2.0);
      }
    }
  }
}

TEST_P(PlantedDirections, AreNamedByEveryEstimator) {
  // Without hints: a landmark far off would be put where its measurement has weight again.
  for (const std::string name : {"batch", "periodic_batch", "incremental_cholesky:hints=false",
                                 "incremental_qr", "ekf", "eif", "seif"}) {
    if (!registry_.has("estimator", parse_component(name).name)) continue;
    for (int seed = 0; seed < planted_graphs(20); ++seed) {
      SCOPED_TRACE(testing::Message() << name << ", seed " << seed);
      const Planted planted = this->planted(seed);
      const Graph& graph = planted.graph;
      const auto estimator = registry_.make<Estimator>(name);
      std::map<int, std::vector<int>> factors;
      for (int f = 0; f < graph.factor_count(); ++f)
        factors[std::ranges::max(graph.factor_variables(f))].push_back(f);
      UpdateReport report;
      for (int v = 0; v < graph.variable_count(); ++v) {
        GraphUpdate update;
        update.variables.push_back(graph.variable(v));
        for (const int f : factors[v]) update.factors.push_back(graph.factor(f));
        report = estimator->update(update);
      }
      EXPECT_EQ(report.ok, planted.free == 0) << testing::PrintToString(report.notes);
      expect_named(planted, report.notes);
    }
  }
}

/// A drive of n poses with loop closures whose headings are measured at every fifth, far from the
/// origin. Rounding grows along it.
Graph drive_with_a_compass(Registry& registry, int n) {
  const auto pose = registry.variable_type("VERTEX_SE2");
  const auto edge = registry.factor_type("EDGE_SE2"),
             prior = registry.factor_type("EDGE_PRIOR_SE2");
  std::mt19937_64 random(static_cast<std::uint64_t>(n));
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  Graph graph;
  double x = -700.0, y = 400.0, heading = 0.3;
  for (int v = 0; v < n; ++v) {
    graph.add_variable(pose, v, std::array{x, y, std::remainder(heading, 2.0 * std::numbers::pi)});
    x += std::cos(heading) + 0.1 * number(random);
    y += std::sin(heading) + 0.1 * number(random);
    heading += 0.4 * number(random);
  }
  const std::vector<double> information =
      pack(Eigen::MatrixXd(Eigen::Vector3d(400.0, 400.0, 100.0).asDiagonal()));
  const auto link = [&](int a, int b) {
    graph.add_factor(edge, std::array{a, b},
                     std::array{number(random), number(random), number(random)}, information);
  };
  for (int v = 1; v < n; ++v) link(v - 1, v);
  for (int k = 0; k < n / 4; ++k) {
    const int a = static_cast<int>(random() % static_cast<std::uint64_t>(n - 2));
    link(a, a + 2 + static_cast<int>(random() % static_cast<std::uint64_t>(n - 2 - a)));
  }
  for (int v = 2; v < n; v += 5) {
    graph.add_factor(prior, std::array{v}, std::array{0.0, 0.0, number(random)},
                     pack(Eigen::MatrixXd(Eigen::Vector3d(0.0, 0.0, 400.0).asDiagonal())));
  }
  return graph;
}

TEST(FreeDirectionsOfDrives, AreNamedHoweverLongTheyAre) {
  Registry registry;
  if (!registry.has("types", "slam2d")) GTEST_SKIP() << "without slam2d";
  for (const int n : {20, 60, 200, 600, 2000}) {
    Graph graph = drive_with_a_compass(registry, n);
    const FreeDirections found = find_free_directions(graph);
    EXPECT_EQ(found.directions.size(), 2U) << n;
    EXPECT_EQ(found.describe(graph), fmt::format("all {} poses can shift; a prior or one more "
                                                 "measurement holds them",
                                                 n));
    // A position at its end holds all.
    graph.add_factor(registry.factor_type("EDGE_PRIOR_SE2"), std::array{n - 1},
                     std::array{0.0, 0.0, 0.0},
                     pack(Eigen::MatrixXd(Eigen::Vector3d(1e-4, 1e-4, 0.0).asDiagonal())));
    EXPECT_TRUE(find_free_directions(graph).empty()) << n;
  }
}

}  // namespace
}  // namespace cairn::test
