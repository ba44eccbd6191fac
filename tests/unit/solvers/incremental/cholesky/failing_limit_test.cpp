// SPDX-License-Identifier: BSD-3-Clause
// Updates with a limit of work that fail while a factor is evaluated: nothing is seen of them, by a
// solution that goes on either.
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "../failing_updates.hpp"
#include "counting_clock.hpp"
#include "incremental_cholesky.hpp"

namespace cairn::incremental {
namespace {

/// Evaluates every factor, moves what is there by a little, and says that it has not converged.
class StepsOnce final : public Optimizer {
 public:
  using Optimizer::optimize;
  Summary optimize(Graph& graph, const Stop& stop, Observer& observer) override {
    (void)stop, (void)observer;
    Values values = graph.values();
    for (AlignedVector& pool : values.pools) {
      for (double& number : pool) number += 1e-3 * number;
    }
    graph.set_values(std::move(values));
    chi2(graph);
    return {};
  }
};

class FailingWithALimit : public testing::TestWithParam<double> {
 protected:
  std::unique_ptr<IncrementalCholesky> make(CountingClock& clock) {
    IncrementalCholeskyOptions options;
    options.budget = GetParam();
    auto rescuer = std::make_shared<Rescuer>();
    rescuer->optimizer = std::make_unique<StepsOnce>();
    auto estimator = std::make_unique<IncrementalCholesky>(options, std::move(rescuer));
    clock.drive(*estimator);
    return estimator;
  }
};

TEST_P(FailingWithALimit, LeavesTheEstimatorAsItWasWhereverItThrows) {
  const test::ThrowingTypes types;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    CountingClock clock, of_twin;
    const auto estimator = make(clock), twin = make(of_twin);
    test::FailingUpdates updates(*estimator, *twin, types, seed, seed % 4 == 0 ? 1000 : 6);
    updates.run(40);
    ASSERT_FALSE(HasFailure()) << "seed " << seed << ":\n" << updates.log();
    EXPECT_GT(updates.failures(), 20);
  }
}

/// Pieces of work in an update.
INSTANTIATE_TEST_SUITE_P(Pieces, FailingWithALimit, testing::Values(0.5, 4.5, 20.5));

}  // namespace
}  // namespace cairn::incremental
