// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/run_report.hpp"

#include <string>
#include <variant>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

std::string refusal(const std::string& text) {
  try {
    read_report(text, "r.json");
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input);
    return error.what();
  }
  return {};
}

TEST(ReadReport, ARunNamesItsGraphItsOutputAndItsCovariances) {
  const auto report = read_report(
      R"({"command": "optimize", "graph": {"file": "a.g2o"}, "output": "b.g2o",
          "optimizer": "dogleg", "chi2": {"initial": 9, "final": 2}, "iterations": [],
          "covariance": {"blocks": [{"id": 7, "covariance": [[1, 2], [2, 5]]}]}})",
      "r.json");
  const RunReport& run = std::get<RunReport>(report);
  EXPECT_EQ(run.graph, "a.g2o");
  EXPECT_EQ(run.output, "b.g2o");
  EXPECT_EQ(run.run.summary.optimizer, "dogleg");
  EXPECT_EQ(run.run.summary.final_chi2, 2.0);
  EXPECT_TRUE(run.has_covariances);
  ASSERT_THAT(run.covariances, SizeIs(1));
  EXPECT_EQ(run.covariances[0].id, 7);
  EXPECT_THAT(run.covariances[0].covariance, ElementsAre(1, 2, 2, 5));
}

TEST(ReadReport, WhatIsNotThereIsEmpty) {
  const auto report =
      read_report(R"({"chi2": {}, "iterations": [], "output": null, "covariance": null})", "r");
  const RunReport& run = std::get<RunReport>(report);
  EXPECT_THAT(run.graph, IsEmpty());
  EXPECT_THAT(run.output, IsEmpty());
  EXPECT_FALSE(run.has_covariances);
}

TEST(ReadReport, AComparisonKeepsItsTextAndNamesItsGraphs) {
  const std::string text =
      R"({"command": "bench", "graphs": [{"graph": {"file": "a"}}, {"graph": {"file": "b"}}, 3]})";
  const auto report = read_report(text, "r.json");
  EXPECT_EQ(std::get<BenchReport>(report).text, text);
  EXPECT_THAT(std::get<BenchReport>(report).graphs, ElementsAre("a", "b"));
}

TEST(ReadReport, RefusesWhatIsNoReport) {
  EXPECT_THAT(refusal("{\"command\": "), HasSubstr("r.json: begins like JSON but is not"));
  EXPECT_THAT(refusal("{}"), HasSubstr("is not a report of cairn optimize"));
  EXPECT_THAT(refusal(R"({"chi2": {}, "iterations": [], "covariance": {"blocks": [{"id": "x"}]}})"),
              HasSubstr("member 'covariance' is not as cairn optimize writes it"));
  for (const char* blocks : {"[{\"id\": 1}]", "1", "[1]", "[{\"id\": 1, \"covariance\": 2}]"}) {
    EXPECT_THAT(refusal(R"({"chi2": {}, "iterations": [], "covariance": {"blocks": )" +
                        std::string(blocks) + "}}"),
                HasSubstr("member 'covariance' is not as cairn optimize writes it"));
  }
}

}  // namespace
}  // namespace cairn
