// SPDX-License-Identifier: BSD-3-Clause
// A graph is thinned out to a quarter of its poses, and what that cost is measured.
#include <cstdio>
#include <exception>
#include <numeric>
#include <vector>

#include <cairn/io/generator.hpp>
#include <cairn/plugin/registry.hpp>
#include <cairn/solve/optimizer.hpp>
#include <cairn/sparsification/sparsification.hpp>

namespace {

void run() {
  cairn::Registry registry;
  cairn::Graph graph =
      registry.make<cairn::Generator>("manhattan:poses=800")->generate(registry, 1).graph;
  const auto optimizer = registry.make<cairn::Optimizer>("levenberg_marquardt");
  optimizer->optimize(graph);

  // All but the first pose and the newest may leave.
  std::vector<int> may_leave(graph.variable_count() - 2);
  std::iota(may_leave.begin(), may_leave.end(), 1);

  const auto sparsifier = registry.make<cairn::Sparsifier>("sparsify:population=tree:2");
  const auto selection = registry.make<cairn::NodeSelection>("smallest_blanket:part=0.75");
  const std::vector<int> nodes = selection->select(graph, may_leave, *sparsifier);

  const cairn::Sparsification change = sparsifier->remove(graph, nodes);
  cairn::Graph sparse = graph.clone();
  cairn::apply(change, sparse);
  optimizer->optimize(sparse);

  const auto solver = registry.make<cairn::LinearSolver>("block_cholesky");
  const cairn::SparsificationError lost = cairn::sparsification_error(graph, sparse, *solver);
  std::printf("%d poses and %d factors became %d and %d\n", graph.variable_count(),
              graph.factor_count(), sparse.variable_count(), sparse.factor_count());
  std::printf("lost: %.3f nats; the poses moved by %.4f m\n", lost.kld, lost.rmse);
}

}  // namespace

int main() {
  try {
    run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "sparsify: %s\n", error.what());
    return 1;
  }
  return 0;
}
