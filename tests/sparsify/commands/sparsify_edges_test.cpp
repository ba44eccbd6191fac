// SPDX-License-Identifier: BSD-3-Clause
// cairn sparsify GRAPH --edges NAME.
#include <csignal>
#include <cstdint>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "integration/process.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class SparsifyEdges : public testing::Test {
 protected:
  void SetUp() override {
    CAIRN_NEEDS("edge_selection", "mac");
    report_of({"generate", "manhattan:poses=200,streets=4", "-o", raw_});
    report_of({"optimize", raw_, "-o", best_});
    factors_ = report_of({"info", best_}).at("graph").at("factors").as_int64();
  }
  boost::json::value report(const std::string& selection, Arguments more = {}) {
    more.insert(more.begin(), {"sparsify", best_, "--as-given", "--edges", selection, "--quiet"});
    return report_of(more);
  }
  void expect_refusal(Arguments arguments, int exit_code, const std::string& says) {
    arguments.insert(arguments.begin(), "sparsify");
    const Outcome outcome = cairn(arguments);
    EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
    EXPECT_THAT(unfolded(outcome.err), HasSubstr(says));
  }
  TemporaryFolder folder_;
  std::string raw_ = folder_.file("raw.g2o"), best_ = folder_.file("best.g2o"),
              out_ = folder_.file("out.g2o");
  std::int64_t factors_ = 0;
};

TEST_F(SparsifyEdges, WritesAllPosesAndReportsWhatWasLost) {
  const auto told = report("greedy_gain:part=0.25", {"-o", out_});
  EXPECT_EQ(told.at("edges").as_string(), "greedy_gain:part=0.25");
  EXPECT_EQ(told.at("status").as_string(), "converged");
  EXPECT_EQ(told.at("poses").at("in").as_int64(), 200);
  EXPECT_EQ(told.at("poses").at("kept").as_int64(), 200);
  EXPECT_EQ(told.at("backbone").at("factors").as_int64(), 199);
  EXPECT_EQ(told.at("backbone").at("odometry").as_int64(), 199);
  const std::int64_t loops = told.at("loops").at("in").as_int64(),
                     kept = told.at("loops").at("kept").as_int64();
  EXPECT_EQ(loops, factors_ - 199);
  EXPECT_NEAR(static_cast<double>(kept), 0.25 * static_cast<double>(loops), 0.5);
  EXPECT_EQ(told.at("factors").at("out").as_int64(), 199 + kept);
  const auto written = report_of({"info", out_}).at("graph");
  EXPECT_EQ(written.at("variables").as_int64(), 200);
  EXPECT_EQ(written.at("factors").as_int64(), 199 + kept);
  // The same divergence as of the two files.
  const double kld = told.at("kld").as_double();
  EXPECT_GT(kld, 1.0);
  EXPECT_NEAR(report_of({"evaluate", out_, best_, "--kld"}).at("kld").as_double(), kld, 1e-3 * kld);
  for (const char* weight : {"rotation", "translation"}) {
    const auto& of = told.at("connectivity").at(weight);
    EXPECT_LT(of.at("sparse").as_double(), of.at("full").as_double());
    EXPECT_TRUE(of.at("bound").is_null());
  }
  EXPECT_TRUE(told.at("kld_bound").is_null());
}

TEST_F(SparsifyEdges, BoundsAreReportedWhereTheyAreKnown) {
  const auto mac = report("mac:part=0.25").at("connectivity").at("rotation");
  EXPECT_LE(mac.at("sparse").as_double(), mac.at("bound").as_double());
  EXPECT_LE(mac.at("bound").as_double(), mac.at("full").as_double());
  const auto l1 = report("l1:part=0.25");
  EXPECT_LE(l1.at("kld_bound").as_double(), l1.at("kld_parts").at("covariance").as_double());
  EXPECT_GT(l1.at("kld_bound").as_double(), 0.0);
  const Outcome text = cairn({"sparsify", best_, "--as-given", "--edges", "mac", "--quiet"});
  EXPECT_THAT(unfolded(text.out),
              AllOf(HasSubstr("loop closures (mac)"), HasSubstr("algebraic connectivity"),
                    HasSubstr("no choice of as many has more than")));
  EXPECT_TRUE(report("random", {"--no-kld"}).at("kld").is_null());
  EXPECT_EQ(report_of({"study", "sparsify", best_, "--edges", "random", "--quiet"})
                .at("loops")
                .at("in")
                .as_int64(),
            factors_ - 199);
}

TEST_F(SparsifyEdges, RefusesWhatDoesNotFit) {
  for (const Arguments& node : {Arguments{"--keep-every", "3"},
                                {"--nodes", "all"},
                                {"--select", "oldest"},
                                {"--topology", "clt"},
                                {"--population", "tree:1"},
                                {"--recovery", "fd"},
                                {"--scheme", "runs"},
                                {"--online", "9"}}) {
    expect_refusal({best_, "--edges", "mac", node[0], node[1]}, 2,
                   node[0] + " is about removed nodes: give one of the two");
  }
  expect_refusal({best_, "--edges", "greedy_gian"}, 5, "greedy_gain");
  expect_refusal({best_, "--edges", "mac:part=2"}, 2, "part");
  expect_refusal({"@manhattan:poses=30,loop_density=0", "--edges", "mac"}, 3,
                 "there are no loop closures to choose from");
  expect_refusal({best_, "--edges", "mac", "--linear-solver", "nobody"}, 5, "nobody");
}

TEST_F(SparsifyEdges, AnInterruptLeavesAllIn) {
  for (const char* selection : {"mac:iterations=1000000,tolerance=0", "l1:samples=1000000"}) {
    const Outcome outcome = cairn_interrupted({"sparsify", best_, "--edges", selection, "-o", out_},
                                              "choosing loop closures", SIGINT);
    EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
    EXPECT_THAT(unfolded(outcome.err), HasSubstr("none was removed"));
    EXPECT_EQ(report_of({"info", out_}).at("graph").at("factors").as_int64(), factors_);
  }
}

}  // namespace
}  // namespace cairn::test
