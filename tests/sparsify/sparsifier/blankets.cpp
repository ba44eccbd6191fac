// SPDX-License-Identifier: BSD-3-Clause
#include "sparsify/sparsifier/blankets.hpp"

#include <algorithm>
#include <array>
#include <numeric>

#include "cairn/graph/packed.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/solve/optimizer.hpp"
#include "local_problem.hpp"
#include "work_graph.hpp"

namespace cairn::sparsify {

Graph simulate(Registry& registry, const std::string& world, std::uint64_t seed) {
  return registry.make<Generator>(world)->generate(registry, seed).graph;
}

Graph solved(Registry& registry, const std::string& world, std::uint64_t seed) {
  Graph graph = simulate(registry, world, seed);
  registry.make<Optimizer>("levenberg_marquardt")->optimize(graph);
  return graph;
}

std::vector<DenseBlanket> blankets(const Graph& graph, int group, int step, int least, int most) {
  const WorkGraph work(graph);
  std::vector<DenseBlanket> result;
  for (int first = 1; first + group < graph.variable_count(); first += step) {
    std::vector<int> nodes(group);
    std::iota(nodes.begin(), nodes.end(), first);
    const LocalProblem local = crop(work, nodes);
    const int size = static_cast<int>(std::ssize(local.blanket));
    if (local.refusal.empty() && size >= least && size <= most)
      result.push_back(marginalize(work, local, LocalMinimum::measured).dense);
  }
  return result;
}

DenseBlanket random_blanket(Registry& registry, int dimension, int nodes, Draw& draw,
                            int more_edges) {
  const auto pose = registry.variable_type(dimension == 2 ? "VERTEX_SE2" : "VERTEX_SE3:QUAT");
  const auto edge = registry.factor_type(dimension == 2 ? "EDGE_SE2" : "EDGE_SE3:QUAT");
  const LieGroup& lie = *pose->lie_group();
  const int t = pose->tangent_size();
  Graph graph;
  for (int v = 0; v <= nodes; ++v) {
    std::vector<double> x(pose->ambient_size());
    Matrix delta = draw.matrix(t, 1);
    delta.topRows(dimension) *= 3.0;
    lie.exp(delta.data(), x.data());
    graph.add_variable(pose, v, x);
  }
  const auto relate = [&](int a, int b) {
    std::vector<double> back(pose->ambient_size()), z(pose->ambient_size());
    lie.inverse(graph.state(a).data(), back.data());
    lie.compose(back.data(), graph.state(b).data(), z.data());
    graph.add_factor(edge, std::array{a, b}, z, pack(20.0 * draw.definite(t)));
  };
  for (int v = 1; v <= nodes; ++v) relate(0, v);
  for (int k = 0; k < more_edges; ++k) {
    const int a = 1 + draw.integer(nodes), b = 1 + draw.integer(nodes);
    if (a != b) relate(a, b);
  }
  const WorkGraph work(graph);
  return marginalize(work, crop(work, {0}), LocalMinimum::measured).dense;
}

void set_information(DenseBlanket& blanket, const std::vector<FactorChoice>& topology,
                     const std::vector<Matrix>& Omega) {
  const int d = blanket.size();
  Matrix L = Matrix::Zero(d, d);
  for (std::size_t k = 0; k < topology.size(); ++k) {
    const auto J = jacobian(blanket.models[topology[k].front()], d);
    L += J.transpose() * Omega[k] * J;
  }
  blanket.information.assign(L.data(), L.data() + L.size());
}

std::vector<FactorChoice> every_model(const DenseBlanket& blanket) {
  std::vector<FactorChoice> all;
  for (int k = 0; k < static_cast<int>(std::ssize(blanket.models)); ++k) all.push_back({k});
  return all;
}

bool connects(const DenseBlanket& blanket, const std::vector<FactorChoice>& topology) {
  std::vector<int> part(blanket.node_sizes.size());
  std::iota(part.begin(), part.end(), 0);
  for (const FactorChoice& choice : topology) {
    for (const int model : choice) {
      for (const int node : blanket.models[model].nodes) {
        const int from = part[node], to = part[blanket.models[model].nodes.front()];
        for (int& p : part) p = p == from ? to : p;
      }
    }
  }
  return std::ranges::all_of(part, [&](int p) { return p == part.front(); });
}

}  // namespace cairn::sparsify
