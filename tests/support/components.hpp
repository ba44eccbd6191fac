// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/plugin/registry.hpp"

namespace cairn::test {

/// Every name of a kind that is registered, and each name again with each choice of each of its
/// options: "cholmod", "cholmod:mode=simplicial", … A linear solver that leaves work to another
/// comes with each: "schur:linear_solver=eigen". Suites run over these, so that a plugin of a third
/// party inherits them. Choices that the plugin refuses in this build, and components that take by
/// default what the build lacks, are left out.
std::vector<std::string> every_component(std::string_view kind);

/// The spec of an optimizer, with another linear solver in place of the default where that is not
/// there. Empty if there is none at all.
std::string with_some_linear_solver(const std::string& optimizer);

/// A component's spec as the name of a test.
std::string test_name(const testing::TestParamInfo<std::string>& info);

}  // namespace cairn::test

/// Skips the test, visibly, in a build that lacks a plugin: CAIRN_NEEDS("types", "slam2d").
#define CAIRN_NEEDS(kind, name)                                        \
  if (!::cairn::Registry().has(kind, name)) {                          \
    GTEST_SKIP() << "there is no " << (kind) << " '" << (name) << "'"; \
  }                                                                    \
  static_assert(true)
