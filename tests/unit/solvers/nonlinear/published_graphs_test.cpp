// SPDX-License-Identifier: BSD-3-Clause
// Real graphs with known minima, solved by everything that is registered.
#include <gtest/gtest.h>

#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/optimizer.hpp"
#include "support/components.hpp"
#include "support/data.hpp"

namespace cairn::test {
namespace {

struct PublishedGraph {
  const char* file;
  const char* types;  ///< options of a types plugin, or empty
  double chi2;        ///< at the minimum, as published with the data
};

class PublishedGraphTest : public testing::TestWithParam<PublishedGraph> {};
INSTANTIATE_TEST_SUITE_P(
    AsGiven, PublishedGraphTest,
    testing::Values(PublishedGraph{"pose2d/manhattanOlson3500.g2o", "", 146.07661},
                    PublishedGraph{"pose2d/intel1728.g2o", "", 45.004696},
                    PublishedGraph{"pose2d/FR079.g2o", "", 37.598468},
                    PublishedGraph{"pose3d/smallGrid3D.g2o", "slam3d:metric=g2o", 458.15378},
                    PublishedGraph{"pose3d/tinyGrid3D.g2o", "slam3d:metric=rotation_vector",
                                   18.616158}),
    [](const auto& test) {
      std::string name = test.param.file + 7;
      return name.substr(0, name.find('.'));
    });

/// Every optimizer with every linear solver that it takes.
std::vector<std::string> combinations(Registry& registry) {
  std::vector<std::string> specs;
  for (const std::string& optimizer : registry.names("optimizer")) {
    const OptionSpec* option = registry.options("optimizer", optimizer).find("linear_solver");
    if (!option || option->type != OptionType::component) {
      specs.push_back(optimizer);
      continue;
    }
    for (const std::string& solver : registry.names("linear_solver")) {
      specs.push_back(optimizer + ":linear_solver=" + solver);
    }
  }
  return specs;
}

/// Whether a linear solver's own documentation says that a graph of this size is not for it.
bool beyond(const std::string& linear_solver, const Graph& graph) {
  // Relaxation takes some n² sweeps for n poses in a row.
  if (linear_solver == "jacobi" || linear_solver == "gauss_seidel")
    return graph.variable_count() > 200;
  // Dense: n³/3 operations.
  if (linear_solver == "lapack") return graph.tangent_size() > 1000;
  return false;
}

TEST_P(PublishedGraphTest, EveryOptimizerReachesThePublishedMinimumWithEverySolver) {
  CAIRN_NEEDS_DATA();
  Registry registry;
  if (!registry.has("format", "g2o") || !registry.has("variable", "VERTEX_SE2") ||
      !registry.has("variable", "VERTEX_SE3:QUAT")) {
    GTEST_SKIP() << "the format or the types are not there";
  }
  const PublishedGraph& published = GetParam();
  if (*published.types) registry.set_type_options(parse_component(published.types));
  const Graph given = read_graph(data_folder() / published.file, registry);
  double first = -1.0;
  for (const std::string& spec : combinations(registry)) {
    SCOPED_TRACE(spec);
    const ComponentSpec parts = parse_component(spec);
    const auto solver = parts.values.find("linear_solver");
    if (solver != parts.values.end() && beyond(solver->second, given)) continue;
    Graph graph = given.clone();
    const Summary summary = registry.make<Optimizer>(spec)->optimize(graph);
    // Needs thousands of iterations on large graphs, where these are 200.
    if (spec == "ceres_line_search" && summary.status == Status::max_iterations) continue;
    EXPECT_EQ(summary.status, Status::converged);
    EXPECT_NEAR(summary.final_chi2, published.chi2, 1e-6 * published.chi2);
    if (first < 0.0) first = summary.final_chi2;
    EXPECT_NEAR(summary.final_chi2, first, 1e-8 * first);
  }
}

}  // namespace
}  // namespace cairn::test
