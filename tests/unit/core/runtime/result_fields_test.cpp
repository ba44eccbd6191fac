// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/result_fields.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "support/result_sample.hpp"

namespace cairn::test {
namespace {

using ::testing::ElementsAre;

std::vector<std::string> names(const std::vector<ResultField>& fields) {
  std::vector<std::string> all;
  for (const ResultField& field : fields) all.push_back(field.name);
  return all;
}

TEST(ResultFields, StandInTheOrderInWhichTheyAreAdded) {
  EXPECT_THAT(
      names(result_fields<Sample>().all()),
      ElementsAre("loops.kept", "loops.in", "error", "name", "good", "margin", "check.total",
                  "check.solve", "seconds.total", "seconds.solve", "runs", "verdicts"));
}

TEST(ResultFields, KnowWhatTheyAre) {
  const ResultFields<Sample>& fields = result_fields<Sample>();
  const ResultField& error = fields.all()[2];
  EXPECT_EQ(error.unit, "m");
  EXPECT_EQ(error.help, "root mean square, after alignment");
  EXPECT_EQ(error.type, ResultType::real);
  EXPECT_FALSE(error.may_be_missing);
  EXPECT_TRUE(fields.all()[5].may_be_missing);  // an optional
  EXPECT_TRUE(fields.all()[6].may_be_missing);  // of a part that is one
  EXPECT_EQ(fields.all()[10].type, ResultType::list);
  EXPECT_EQ(fields.all()[11].type, ResultType::names);
}

TEST(ResultFields, ReadMembersAndWhatFunctionsReturn) {
  Sample sample;
  sample.loops = 4;
  const ResultRecord record = result_record(sample);
  EXPECT_EQ(std::get<std::int64_t>(record.values[record.find("loops.kept")].data), 4);
  EXPECT_EQ(std::get<std::int64_t>(record.values[record.find("loops.in")].data), 8);
  EXPECT_EQ(std::get<double>(record.values[record.find("seconds.solve")].data), 0.25);
  EXPECT_EQ(std::get<ResultList>(record.values[record.find("runs")].data).size(), 2u);
}

TEST(ResultFields, OfAMissingPartAreMissing) {
  Sample sample;
  const auto is_missing = [&](const char* name) {
    const ResultRecord record = result_record(sample);
    return record.values[record.find(name)].is_missing();
  };
  EXPECT_TRUE(is_missing("check.total"));
  EXPECT_TRUE(is_missing("margin"));
  sample.check.emplace();
  EXPECT_FALSE(is_missing("check.total"));
}

TEST(ResultFields, StandWhereTheyArePut) {
  const auto fields = ResultFields<GrownSample>()
                          .part([](const GrownSample& s) -> const Sample& { return s; })
                          .without("loops")
                          .without("check")
                          .without("runs")
                          .figure("spread", &GrownSample::spread, "m", "of the positions")
                          .before("error")
                          .label("scatter");
  EXPECT_THAT(names(fields.all()), ElementsAre("spread", "error", "name", "good", "margin",
                                               "seconds.total", "seconds.solve", "verdicts"));
  EXPECT_EQ(fields.all().front().label, "scatter");
  const ResultRecord record = fields.values(GrownSample());
  EXPECT_EQ(std::get<double>(record.values[record.find("spread")].data), 0.125);
  EXPECT_EQ(std::get<double>(record.values[record.find("seconds.total")].data), 1.5);
}

TEST(ResultFields, RefuseTwoOfOneName) {
  EXPECT_THROW(ResultFields<Sample>()
                   .figure("error", &Sample::error, "m", "once")
                   .figure("error", &Sample::loops, "twice"),
               std::logic_error);
  EXPECT_THROW(ResultFields<Sample>().at("none"), std::logic_error);
}

}  // namespace
}  // namespace cairn::test
