// SPDX-License-Identifier: BSD-3-Clause
#include "problems.hpp"

#include <algorithm>
#include <array>
#include <string_view>

#include "cairn/graph/packed.hpp"
#include "cairn/io/generator.hpp"

namespace cairn::scales {
namespace {

constexpr int kPriorEvery = 10;

/// The prior of a type of poses, and its information by row [1/m², 1/rad²]. Empty for cameras,
/// which have none.
std::string_view prior_on(std::string_view variable) {
  if (variable == "VERTEX_SE2") return "EDGE_PRIOR_SE2";
  if (variable == "VERTEX_SE3:QUAT") return "EDGE_PRIOR_SE3:QUAT";
  return {};
}

void add_prior(Graph& graph, int variable, std::span<const double> z, Registry& registry) {
  const std::string_view tag = prior_on(graph.type(variable).tag());
  if (tag.empty()) return;
  const auto type = registry.factor_type(tag);
  const int n = type->residual_size();
  const std::vector<double> information =
      pack(Eigen::MatrixXd((Eigen::VectorXd::Constant(n, 25.0).asDiagonal())));
  const std::array on{variable};
  graph.add_factor(type, on, z, information);
}

/// Priors are at the true poses: as good as anything, and those of several poses fit together.
void hold(Simulation& simulation, Hold how, Registry& registry) {
  Graph& graph = simulation.graph;
  int poses = 0;
  const std::string_view first = graph.type(0).tag();
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (graph.type(v).tag() != first) continue;
    const int number = poses++;
    const bool camera = prior_on(first).empty();
    if (how == Hold::first && number < (camera ? 2 : 1)) {
      graph.set_state(v, simulation.truth.state(v));
      graph.set_fixed(v);
    }
    if ((how == Hold::prior && number == 0) || (how == Hold::priors && number % kPriorEvery == 0))
      add_prior(graph, v, simulation.truth.state(v), registry);
  }
}

}  // namespace

std::vector<Problem> all_problems() {
  const std::string bearings = "landmarks2d:poses=50,sensor=bearing_range";
  return {
      {"manhattan-60", "manhattan:poses=60"},
      {"manhattan-100-fixed", "manhattan:poses=100", 2, Hold::first},
      {"manhattan-80-prior", "manhattan:poses=80", 3, Hold::prior},
      {"manhattan-120-priors", "manhattan:poses=120", 4, Hold::priors},
      {"manhattan-60-cauchy", "manhattan:poses=60,outliers=3", 5, Hold::nothing, "cauchy", 1.0},
      {"manhattan-60-huber", "manhattan:poses=60", 16, Hold::priors, "huber", 1.345},
      {"manhattan-80-noisy", "manhattan:poses=80,noise=3", 7},
      {"manhattan-80-exact", "manhattan:poses=80,noise=0.001", 8},
      {"city-80", "city:poses=80", 1},
      {"city-120-priors", "city:poses=120", 2, Hold::priors},
      {"city-60-huber", "city:poses=60", 3, Hold::first, "huber", 1.345},
      {"ring-30", "ring:poses=30", 1},
      {"ring-60-prior", "ring:poses=60,laps=2", 2, Hold::prior},
      {"ring-90-fixed", "ring:poses=90,laps=3", 3, Hold::first},
      {"landmarks-40", "landmarks2d:poses=40", 1},
      {"landmarks-80-priors", "landmarks2d:poses=80", 2, Hold::priors},
      {"bearings-50", bearings, 3},
      {"bearings-50-prior", bearings, 4, Hold::prior},
      {"sphere-40", "sphere:turns=4,poses_per_turn=10", 1},
      {"sphere-72-fixed", "sphere:turns=6,poses_per_turn=12", 2, Hold::first},
      {"sphere-100-priors", "sphere:turns=10,poses_per_turn=10", 3, Hold::priors},
      {"sphere-40-cauchy", "sphere:turns=4,poses_per_turn=10", 4, Hold::prior, "cauchy", 2.0},
      {"torus-40", "torus:turns=4,poses_per_turn=10", 1},
      {"torus-80-prior", "torus:turns=8,poses_per_turn=10", 2, Hold::prior},
      {"grid-36", "grid3d:nx=4,ny=3,nz=3", 1},
      {"grid-64-priors", "grid3d:nx=4,ny=4,nz=4", 2, Hold::priors},
      {"ellipse-40", "ellipse3d:poses=40", 1},
      {"ellipse-60-fixed", "ellipse_n:laps=3,poses_per_lap=20", 2, Hold::first},
      {"bundle-16", "bundle:cameras=16,points=60,noise=0.05", 1, Hold::first},
      {"bundle-12-street", "bundle:cameras=12,points=60,layout=street,noise=0.05", 2, Hold::first},
      {"bundle-16-free", "bundle:cameras=16,points=60,noise=0.05", 5},
      {"bundle-20-huber", "bundle:cameras=20,points=50,noise=0.05", 4, Hold::first, "huber", 2.0},
  };
}

std::vector<Problem> few_problems() {
  std::vector<Problem> few;
  for (Problem& problem : all_problems()) {
    static constexpr std::array<std::string_view, 5> kFew{"ring-30", "landmarks-40", "sphere-40",
                                                          "sphere-40-cauchy", "bundle-16"};
    if (std::ranges::find(kFew, problem.name) != kFew.end()) few.push_back(std::move(problem));
  }
  return few;
}

Graph make_graph(const Problem& problem, Registry& registry) {
  Simulation simulation =
      registry.make<Generator>(problem.generator)->generate(registry, problem.seed);
  hold(simulation, problem.hold, registry);
  return std::move(simulation.graph);
}

}  // namespace cairn::scales
