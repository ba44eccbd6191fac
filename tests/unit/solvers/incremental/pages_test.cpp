// SPDX-License-Identifier: BSD-3-Clause
// What memory updates with a limit of time are carried out in.
#include <gtest/gtest.h>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/aligned.hpp"
#include "cairn/solve/estimator.hpp"
#include "support/advised_pages.hpp"
#include "support/components.hpp"
#include "support/planar_graph.hpp"

namespace cairn::test {
namespace {

/// Poses in rows of 40, joined with those of the row before as well.
GraphUpdate rows_of_poses(const PlanarTypes& types, int rows) {
  constexpr int kRow = 40;
  const std::vector<double> information = {100, 0, 0, 100, 0, 400};
  GraphUpdate update;
  for (int k = 0; k < rows * kRow; ++k) {
    const int row = k / kRow;
    const double x = k - row * kRow, y = row;
    update.variables.push_back({types.pose, k, {x, y, 0.0}});
    if (k % kRow > 0)
      update.factors.push_back({types.relative_pose, {k - 1, k}, {1.0, 0.1, 0.0}, information});
    if (k >= kRow)
      update.factors.push_back({types.relative_pose, {k - kRow, k}, {0.0, 1.0, 0.0}, information});
  }
  return update;
}

/// Bytes in huge pages that are there after an update and were not before.
std::size_t huge_bytes_of(Estimator& estimator, const GraphUpdate& update, double max_seconds) {
  const std::size_t before = bytes_advised_to_be_huge();
  EXPECT_TRUE(estimator.update(update, {.max_seconds = max_seconds}).ok);
  const std::size_t after = bytes_advised_to_be_huge();
  return after > before ? after - before : 0;
}

/// The first touch of one may take longer than the update may.
TEST(UpdateWithALimit, AsksForNoHugePages) {
#if defined(CAIRN_SANITIZED)
  GTEST_SKIP() << "sanitizers watch over memory of their own";
#endif
  CAIRN_NEEDS("estimator", "incremental_cholesky");
  const AlignedVector several(std::size_t{1} << 20, 1.0);
  if (!advised_to_be_huge(several.data()).value_or(false))
    GTEST_SKIP() << "this system does not say which pages are to be huge";
  constexpr double kLong = 1e6;  // [s]: nothing is left to later updates
  const PlanarTypes types;
  const GraphUpdate update = rows_of_poses(types, 40);
  Registry registry;
  const auto of_update = registry.make<Estimator>("incremental_cholesky");
  EXPECT_EQ(huge_bytes_of(*of_update, update, kLong), 0u);
  const auto of_estimator = registry.make<Estimator>("incremental_cholesky:budget=1e6");
  EXPECT_EQ(huge_bytes_of(*of_estimator, update, 0.0), 0u);
  const auto none = registry.make<Estimator>("incremental_cholesky");
  EXPECT_GT(huge_bytes_of(*none, update, 0.0), std::size_t{1} << 20);
  // What has no limit may take them.
  const auto full = registry.make<Estimator>("incremental_cholesky:budget=1e6");
  const std::size_t before = bytes_advised_to_be_huge();
  EXPECT_TRUE(full->update(update, {.full = true}).ok);
  EXPECT_GT(bytes_advised_to_be_huge(), before);
}

}  // namespace
}  // namespace cairn::test
