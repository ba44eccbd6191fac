// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/registration.hpp"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

using testing::ElementsAreArray;

TEST(FunctionRegistrationTest, AnswersWithItsFunction) {
  FunctionRegistration registration([](Id earlier, Id later) {
    Factor factor;
    factor.variables = {earlier, later};
    return std::vector<Factor>{factor};
  });
  registration.begin({});
  EXPECT_THAT(registration.match(3, 8).front().variables, ElementsAreArray({3, 8}));
  EXPECT_EQ(query<FalseMatches>(registration), nullptr);
}

}  // namespace
}  // namespace cairn
