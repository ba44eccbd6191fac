// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/number_table.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsNan;

std::string refusal(const std::string& text) {
  try {
    read_number_table(text, "a.csv");
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input);
    return error.what();
  }
  return "";
}

TEST(NumberTableOfCsv, HasTheColumnsByName) {
  const NumberTable table = read_number_table("step,chi2\n1,0.5\n2,-3e-4\n", "a.csv");
  EXPECT_EQ(table.name, "a.csv");
  ASSERT_EQ(table.columns.size(), 2U);
  EXPECT_THAT(table.find("step")->values, ElementsAre(1.0, 2.0));
  EXPECT_THAT(table.find("chi2")->values, ElementsAre(0.5, -3e-4));
  EXPECT_EQ(table.find("chi"), nullptr);
}

TEST(NumberTableOfCsv, TakesQuotesLineEndsAndMarksOfSpreadsheets) {
  const NumberTable table =
      read_number_table("\xEF\xBB\xBF\"fd:a=1,b=2\",back\\slash\r\n\r\n 1 ,2\r\n3,4", "a.csv");
  ASSERT_EQ(table.columns.size(), 2U);
  EXPECT_EQ(table.columns[0].name, "fd:a=1,b=2");
  EXPECT_EQ(table.columns[1].name, "back\\slash");
  EXPECT_THAT(table.columns[0].values, ElementsAre(1.0, 3.0));
  EXPECT_THAT(table.columns[1].values, ElementsAre(2.0, 4.0));
}

TEST(NumberTableOfCsv, WhatIsNoNumberIsNaN) {
  const NumberTable table = read_number_table("a,b\n,x\n1e,\"two, words\"\n7,8\n", "a.csv");
  EXPECT_THAT(table.columns[0].values, ElementsAre(IsNan(), IsNan(), 7.0));
  EXPECT_THAT(table.columns[1].values, ElementsAre(IsNan(), IsNan(), 8.0));
}

TEST(NumberTableOfCsv, RefusesWhatIsNoTableWithItsLine) {
  EXPECT_THAT(refusal("a,b\n1,2\n\n1,2,3\n"), HasSubstr("a.csv:4: expected 2 fields"));
  EXPECT_THAT(refusal("a,b\n1,\"2\n"), HasSubstr("a.csv:2: a quote is not closed"));
  EXPECT_THAT(refusal(std::string("a,b\n1,\0\n", 8)), HasSubstr("a.csv:2: expected text"));
  EXPECT_THAT(refusal("a,b\n"), HasSubstr("expected CSV"));
  EXPECT_THAT(refusal(""), HasSubstr("expected CSV"));
}

TEST(NumberTableOfCsv, IsReadAsItWasWritten) {
  NumberTable table{"a.csv", {{"x, y", {0.1, 1e-300, -1.0 / 3.0}}, {"z", {1.0, 2.0, 3e17}}}};
  EXPECT_EQ(read_number_table(csv_text(table), "a.csv"), table);
  table.columns[1].values[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(read_number_table(csv_text(table), "a.csv").columns[1].values,
              ElementsAre(1.0, IsNan(), 3e17));
}

}  // namespace
}  // namespace cairn
