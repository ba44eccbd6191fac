// SPDX-License-Identifier: BSD-3-Clause
// Initial guesses that take long: they report how far they are, and can be ended at any report.
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/evaluation/watched_guess.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/initial_guess.hpp"

namespace cairn {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

struct Report {
  std::string what;
  double part;
};

class WatchedGuesses : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    for (const auto& [kind, name] : {std::pair("generator", "landmarks2d"),
                                     {"linear_solver", "block_cholesky"},
                                     {"optimizer", "levenberg_marquardt"},
                                     {"types", "slam2d"}}) {
      if (!registry_.has(kind, name)) GTEST_SKIP() << "there is no " << kind << " " << name;
    }
    // Headings that mean nothing: `auto` tries all that it has.
    graph_ =
        registry_.make<Generator>("landmarks2d:poses=400,sensor=bearing_range,rotation_sigma=0.3")
            ->generate(registry_, 7)
            .graph;
    guess_ = registry_.make<InitialGuess>(GetParam());
    watched_ = query<WatchedGuess>(*guess_);
    ASSERT_NE(watched_, nullptr);
  }

  Registry registry_;
  Graph graph_;
  std::unique_ptr<InitialGuess> guess_;
  WatchedGuess* watched_ = nullptr;
};

TEST_P(WatchedGuesses, ReportHowFarTheyAreAndAreTheSame) {
  Graph alone = graph_.clone();
  const auto notes = guess_->compute(alone);
  EXPECT_THAT(notes, Not(Contains(HasSubstr("interrupted"))));
  std::vector<Report> reports;
  watched_->watch([&](std::string_view what, double part) {
    reports.push_back({std::string(what), part});
    return true;
  });
  Graph watched = graph_.clone();
  EXPECT_EQ(guess_->compute(watched), notes);
  EXPECT_EQ(watched.values().pools, alone.values().pools);
  ASSERT_GT(reports.size(), 4U);
  for (std::size_t k = 0; k < reports.size(); ++k) {
    EXPECT_GE(reports[k].part, 0.0);
    EXPECT_LE(reports[k].part, 1.0);
    if (k > 0 && reports[k].what == "incremental" && reports[k - 1].what == "incremental") {
      EXPECT_GE(reports[k].part, reports[k - 1].part);
    }
  }
  EXPECT_EQ(reports.back().what, "incremental");
  EXPECT_EQ(reports.back().part, 1.0);
}

TEST_P(WatchedGuesses, EndSoonWhereverTheyAreAskedToWithFiniteStates) {
  for (const int wanted : {0, 1, 2, 3, 5, 8, 13, 21}) {
    int reports = 0;
    watched_->watch([&](std::string_view, double) { return ++reports <= wanted; });
    Graph graph = graph_.clone();
    const double before = chi2(graph);
    const auto notes = guess_->compute(graph);
    EXPECT_THAT(notes, Contains(HasSubstr("interrupted"))) << wanted;
    EXPECT_LE(reports, wanted + 2) << wanted;
    EXPECT_TRUE(std::isfinite(chi2(graph))) << wanted;
    if (std::string_view(GetParam()).starts_with("auto")) {
      EXPECT_LE(chi2(graph), before) << wanted;
    }
  }
  watched_->watch({});
  Graph graph = graph_.clone();
  EXPECT_THAT(guess_->compute(graph), Not(Contains(HasSubstr("interrupted"))));
}

INSTANTIATE_TEST_SUITE_P(Initial, WatchedGuesses,
                         testing::Values("incremental:step=50", "auto:iterations=2"),
                         [](const auto& test) {
                           const std::string name = test.param;
                           return name.substr(0, name.find(':'));
                         });

}  // namespace
}  // namespace cairn
