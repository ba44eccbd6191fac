// SPDX-License-Identifier: BSD-3-Clause
// Bundle adjustment from states at which cameras see nothing: points in the plane of a camera, in
// its centre, behind it, and far beyond what it looks at.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "cairn/evaluation/plausibility.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/optimizer.hpp"
#include "support/components.hpp"
#include "support/sampling.hpp"

namespace cairn::test {
namespace {

using testing::Contains;
using testing::HasSubstr;

constexpr int kPoints = 12;
const std::vector<std::string> kOptimizers{"levenberg_marquardt", "gauss_newton", "dogleg",
                                           "ceres:linear_solver_type=dense_schur",
                                           "ceres_line_search"};
std::uint64_t number_of(const char* variable, std::uint64_t otherwise) {
  const char* text = std::getenv(variable);
  return text ? std::strtoull(text, nullptr, 10) : otherwise;
}
/// CAIRN_CAMERA_PROBLEMS, or 60; from CAIRN_CAMERA_SEED on, or 0.
std::uint64_t problems() { return number_of("CAIRN_CAMERA_PROBLEMS", 60); }
std::uint64_t first_seed() { return number_of("CAIRN_CAMERA_SEED", 0); }

enum class Place { in_plane, nearly, centre, behind, far_behind, beyond };
constexpr int kPlaces = 6;

struct Camera {
  Eigen::Matrix3d R;  // from camera to world
  Eigen::Vector3d t;
};

/// Cameras on an arc around the origin, six away from it, looking at it along −z.
std::vector<Camera> cameras_on_arc(int count) {
  std::vector<Camera> all;
  for (int k = 0; k < count; ++k) {
    const double angle = 0.3 * k;
    const Eigen::Matrix3d R = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).matrix();
    all.push_back({R, 6.0 * R.col(2)});
  }
  return all;
}

/// A point that this camera cannot see, or hardly.
Eigen::Vector3d misplaced(const Camera& camera, const Eigen::Vector3d& X, Place place,
                          Sampler& sampler) {
  Eigen::Vector3d P = camera.R.transpose() * (X - camera.t);
  switch (place) {
    case Place::in_plane:
      P = {sampler.uniform(-3.0, 3.0), sampler.uniform(-3.0, 3.0), 0.0};
      break;
    case Place::nearly:
      P[2] = sampler.uniform(-1.0, 1.0) * std::pow(10.0, sampler.uniform(-14.0, -2.0));
      break;
    case Place::centre:
      P.setZero();
      break;
    case Place::behind:
      P = {P[0], P[1], sampler.uniform(0.1, 5.0)};
      break;
    case Place::far_behind:
      P *= -std::pow(10.0, sampler.uniform(0.0, 6.0));
      break;
    case Place::beyond:
      P *= std::pow(10.0, sampler.uniform(0.5, 6.0));
      break;
  }
  return camera.R * P + camera.t;
}

class SingularCameras : public testing::Test {
 protected:
  void SetUp() override {
    if (!registry.has("variable", "VERTEX_CAMERA_BAL") ||
        !registry.has("variable", "VERTEX_TRACKXYZ"))
      GTEST_SKIP() << "the types are not there";
  }

  /// Images of points with a noise of half a pixel. `misplace`: the states of some points are where
  /// cameras see nothing; else all are where they should be.
  Graph problem(std::uint64_t seed, bool misplace) {
    Sampler sampler(seed);
    const int count = 3 + static_cast<int>(seed % 3);
    const std::vector<Camera> cameras = cameras_on_arc(count);
    const double k1 = seed % 2 ? 0.0 : -0.05, k2 = seed % 2 ? 0.0 : 0.01;
    const double coarse = seed % 4 < 2 ? 0.02 : 0.1;
    Graph graph;
    for (int k = 0; k < count; ++k) {
      const Camera& camera = cameras[static_cast<std::size_t>(k)];
      const Eigen::Quaterniond q(camera.R);
      graph.add(Variable{
          registry.variable_type("VERTEX_CAMERA_BAL"),
          k,
          {500.0, k1, k2, camera.t[0], camera.t[1], camera.t[2], q.x(), q.y(), q.z(), q.w()}});
    }
    std::vector<Factor> images;
    for (int p = 0; p < kPoints; ++p) {
      const Eigen::Vector3d X(sampler.uniform(-1.5, 1.5), sampler.uniform(-1.5, 1.5),
                              sampler.uniform(-1.5, 1.5));
      for (int k = 0; k < count; ++k) {
        const Camera& camera = cameras[static_cast<std::size_t>(k)];
        const Eigen::Vector3d P = camera.R.transpose() * (X - camera.t);
        const Eigen::Vector2d at = -P.head<2>() / P[2];
        const double n = at.squaredNorm();
        const Eigen::Vector2d z = 500.0 * (1.0 + n * (k1 + n * k2)) * at;
        images.push_back({registry.factor_type("EDGE_PROJECT_BAL"),
                          {k, count + p},
                          {z[0] + sampler.uniform(-0.8, 0.8), z[1] + sampler.uniform(-0.8, 0.8)},
                          {1.0, 0.0, 1.0}});
      }
      Eigen::Vector3d start = X;
      for (int k = 0; k < 3; ++k) start[k] += sampler.uniform(-coarse, coarse);
      const bool chosen = p < 1 + static_cast<int>(seed / 7 % 3);
      const auto of = static_cast<std::size_t>(sampler.uniform(0.0, count));
      const auto place = static_cast<Place>((seed + static_cast<std::uint64_t>(p)) % kPlaces);
      const Eigen::Vector3d wrong = misplaced(cameras[of], X, place, sampler);
      if (chosen && misplace) start = wrong;
      graph.add(Variable{
          registry.variable_type("VERTEX_TRACKXYZ"), count + p, {start[0], start[1], start[2]}});
    }
    for (const Factor& image : images) graph.add(image);
    return graph;
  }

  Registry registry;
};

/// chi2 of the best of several starts and optimizers.
double least(const Graph& given, const Graph& right, Registry& registry) {
  double best = std::numeric_limits<double>::infinity();
  for (const char* name : {"levenberg_marquardt", "dogleg"}) {
    if (!registry.has("optimizer", name)) continue;
    const auto optimizer = registry.make<Optimizer>(with_some_linear_solver(name));
    for (const Graph* start : {&given, &right}) {
      Graph graph = start->clone();
      best = std::min(best, optimizer->optimize(graph).final_chi2);
    }
  }
  return best;
}

TEST_F(SingularCameras, HideNoWorseMinimum) {
  for (const std::string& name : kOptimizers) {
    if (!registry.has("optimizer", parse_component(name).name)) continue;
    const auto optimizer = registry.make<Optimizer>(with_some_linear_solver(name));
    std::uint64_t arrived = 0;
    for (std::uint64_t seed = first_seed(); seed < first_seed() + problems(); ++seed) {
      const Graph given = problem(seed, true);
      const double best = least(given, problem(seed, false), registry);
      Graph graph = given.clone();
      const Summary summary = optimizer->optimize(graph);
      const bool is_best = summary.final_chi2 <= best * (1.0 + 1e-6);
      arrived += is_best && summary.status == Status::converged;
      if (summary.status != Status::converged || is_best) continue;
      EXPECT_FALSE(reasons_for_doubt(graph, summary.final_chi2).empty())
          << name << " from " << seed << " ends at " << summary.final_chi2 << ", not " << best;
    }
    // Gauss-Newton needs a gauge that is not free; line search is slow.
    if (name != "gauss_newton" && name != "ceres_line_search") {
      EXPECT_GE(arrived, 98 * problems() / 100) << name;
    }
  }
}

// With hardly more images than unknowns minima lie beside each other, within what is uncertain: one
// optimizer ends at chi2 4.60, others at 4.03, at the truth's place or elsewhere.
TEST_F(SingularCameras, OfWhichAnotherMinimumIsLowerAreDoubted) {
  CAIRN_NEEDS("optimizer", "dogleg");
  CAIRN_NEEDS("optimizer", "levenberg_marquardt");
  for (const std::uint64_t seed : {855U, 1747U, 1899U, 1965U}) {
    double least = std::numeric_limits<double>::infinity();
    std::vector<std::pair<double, std::vector<std::string>>> ends;
    for (const char* name : {"dogleg", "levenberg_marquardt"}) {
      Graph graph = problem(seed, true);
      const double chi2 =
          registry.make<Optimizer>(with_some_linear_solver(name))->optimize(graph).final_chi2;
      least = std::min(least, chi2);
      ends.emplace_back(chi2, reasons_for_doubt(graph, chi2));
    }
    for (const auto& [chi2, doubts] : ends) {
      if (chi2 <= least * (1.0 + 1e-6)) continue;
      EXPECT_THAT(doubts, Contains(HasSubstr("there is another minimum"))) << seed;
    }
  }
}

// From where no step leads back, all of them come to the same minimum.
TEST_F(SingularCameras, AreLeftBehindAtOnce) {
  for (const std::string& name : kOptimizers) {
    if (name == "gauss_newton" || !registry.has("optimizer", parse_component(name).name)) continue;
    const auto optimizer = registry.make<Optimizer>(with_some_linear_solver(name));
    for (const std::uint64_t seed : {0U, 2U, 18U}) {  // in the plane, in the centre
      const Graph given = problem(seed, true);
      Graph graph = given.clone();
      const Summary summary = optimizer->optimize(graph, {.max_iterations = 2000});
      EXPECT_EQ(summary.status, Status::converged) << name << ' ' << seed;
      const double best = least(given, problem(seed, false), registry);
      EXPECT_NEAR(summary.final_chi2, best, 1e-6 * best) << name << ' ' << seed;
      EXPECT_NEAR(summary.initial_chi2, chi2(given), 1e-9 * chi2(given)) << name << ' ' << seed;
      EXPECT_THAT(summary.notes, Contains(HasSubstr("began where"))) << name << ' ' << seed;
    }
  }
}

// What stays behind its camera is named, however well it fits: the image is mirrored.
TEST_F(SingularCameras, AreNamedWhereAPointStaysBehindThem) {
  Graph graph = problem(1, false);
  EXPECT_THAT(outside_of_domains(graph), testing::IsEmpty());
  const int point = *graph.find(5);
  graph.set_state(point, std::vector<double>{0.0, 0.0, 100.0});
  EXPECT_THAT(outside_of_domains(graph),
              testing::ElementsAre("EDGE_PROJECT_BAL 0 5: the point is behind the camera, which "
                                   "cannot see it; so are 3 more"));
  graph.set_state(point, std::vector<double>{1.0, 2.0, 6.0});
  EXPECT_THAT(outside_of_domains(graph), Contains(HasSubstr("in the plane of the camera")));
}

}  // namespace
}  // namespace cairn::test
