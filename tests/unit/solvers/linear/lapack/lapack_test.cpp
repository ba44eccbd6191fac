// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::test {
namespace {

TEST(Lapack, RefusesWhatIsTooLargeForADenseMatrixAndNamesOthers) {
  Registry registry;
  if (!registry.has("linear_solver", "lapack")) GTEST_SKIP();
  const BlockStructure structure(std::vector<std::int32_t>(5, 6), {});
  registry.make<LinearSolver>("lapack:max_size=30")->analyze(structure);
  const auto solver = registry.make<LinearSolver>("lapack:max_size=29");
  try {
    solver->analyze(structure);
    FAIL() << "30 unknowns were taken";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::usage);
    EXPECT_THAT(error.what(), testing::HasSubstr("30 unknowns are beyond its max_size of 29"));
    EXPECT_THAT(error.what(), testing::HasSubstr("use block_cholesky"));
  }
}

}  // namespace
}  // namespace cairn::test
