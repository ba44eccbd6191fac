// SPDX-License-Identifier: BSD-3-Clause
#include "block/ordering.hpp"

#include <algorithm>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "block/supernodal_cholesky.hpp"
#include "block/symbolic.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/io/format.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "support/block_systems.hpp"
#include "support/data.hpp"

namespace cairn::block {
namespace {

using testing::HasSubstr;
using testing::UnorderedElementsAreArray;

bool offered(std::string_view name) {
  return std::ranges::find(every_ordering_name(), name) != every_ordering_name().end();
}

std::vector<std::string> with_groups() {
  std::vector<std::string> names;
  for (const std::string& name : every_ordering_name()) {
    if (name != "metis" && (offered("camd") || (name != "amd" && name != "auto")))
      names.push_back(name);
  }
  return names;
}

std::vector<std::int32_t> numbers(int count) {
  std::vector<std::int32_t> result(count);
  std::iota(result.begin(), result.end(), 0);
  return result;
}

BlockStructure grid(int rows, int columns, std::int32_t size) {
  std::vector<std::pair<std::int32_t, std::int32_t>> entries;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      if (c > 0) entries.emplace_back(r * columns + c, r * columns + c - 1);
      if (r > 0) entries.emplace_back(r * columns + c, (r - 1) * columns + c);
    }
  }
  return {std::vector<std::int32_t>(rows * columns, size), std::move(entries)};
}

/// Chains, stars, grids, loose blocks, cliques and random graphs, small and large enough to be cut.
std::vector<BlockStructure> structures() {
  using Entries = std::vector<std::pair<std::int32_t, std::int32_t>>;
  std::vector<BlockStructure> result;
  std::mt19937 rng(9);
  result.emplace_back(std::vector<std::int32_t>{}, Entries{});
  result.emplace_back(std::vector<std::int32_t>{3}, Entries{});
  result.emplace_back(std::vector<std::int32_t>(700, 3), Entries{});  // no edges
  Entries chain, star, clique;
  for (int k = 1; k < 900; ++k) chain.emplace_back(k, k - 1);
  for (int k = 1; k < 600; ++k) star.emplace_back(k, 0);
  for (int i = 0; i < 200; ++i) {
    for (int j = 0; j < i; ++j) clique.emplace_back(i, j);
  }
  result.emplace_back(std::vector<std::int32_t>(900, 6), chain);
  result.emplace_back(std::vector<std::int32_t>(600, 2), star);
  result.emplace_back(std::vector<std::int32_t>(200, 1), clique);
  result.push_back(grid(31, 33, 3));
  result.push_back(test::random_structure(rng, 40, 60, {3, 6}));
  result.push_back(test::random_structure(rng, 800, 900, {2, 3}));
  return result;
}

TEST(Ordering, OrdersEveryBlockOnce) {
  for (const BlockStructure& structure : structures()) {
    for (const std::string& name : every_ordering_name()) {
      EXPECT_THAT(order(structure, name), UnorderedElementsAreArray(numbers(structure.blocks())))
          << name;
    }
  }
}

TEST(Ordering, IsTheSameEveryTime) {
  for (const BlockStructure& structure : structures()) {
    for (const std::string& name : every_ordering_name())
      EXPECT_EQ(order(structure, name), order(structure, name)) << name;
  }
}

TEST(Ordering, KeepsToTheOrderOfGroups) {
  std::mt19937 rng(10);
  for (const BlockStructure& structure : structures()) {
    std::vector<std::int32_t> groups(structure.blocks());
    for (std::int32_t& group : groups) group = 10 * static_cast<std::int32_t>(rng() % 3) - 7;
    for (const std::string& name : with_groups()) {
      SCOPED_TRACE(name);
      const std::vector<std::int32_t> ordering = order(structure, name, groups);
      EXPECT_THAT(ordering, UnorderedElementsAreArray(numbers(structure.blocks())));
      EXPECT_TRUE(std::ranges::is_sorted(ordering, {}, [&](auto block) { return groups[block]; }));
    }
  }
}

TEST(Ordering, PutsTheLastBlocksLast) {
  std::mt19937 rng(11);
  const BlockStructure structure = test::random_structure(rng, 500, 700, {3});
  for (const std::string& name : with_groups()) {
    const std::vector<std::int32_t> ordering = order(structure, name + ",last=20");
    EXPECT_THAT(std::span(ordering).subspan(480), testing::Each(testing::Ge(480))) << name;
    EXPECT_EQ(order(structure, name + ",last=0"), order(structure, name)) << name;
    EXPECT_THAT(order(structure, name + ",last=9999"),
                UnorderedElementsAreArray(numbers(structure.blocks())));
  }
}

TEST(Ordering, KeepsLaterGroupsOffThePathsOfEarlierOnesWhenPostordered) {
  std::mt19937 rng(12);
  const BlockStructure structure = test::random_structure(rng, 400, 300, {3});
  for (const std::string& name : with_groups()) {
    const Symbolic symbolic(structure, order(structure, name + ",last=30"));
    for (std::int32_t j = 0; j < 370; ++j) {
      for (std::int64_t e = structure.column_begin()[j] + 1; e < structure.column_begin()[j + 1];
           ++e) {
        const std::int32_t i = structure.rows()[e];
        if (i < 370) continue;
        EXPECT_LT(symbolic.position()[j], symbolic.position()[i]) << name;
      }
    }
  }
}

/// Σ (column count)² by eliminating one scalar after the other in a dense pattern.
double flops_of_dense_elimination(const BlockStructure& structure,
                                  std::span<const std::int32_t> ordering) {
  const Eigen::Index n = static_cast<Eigen::Index>(structure.size());
  std::vector<Eigen::Index> begin(structure.blocks());
  Eigen::Index next = 0;
  for (const std::int32_t block : ordering) {
    begin[block] = next;
    next += structure.block_size(block);
  }
  Eigen::MatrixXi pattern = Eigen::MatrixXi::Zero(n, n);
  for (std::int32_t j = 0; j < structure.blocks(); ++j) {
    for (std::int64_t e = structure.column_begin()[j]; e < structure.column_begin()[j + 1]; ++e) {
      const std::int32_t i = structure.rows()[e];
      const Eigen::Index rows = structure.block_size(i), columns = structure.block_size(j);
      pattern.block(begin[i], begin[j], rows, columns).setOnes();
      pattern.block(begin[j], begin[i], columns, rows).setOnes();
    }
  }
  double flops = 0.0;
  for (Eigen::Index k = 0; k < n; ++k) {
    const double count = pattern.col(k).tail(n - k).sum();
    flops += count * count;
    for (Eigen::Index j = k + 1; j < n; ++j) {
      if (pattern(j, k))
        pattern.col(j).tail(n - k) =
            pattern.col(j).tail(n - k).cwiseMax(pattern.col(k).tail(n - k));
    }
  }
  return flops;
}

TEST(Ordering, CountsFlopsAsDenseEliminationDoes) {
  int compared = 0;
  for (const BlockStructure& structure : structures()) {
    if (structure.size() > 400) continue;
    for (const std::string& name : every_ordering_name()) {
      const std::vector<std::int32_t> ordering = order(structure, name);
      EXPECT_EQ(factor_flops(structure, ordering), flops_of_dense_elimination(structure, ordering))
          << name;
      ++compared;
    }
  }
  EXPECT_GT(compared, 0);
}

TEST(Ordering, SolvesWithEveryNameAndGroups) {
  std::mt19937 rng(13);
  const BlockStructure structure = test::random_structure(rng, 300, 250, {3, 6});
  BlockMatrix H(structure);
  test::fill_positive_definite(rng, H);
  std::vector<double> g(structure.size(), 1.0), x(structure.size()), back(structure.size());
  std::vector<std::string> names = every_ordering_name();
  for (const std::string& name : with_groups()) names.push_back(name + ",last=12");
  for (const std::string& name : names) {
    SupernodalCholesky cholesky;
    cholesky.analyze(structure, name);
    ASSERT_TRUE(cholesky.factorize(H).ok);
    cholesky.solve(g, x);
    H.multiply(x, back);
    for (std::size_t k = 0; k < g.size(); ++k) ASSERT_NEAR(back[k], g[k], 1e-10) << name;
  }
}

TEST(Ordering, DissectsAGridWithLessFillThanMinimumDegree) {
  if (!offered("nesdis")) GTEST_SKIP() << "built without METIS or CAMD";
  const BlockStructure structure = grid(60, 60, 6);
  const double amd = factor_flops(structure, order(structure, "amd"));
  EXPECT_LT(factor_flops(structure, order(structure, "nesdis")), 0.95 * amd);
  ASSERT_TRUE(worth_dissecting(structure, amd));
  EXPECT_EQ(order(structure, "auto"), order(structure, "nesdis"));
}

TEST(Ordering, DoesNotDissectWhatIsCheap) {
  const BlockStructure chain = structures()[3];
  EXPECT_FALSE(worth_dissecting(chain, factor_flops(chain, order(chain, "amd"))));
  EXPECT_EQ(order(chain, "auto"), order(chain, "amd"));
}

TEST(Ordering, SaysWhatWouldWork) {
  const BlockStructure structure = grid(3, 3, 3);
  const auto message = [&](const std::string& name) {
    try {
      order(structure, name);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::usage);
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_THAT(message("amdd"), HasSubstr("no ordering 'amdd'"));
  EXPECT_THAT(message("natural,last=x"), HasSubstr("wants a number"));
  EXPECT_THAT(message("natural,last=-1"), HasSubstr("wants a number"));
  if (!offered("metis")) return;
  EXPECT_THAT(message("metis,last=2"), HasSubstr("camd"));
}

/// Flops of published graphs in the ordering that auto chooses, against the better of the minimum
/// degree and the nested dissection of CHOLMOD.
TEST(Ordering, FindsTheFlopsThatAreKnownForPublishedGraphs) {
  CAIRN_NEEDS_DATA();
  if (!offered("nesdis")) GTEST_SKIP() << "built without METIS or CAMD";
  struct Known {
    const char* file;
    double flops;
  };
  Registry registry;
  for (const Known& known :
       {Known{"pose3d/sphere_bignoise_vertex3.g2o", 562e6}, Known{"pose3d/torus3D.g2o.gz", 1.00e9},
        Known{"pose3d/sphere2500.g2o", 384e6}, Known{"pose2d/manhattanOlson3500.g2o", 6.6e6}}) {
    const Graph graph = read_graph(test::data_folder() / known.file, registry);
    const Linearizer linearizer(graph, resolve_gauge(graph).held);
    const BlockStructure& structure = linearizer.structure();
    EXPECT_LE(factor_flops(structure, order(structure, "auto")), known.flops) << known.file;
  }
}

}  // namespace
}  // namespace cairn::block
