// SPDX-License-Identifier: BSD-3-Clause
// An update that fails while a factor is evaluated leaves every estimator as it was, to the last
// bit. CAIRN_FAILING_SEQUENCES says how many random sequences each goes through, CAIRN_SEED with
// which seed they begin.
#include <cctype>
#include <cstdlib>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/never_throws.hpp"
#include "failing_updates.hpp"

namespace cairn::test {
namespace {

unsigned from_environment(const char* name, unsigned otherwise) {
  const char* text = std::getenv(name);
  return text ? static_cast<unsigned>(std::strtoul(text, nullptr, 10)) : otherwise;
}

std::vector<std::string> estimators() {
  Registry registry;
  std::vector<std::string> names = registry.names(Estimator::kKind);
  if (registry.has(Estimator::kKind, "incremental_cholesky"))
    names.emplace_back("incremental_cholesky:solve_every=3,full_every=9,accuracy=1e-9");
  if (registry.has(Estimator::kKind, "incremental_qr"))
    names.emplace_back("incremental_qr:every=4");
  if (registry.has(Estimator::kKind, "periodic_batch"))
    names.emplace_back("periodic_batch:every=3");
  return names;
}

class FailingFactor : public testing::TestWithParam<std::string> {
 protected:
  std::unique_ptr<Estimator> make() { return registry_.make<Estimator>(GetParam()); }
  Registry registry_;
  ThrowingTypes types_;
};

TEST_P(FailingFactor, LeavesTheEstimatorAsItWasWhereverItThrows) {
  const unsigned first = from_environment("CAIRN_SEED", 1),
                 count = from_environment("CAIRN_FAILING_SEQUENCES", 8);
  int failures = 0;
  for (unsigned seed = first; seed < first + count; ++seed) {
    const auto estimator = make(), twin = make();
    FailingUpdates updates(*estimator, *twin, types_, seed, seed % 4 == 0 ? 1000 : 6);
    updates.run(seed % 4 == 0 ? 12 : 40);
    ASSERT_FALSE(HasFailure()) << "seed " << seed << ":\n" << updates.log();
    failures += updates.failures();
  }
  EXPECT_GT(failures, 20 * static_cast<int>(count));
  RecordProperty("failures", failures);
}

// One that goes on throwing cannot be asked what it has answered before.
TEST_P(FailingFactor, ThatThrowsFromThenOnLeavesTheEstimatorAsItWas) {
  const auto estimator = make(), twin = make();
  FailingUpdates updates(*estimator, *twin, types_, 5, 1);
  updates.run(30);
  const std::vector<Id> poses = twin->variables();
  ASSERT_GE(poses.size(), 2U);
  const double chi2 = estimator->chi2();
  for (int k = 0; k < 3; ++k) {
    GraphUpdate update;
    update.factors.push_back({types_.prior, {poses.front()}, {0.0, 0.0, 0.0}, {1, 0, 0, 1, 0, 1}});
    types_.fuse->stuck = true;
    EXPECT_THROW(estimator->update(update), Error);
    types_.fuse->stuck = false;
    EXPECT_EQ(estimator->chi2(), chi2);
    EXPECT_EQ(estimator->factors(), twin->factors());
  }
  for (Estimator* each : {estimator.get(), twin.get()}) each->update({}, {.full = true});
  for (const Id id : twin->variables())
    EXPECT_TRUE(std::ranges::equal(estimator->state(id), twin->state(id))) << id;
}

TEST_P(FailingFactor, IsBlamedWithItsIds) {
  const auto estimator = make();
  GraphUpdate update;
  update.variables = {{types_.plain.pose, 3, {0, 0, 0}, true},
                      {types_.plain.pose, 8, {1, 0, 0}, false}};
  update.factors.push_back({types_.relative_pose, {3, 8}, {1.0, 0.0, 0.0}, {1, 0, 0, 1, 0, 1}});
  types_.fuse->stuck = true;
  try {
    estimator->update(update, {.full = true});
    ADD_FAILURE() << "it was taken";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::plugin);
    EXPECT_EQ(std::string(error.what()).find("factor 'EDGE_SE2' failed: burnt"), 0U)
        << error.what();
  }
}

INSTANTIATE_TEST_SUITE_P(Registered, FailingFactor, testing::ValuesIn(estimators()),
                         [](const auto& named) {
                           std::string name = named.param;
                           std::ranges::replace_if(
                               name, [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
                           return name;
                         });
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(FailingFactor);

// Graphs of these alone cost an estimator nothing for the failures of others.
TEST(ShippedTypes, SayThatTheyNeverThrow) {
  Registry registry;
  for (const std::string& name : registry.names("factor")) {
    const auto type = registry.factor_type(name);
    EXPECT_NE(dynamic_cast<const NeverThrows*>(type.get()), nullptr) << name;
  }
  for (const std::string& name : registry.names(Loss::kKind)) {
    const auto loss = registry.make<Loss>(name);
    EXPECT_NE(dynamic_cast<const NeverThrows*>(loss.get()), nullptr) << name;
  }
}

}  // namespace
}  // namespace cairn::test
