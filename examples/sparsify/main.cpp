// SPDX-License-Identifier: BSD-3-Clause
// A graph is thinned out to a quarter of its poses, and what that cost is measured.
#include <iostream>
#include <numeric>

#include <cairn/cairn.hpp>
#include <cairn/sparsification/sparsification.hpp>

using namespace cairn;

int main() {
  Graph graph = make<Generator>("manhattan:poses=800")->generate(default_registry(), 1).graph;
  optimize(graph);
  std::vector<int> may_leave(graph.variable_count() - 2);  // all but the first and the newest
  std::iota(may_leave.begin(), may_leave.end(), 1);
  const auto sparsifier = make<Sparsifier>("sparsify:population=tree:2");
  const auto selection = make<NodeSelection>("smallest_blanket:part=0.75");
  Graph sparse = graph.clone();
  apply(sparsifier->remove(graph, selection->select(graph, may_leave, *sparsifier)), sparse);
  optimize(sparse);
  const auto solver = make<LinearSolver>("block_cholesky");
  const SparsificationError lost = sparsification_error(graph, sparse, *solver);
  std::cout << graph.variable_count() << " poses became " << sparse.variable_count() << " and "
            << sparse.factor_count() << " factors\nlost: " << lost.kld
            << " nats; the poses moved by " << lost.rmse << " m\n";
}
