// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "cairn/solve/optimizer.hpp"
#include "results_table.hpp"
#include "support/data.hpp"

namespace cairn::test {

/// How a failing test names its graph.
void PrintTo(const PublishedGraph& graph, std::ostream* out) {
  *out << graph.file << ' ' << graph.metric;
}

namespace {

const std::vector<PublishedGraph> kGraphs = {
    {"pose2d/M3500.g2o", "", "as_given", 137.91295},
    {"pose2d/M3500a.graph", "", "chordal", 912.11501},
    {"pose2d/M3500c.graph", "", "chordal", 4071.1819},
    {"pose2d/manhattanOlson3500.g2o", "", "as_given", 146.07661},
    {"pose2d/manhattanOlson3500_isam.txt", "", "as_given", 6532.7447},
    {"pose2d/intel1228_carlone.g2o", "", "chordal", 215.83024},
    {"pose2d/intel943.g2o", "", "as_given", 546.46111},
    {"pose2d/intel1728.g2o", "", "as_given", 45.004696},
    {"pose2d/intel729_slampp.graph", "", "as_given", 65.402048},
    {"pose2d/MITb.g2o", "", "chordal", 41.163269},
    {"pose2d/killian1941_slampp.graph", "", "as_given", 5.76e-8, 6e-8},
    {"pose2d/killian5489_glc.g2o", "", "as_given", 201.30225},
    {"pose2d/eecs_flat_glc.g2o", "", "as_given", 250.97739},
    {"pose2d/duderstadt_flat_glc.g2o", "", "as_given", 75.729283},
    {"pose2d/FR079.graph", "", "as_given", 37.599116},
    {"pose2d/FR079.g2o", "", "as_given", 37.598468},
    {"pose2d/CSAIL.graph", "", "as_given", 38.956286},
    {"pose2d/CSAIL_sesync.g2o", "", "as_given", 40.555129},
    {"pose2d/city10000.g2o", "", "as_given", 511.98516},
    {"pose2d/city10000_isam.txt", "", "as_given", 31931.412},
    {"pose2d/10kHog-man.graph.gz", "", "as_given", 171545.45},
    {"pose2d/10K.g2o.gz", "", "chordal", 289.7259},
    {"pose2d/w20000_isam.txt", "", "chordal", 1546.2817},
    {"pose2d/ring.g2o", "", "as_given", 11.163101},
    {"pose2d/kitti_00.g2o", "", "as_given", 98.322012},
    {"pose2d/kitti_02.g2o", "", "as_given", 78.764327},
    {"pose2d/kitti_06.g2o", "", "as_given", 25.947085},
    {"pose3d/sphere2500.g2o", "g2o", "as_given", 727.14967},
    {"pose3d/sphere2500.g2o", "rotation_vector", "as_given", 1351.3623},
    {"pose3d/sphere2500_isam.txt", "rotation_vector", "as_given", 14806.454},
    {"pose3d/sphere400_isam.txt", "rotation_vector", "as_given", 2532.2976},
    {"pose3d/sphere2500a.g2o", "g2o", "chordal", 44360.622},
    {"pose3d/sphere2500a.g2o", "rotation_vector", "chordal", 127577.85},
    {"pose3d/sphere_bignoise_vertex3.g2o", "g2o", "chordal", 743862.72},
    {"pose3d/torus3D.g2o.gz", "g2o", "chordal", 14574.746},
    {"pose3d/torus3D.g2o.gz", "rotation_vector", "chordal", 24233.019},
    {"pose3d/torus10000_isam.txt", "rotation_vector", "chordal", 37634.129},
    {"pose3d/parking-garage.g2o", "g2o", "as_given", 1.2386906},
    {"pose3d/parking-garage.g2o", "rotation_vector", "as_given", 1.2683844},
    {"pose3d/cubicle.g2o", "g2o", "chordal", 2346.2435},
    {"pose3d/cubicle.g2o", "rotation_vector", "chordal", 2696.8229},
    {"pose3d/smallGrid3D.g2o", "g2o", "as_given", 458.15378},
    {"pose3d/smallGrid3D.g2o", "rotation_vector", "as_given", 1033.8944},
    {"pose3d/tinyGrid3D.g2o", "g2o", "as_given", 6.7278816},
    {"pose3d/tinyGrid3D.g2o", "rotation_vector", "as_given", 18.616158},
    {"pose3d/eecs_glc.g2o", "g2o", "as_given", 425.50714},
    {"pose3d/duderstadt_glc.g2o", "g2o", "as_given", 130.28189},
    {"landmark2d/victoriaPark_isam.txt", "", "incremental", 6184.1206},
    {"landmark2d/cityTrees10000_isam.txt", "", "as_given", 8668.9281},
};

/// The solvers compared: a short name, and the optimizer with its linear solver.
struct Solver {
  std::string name;
  ComponentSpec spec;
};

std::vector<Solver> solvers() {
  std::vector<Solver> list;
  for (const char* linear : {"block_cholesky", "cholmod", "eigen"}) {
    list.push_back({linear, {"levenberg_marquardt", {{"linear_solver", linear}}}});
  }
  list.push_back({"ceres", {"ceres", {}}});
  return list;
}

std::vector<Result>& results() {
  static std::vector<Result> list;
  return list;
}

std::vector<DefaultResult>& default_results() {
  static std::vector<DefaultResult> list;
  return list;
}

/// Writes the table at the end where CAIRN_RESULTS asks for it.
class Table : public ::testing::Environment {
 public:
  void TearDown() override {
    const char* file = std::getenv("CAIRN_RESULTS");
    if (!file || results().size() < kGraphs.size()) return;
    std::vector<std::string> names;
    for (const Solver& solver : solvers()) names.push_back(solver.name);
    write_results(file, results(), names, default_results());
  }
};
[[maybe_unused]] const auto* const table = ::testing::AddGlobalTestEnvironment(new Table);

class PublishedData : public ::testing::TestWithParam<PublishedGraph> {};

Graph read_published(const PublishedGraph& published, Registry& registry) {
  if (!published.metric.empty())
    registry.set_type_options({"slam3d", {{"metric", published.metric}}});
  ReadReport report;
  return read_graph(data_folder() / published.file, registry, {.repair_information = true}, report);
}

TEST_P(PublishedData, ReachesThePublishedMinimumWithEverySolver) {
  CAIRN_NEEDS_DATA();
  const PublishedGraph& published = GetParam();
  Registry registry;
  Graph graph = read_published(published, registry);
  registry.make<InitialGuess>(published.guess)->compute(graph);

  Result result{.graph = published,
                .variables = graph.variable_count(),
                .factors = graph.factor_count(),
                .chi2 = {},
                .iterations = {}};
  for (const Solver& solver : solvers()) {
    SCOPED_TRACE(solver.name);
    Graph copy = graph.clone();
    const Summary summary =
        registry.make<Optimizer>(solver.spec)->optimize(copy, {.max_iterations = 1000});
    EXPECT_EQ(summary.status, Status::converged);
    if (published.absolute > 0.0) {
      EXPECT_LE(summary.final_chi2, published.absolute);
    } else {
      EXPECT_LE(summary.final_chi2, published.chi2 * (1.0 + 1e-6));
    }
    result.chi2[solver.name] = summary.final_chi2;
    result.iterations[solver.name] = static_cast<int>(summary.iterations.size());
  }
  const double reference = result.chi2.at("block_cholesky");
  for (const auto& [name, chi2] : result.chi2)
    EXPECT_LE(std::abs(chi2 - reference), 1e-8 * reference) << name;
  results().push_back(result);
}

TEST_P(PublishedData, HasTheSameMinimumInMixedPrecision) {
  CAIRN_NEEDS_DATA();
  const PublishedGraph& published = GetParam();
  Registry registry;
  Graph graph = read_published(published, registry);
  registry.make<InitialGuess>(published.guess)->compute(graph);
  std::vector<double> chi2;
  for (const char* linear : {"block_cholesky", "block_cholesky:precision=mixed"}) {
    Graph copy = graph.clone();
    const ComponentSpec spec{"levenberg_marquardt", {{"linear_solver", linear}}};
    const Summary summary = registry.make<Optimizer>(spec)->optimize(
        copy, {.max_iterations = 1000, .tolerance = 1e-12});
    EXPECT_EQ(summary.status, Status::converged) << linear;
    chi2.push_back(summary.final_chi2);
    if (chi2.size() == 2) {
      EXPECT_NE(summary.solver.note.find("mixed precision"), std::string::npos);
    }
  }
  if (published.absolute > 0.0) {
    EXPECT_LE(chi2[1], published.absolute);
  } else {
    EXPECT_LE(std::abs(chi2[1] - chi2[0]), 1e-9 * chi2[0]);
  }
}

double chi2_from_given(const Graph& graph, Registry& registry, const char* optimizer) {
  Graph copy = graph.clone();
  return registry.make<Optimizer>(optimizer)->optimize(copy).final_chi2;
}

/// What `cairn optimize FILE` does, with no option.
TEST_P(PublishedData, ReachesItFromTheStartThatIsChosenByDefault) {
  CAIRN_NEEDS_DATA();
  const PublishedGraph& published = GetParam();
  Registry registry;
  Graph graph = read_published(published, registry);
  DefaultResult result{.graph = published, .start = {}};
  if (std::getenv("CAIRN_RESULTS")) {  // takes minutes
    result.given = chi2_from_given(graph, registry, "levenberg_marquardt");
    result.given_ceres = chi2_from_given(graph, registry, "ceres");
  }
  const std::vector<std::string> notes = registry.make<InitialGuess>("auto")->compute(graph);
  result.start = notes.front().substr(0, notes.front().find(' '));
  result.chi2 = registry.make<Optimizer>("levenberg_marquardt")->optimize(graph).final_chi2;
  EXPECT_LE(result.chi2,
            published.absolute > 0.0 ? published.absolute : published.chi2 * (1.0 + 1e-6));
  default_results().push_back(result);
}

INSTANTIATE_TEST_SUITE_P(
    Graphs, PublishedData, ::testing::ValuesIn(kGraphs), [](const auto& graph) {
      std::string name =
          std::filesystem::path(graph.param.file).filename().string() + "_" + graph.param.metric;
      std::ranges::replace_if(
          name, [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); }, '_');
      return name;
    });

}  // namespace
}  // namespace cairn::test
