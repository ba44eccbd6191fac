// SPDX-License-Identifier: BSD-3-Clause
// What is written of a result, all of it from its fields. Of Python: tests/python/test_results.py.
#include "cairn/program/figures.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include <boost/json/serialize.hpp>

#include "support/result_sample.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string json_of(const auto& result) { return boost::json::serialize(app::to_json(result)); }

std::string rows_of(const auto& result) {
  app::Table table({{"", app::Table::Align::left}, {"", app::Table::Align::left}});
  app::Figures(result).add_rows(table);
  return table.text(false);
}

TEST(Figures, AreInAllThatIsWrittenOnceTheyAreAdded) {
  const GrownSample grown;
  const app::Figures figures(grown);
  EXPECT_THAT(json_of(grown), HasSubstr("\"spread\":1.25E-1"));
  EXPECT_THAT(rows_of(grown), HasSubstr("spread      0.125 m\n"));
  EXPECT_THAT(figures.csv(), HasSubstr(",spread\n"));
  EXPECT_THAT(figures.csv(), HasSubstr(",0.125\n"));
  EXPECT_THAT(figures.table().latex(), HasSubstr("spread & 0.125 m \\\\\n"));
  EXPECT_THAT(json_of(Sample()) + rows_of(Sample()) + app::Figures(Sample()).csv(),
              Not(HasSubstr("spread")));
}

TEST(Figures, AreMembersOfReportsByTheirNames) {
  Sample sample;
  EXPECT_EQ(json_of(sample),
            "{\"loops\":{\"kept\":7,\"in\":14},\"error\":3.333333333333333E-1,"
            "\"name\":\"city, \\\"large\\\"\",\"good\":true,\"check\":null,"
            "\"seconds\":{\"total\":1.5E0,\"solve\":2.5E-1},"
            "\"runs\":[{\"total\":1.5E0,\"solve\":2.5E-1},{\"total\":1.5E0,\"solve\":2.5E-1}],"
            "\"verdicts\":{\"linked\":3}}");
  sample.check.emplace();
  sample.error = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(json_of(sample), HasSubstr("\"error\":null"));
  EXPECT_THAT(json_of(sample), HasSubstr("\"check\":{\"total\":1.5E0,\"solve\":2.5E-1}"));
}

TEST(Figures, AreRoundedAsTheirFieldsSay) {
  const app::Figures figures{Sample()};
  EXPECT_EQ(figures["error"], "0.333 m");
  EXPECT_EQ(figures.number("error"), "0.333");
  EXPECT_EQ(app::Figures(Sample(), 5)["error"], "0.33333 m");
  EXPECT_EQ(figures["margin"], "-");
  EXPECT_EQ(figures["seconds.solve"], "250 ms");
  EXPECT_EQ(figures.times("seconds"), "1.5 s (solve 250 ms)");
  EXPECT_EQ(rows_of(Sample()),
            "loops kept  7\nloops in    14\nATE         0.333 m\ngood        yes\n");
}

TEST(Figures, AreColumnsOfCsv) {
  Sample sample;
  EXPECT_EQ(app::Figures(sample).csv(),
            "loops_kept,loops_in,error,name,good,margin,check_total,check_solve,seconds_total,"
            "seconds_solve\n"
            "7,14,0.333333333,\"city, \"\"large\"\"\",1,,,,1.500000000,0.250000000\n");
  EXPECT_EQ(app::csv_of<SampleSeconds>(sample.runs),
            "total,solve\n1.500000000,0.250000000\n1.500000000,0.250000000\n");
}

}  // namespace
}  // namespace cairn::test
