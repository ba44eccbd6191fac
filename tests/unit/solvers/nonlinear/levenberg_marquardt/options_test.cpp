// SPDX-License-Identifier: BSD-3-Clause
// The struct of a component's options, in place of their text.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/optimizer.hpp"
#include "levenberg_marquardt/levenberg_marquardt.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

TEST(ComponentOptions, AStructDoesWhatItsTextDoes) {
  Registry registry;
  const LevenbergMarquardtOptions options{.linear_solver = "eigen:ordering=natural",
                                          .initial_lambda = 10.0};
  EXPECT_EQ(to_text("levenberg_marquardt", options),
            "levenberg_marquardt:initial_lambda=10,linear_solver=eigen:ordering=natural");
  EXPECT_NE(registry.make<Optimizer>("levenberg_marquardt", options), nullptr);
}

TEST(ComponentOptions, AStructIsCheckedLikeText) {
  Registry registry;
  const auto refusal = [&](const LevenbergMarquardtOptions& options) -> std::string {
    try {
      registry.make<Optimizer>("levenberg_marquardt", options);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal({.initial_lambda = -0.5}),
              HasSubstr("option 'initial_lambda' is '-0.5', expected a number, 0 to 1e+16"));
  EXPECT_THAT(refusal({.linear_solver = "eigen:ordering=netural"}),
              HasSubstr("option 'ordering' cannot be 'netural'; did you mean 'natural'?"));
}

}  // namespace
}  // namespace cairn
