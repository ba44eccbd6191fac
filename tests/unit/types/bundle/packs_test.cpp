// SPDX-License-Identifier: BSD-3-Clause
#include "../packs.hpp"

#include <gtest/gtest.h>

#include "bundle/reprojection.hpp"

namespace cairn::test {
namespace {

TEST(Packs, GiveTheSameAsOneFactorAtATimeForImages) { expect_equal_bits<bundle::Reprojection>(); }

}  // namespace
}  // namespace cairn::test
