// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "cairn/geometry/pose.hpp"
#include "cairn/io/format.hpp"
#include "cairn/linear/graph_marginals.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/optimizer.hpp"
#include "support/data.hpp"

namespace cairn::test {

/// The covariance of a graph's last pose, its first being held, as other programs found it: the
/// position's in the world frame [m²], in 3D the trace alone, and the rotation's [rad²].
struct KnownCovariance {
  std::string file;
  double chi2;
  std::vector<double> position;
  double rotation;
  double digits;  ///< half of the last digit that is known, relative
};

/// How a failing test names its graph.
void PrintTo(const KnownCovariance& known, std::ostream* out) { *out << known.file; }

namespace {

const std::vector<KnownCovariance> kKnown = {
    {"pose2d/intel1728.g2o", 45.00469581, {3.523093, 3.396788}, 0.39104519, 2e-7},
    {"pose2d/city10000.g2o", 511.9851636, {0.08607751, 6.94337538}, 0.00768825, 7e-7},
    {"pose2d/CSAIL_sesync.g2o", 40.55512885, {0.06350903, 0.01855380}, 0.00094315, 6e-6},
    {"pose2d/kitti_00.g2o", 98.32201174, {0.10582720, 0.69751949}, 0.00018381, 3e-5},
    {"pose3d/sphere2500.g2o", 727.1496672, {211.29832}, 4 * 0.02502631, 2e-7},
    {"pose3d/parking-garage.g2o", 1.23869058, {2695.7856}, 4 * 4.840323, 2e-7},
};

class PublishedMarginals : public ::testing::TestWithParam<KnownCovariance> {};

TEST_P(PublishedMarginals, OfTheLastPoseAreThoseThatOtherProgramsFound) {
  CAIRN_NEEDS_DATA();
  const KnownCovariance& known = GetParam();
  Registry registry;
  registry.set_type_options({"slam3d", {{"metric", "g2o"}}});
  ReadReport report;
  Graph graph = read_graph(data_folder() / known.file, registry, {}, report);
  const Summary summary =
      registry.make<Optimizer>("levenberg_marquardt")->optimize(graph, {.tolerance = 1e-14});
  EXPECT_NEAR(summary.final_chi2 / known.chi2, 1.0, 1e-8);

  const int last = graph.variable_count() - 1;
  const VariableType& type = graph.type(last);
  const int size = type.tangent_size(), dimension = type.placement()->dimension();
  for (const char* name : {"block_cholesky", "cholmod"}) {
    if (!registry.has("linear_solver", name)) continue;
    SCOPED_TRACE(name);
    const auto solver = registry.make<LinearSolver>(name);
    GraphMarginals marginals(graph, *solver);
    ASSERT_TRUE(marginals.factorize().ok);
    const std::vector<std::pair<int, int>> pair{{last, last}};
    const std::vector<double> block = marginals.blocks(pair);
    const std::vector<double> world = position_covariance(type, graph.state(last), block);
    double trace = 0.0, rotation = 0.0;
    for (int k = 0; k < dimension; ++k) trace += world[k * dimension + k];
    for (int k = dimension; k < size; ++k) rotation += block[k * size + k];
    if (known.position.size() == 1) {
      EXPECT_NEAR(trace / known.position[0], 1.0, known.digits);
    } else {
      for (int k = 0; k < dimension; ++k)
        EXPECT_NEAR(world[k * dimension + k] / known.position[k], 1.0, known.digits);
    }
    EXPECT_NEAR(rotation / known.rotation, 1.0, known.digits);
    // Of all of them, where the recursion and solves may differ.
    const std::vector<double> column = marginals.column(last);
    const std::int64_t rows = graph.tangent_size();
    for (int c = 0; c < size; ++c) {
      for (int r = 0; r < size; ++r)
        EXPECT_NEAR(column[c * rows + rows - size + r], block[c * size + r],
                    1e-9 * std::abs(trace + rotation));
    }
  }
  // The diagonal by the recursion, not by solves.
  const auto solver = registry.make<LinearSolver>("block_cholesky");
  GraphMarginals marginals(graph, *solver);
  ASSERT_TRUE(marginals.factorize().ok);
  const std::vector<double> diagonal = marginals.diagonal();
  const std::vector<double> column = marginals.column(last);
  const std::int64_t rows = graph.tangent_size();
  const double* own = diagonal.data() + diagonal.size() - std::size_t(size) * std::size_t(size);
  for (int c = 0; c < size; ++c) {
    for (int r = 0; r < size; ++r) {
      const double scale = std::sqrt(own[r * size + r] * own[c * size + c]);
      EXPECT_NEAR(own[c * size + r], column[c * rows + rows - size + r], 1e-9 * scale);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Graphs, PublishedMarginals, ::testing::ValuesIn(kKnown),
                         [](const auto& graph) {
                           std::string name = graph.param.file;
                           std::ranges::replace_if(
                               name,
                               [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); },
                               '_');
                           return name;
                         });

}  // namespace
}  // namespace cairn::test
