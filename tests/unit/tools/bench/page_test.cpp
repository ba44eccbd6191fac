// SPDX-License-Identifier: BSD-3-Clause
#include "page.hpp"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

namespace cairn::performance {
namespace {

const std::string kPage =
    "before\n<!-- table:one -->\nold\n<!-- /table -->\nbetween\n<!-- table:two -->\n<!-- /table "
    "-->\nafter\n";

TEST(Page, ReplacesWhatStandsBetweenTheMarkersAndNothingElse) {
  std::string page = kPage;
  put({"one", "new\n"}, page);
  EXPECT_EQ(page,
            "before\n<!-- table:one -->\nnew\n<!-- /table -->\nbetween\n<!-- table:two -->\n<!-- "
            "/table -->\nafter\n");
}

TEST(Page, MayBeWrittenAgainWithTheSameResult) {
  std::string once = kPage;
  put({"two", "| a |\n"}, once);
  std::string twice = once;
  put({"two", "| a |\n"}, twice);
  EXPECT_EQ(twice, once);
}

TEST(Page, KnowsWhichTablesItHasAPlaceFor) {
  EXPECT_TRUE(has_place({"two", ""}, kPage));
  EXPECT_FALSE(has_place({"tw", ""}, kPage));
}

TEST(Page, SaysWhichTableItHasNoPlaceFor) {
  std::string page = kPage;
  try {
    put({"three", "x"}, page);
    FAIL() << "no error";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("three"), std::string::npos);
  }
  EXPECT_EQ(page, kPage);
}

}  // namespace
}  // namespace cairn::performance
