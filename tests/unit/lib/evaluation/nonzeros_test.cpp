// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/nonzeros.hpp"

#include <gtest/gtest.h>

#include "cairn/plugin/registry.hpp"
#include "support/dense_system.hpp"
#include "support/planar_graph.hpp"

namespace cairn {
namespace {

/// Where blocks of 3 and 2 rows meet, against the dense matrix, in which no number is zero by
/// chance but those of the landmarks' own blocks may be: these count as whole blocks.
TEST(Nonzeros, AreThoseOfTheBlocksOfH) {
  Registry registry;
  const auto solver = registry.make<LinearSolver>("block_cholesky");
  const test::PlanarTypes types;
  const Graph graph = test::random_graph(types, 12, 5, 3);
  const test::DenseSystem dense = test::dense_system(graph);
  std::int64_t expected = 0;
  for (const auto& [a, of_a] : dense.rows) {
    for (const auto& [b, of_b] : dense.rows) {
      const bool related = !dense.H.block(of_a.first, of_b.first, of_a.size, of_b.size).isZero(0.0);
      if (related) expected += of_a.size * of_b.size;
    }
  }
  const Nonzeros nonzeros = count_nonzeros(graph, *solver);
  EXPECT_EQ(nonzeros.information, expected);
  const auto n = static_cast<std::int64_t>(dense.H.rows());
  EXPECT_GE(nonzeros.factor, (nonzeros.information + n) / 2);
  EXPECT_LE(nonzeros.factor, n * (n + 1) / 2);
}

}  // namespace
}  // namespace cairn
