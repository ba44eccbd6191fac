// SPDX-License-Identifier: BSD-3-Clause
// SIGINT, SIGTERM and SIGHUP end every command with code 130, in every phase of its work.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <string>
#include <utility>

#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

using Interrupts = WithGraphFile;

/// Runs a command of the shell in the test's folder; "$C" is the program.
Outcome shell(const std::string& command, const TemporaryFolder& folder) {
  return run_program({"sh", "-c", "cd \"$D\" || exit; " + command},
                     {{"C", program()}, {"D", folder.path().string()}});
}

TEST_F(Interrupts, BeforeTheWorkEndTheProgramAtOnce) {
  graph();
  for (const std::string command : {"info pipe", "convert pipe out.g2o", "optimize pipe -o out.g2o",
                                    "evaluate pipe graph.g2o", "sparsify pipe", "replay pipe"}) {
    for (const std::string signal : {"INT", "TERM", "HUP"}) {
      // Opening the pipe waits until the program reads it.
      const Outcome outcome = shell("mkfifo pipe; $C " + command + " & exec 3>pipe; kill -" +
                                        signal + " $!; wait $!; echo code=$? >&2; rm pipe",
                                    folder_);
      EXPECT_THAT(outcome.err, HasSubstr("cairn: interrupted\n")) << command << signal;
      EXPECT_THAT(outcome.err, HasSubstr("code=130")) << command << signal;
      EXPECT_EQ(folder_.contents(), (std::vector<std::string>{"graph.g2o"})) << command;
    }
  }
}

TEST_F(Interrupts, ASecondOneEndsTheProgramAndLeavesNothingUnfinished) {
  CAIRN_NEEDS("optimizer", "levenberg_marquardt");
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  graph();
  // Stopped, it gets both at the same moment.
  const Outcome outcome = shell(
      "$C optimize graph.g2o --record run.jsonl -o best.g2o --quiet --tolerance 0 --iterations "
      "1000000000 & until ls *.part; do sleep 0.01; done >/dev/null 2>&1; sleep 0.1; kill -STOP "
      "$!; "
      "kill -INT $!; kill -TERM $!; kill -CONT $!; wait $!; echo code=$? >&2",
      folder_);
  EXPECT_THAT(outcome.err, HasSubstr("cairn: interrupted\n"));
  EXPECT_THAT(outcome.err, HasSubstr("code=130"));
  EXPECT_EQ(folder_.contents(), (std::vector<std::string>{"graph.g2o"}));
}

/// A terminal that closes sends SIGHUP to what runs in it, twice: from the shell and the kernel.
TEST_F(Interrupts, TheEndOfATerminalWritesAllOutputs) {
  CAIRN_NEEDS("optimizer", "levenberg_marquardt");
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  graph();
  const Outcome outcome = shell(
      "$C optimize graph.g2o --record run.jsonl -o best.g2o --json run.json --tolerance 0 "
      "--iterations 1000000000 --quiet & until ls *.part; do sleep 0.01; done >/dev/null 2>&1; "
      "sleep 0.1; kill -STOP $!; kill -HUP $!; kill -CONT $!; kill -HUP $!; wait $!; "
      "echo code=$? >&2",
      folder_);
  EXPECT_THAT(outcome.err, HasSubstr("code=130"));
  EXPECT_EQ(folder_.contents(),
            (std::vector<std::string>{"best.g2o", "graph.g2o", "run.json", "run.jsonl"}));
  EXPECT_EQ(parse_json(read_text(folder_.file("run.json"))).at("status").as_string(),
            "interrupted");
}

/// As nohup starts it.
TEST_F(Interrupts, AProgramThatBeganWithHangupsIgnoredGoesOn) {
  CAIRN_NEEDS("optimizer", "levenberg_marquardt");
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  graph();
  const Outcome outcome = shell(
      "trap '' HUP; $C optimize graph.g2o --record run.jsonl -o best.g2o --tolerance 0 "
      "--iterations 3000 --quiet & until ls *.part; do sleep 0.01; done >/dev/null 2>&1; "
      "kill -HUP $!; wait $!; echo code=$? >&2",
      folder_);
  EXPECT_THAT(outcome.err, HasSubstr("code=0"));
  EXPECT_THAT(folder_.contents(), Contains("best.g2o"));
}

/// That is how a service ends. What a journal has is not in the map yet.
TEST_F(Interrupts, AServiceThatHasNotBegunEndsAsOneThatHas) {
  for (const auto& [more, code] : {std::pair("", "code=0"), {" --journal j", "code=130"}}) {
    const Outcome outcome =
        shell(std::string("mkfifo pipe; $C online --listen s -o m.g2o --config pipe") + more +
                  " & exec 3>pipe; kill -TERM $!; wait $!; echo code=$? >&2; rm pipe",
              folder_);
    EXPECT_THAT(outcome.err, HasSubstr(std::string(code) + "\n"));
    EXPECT_TRUE(folder_.contents().empty());
  }
}

TEST_F(Interrupts, EndAnInitialGuessWithWhatItHas) {
  CAIRN_NEEDS("optimizer", "levenberg_marquardt");
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  const std::string best = folder_.file("best.g2o"), json = folder_.file("run.json");
  // Optimised at each pose, which takes far longer than until the first line of progress.
  const Outcome outcome = cairn_interrupted({"optimize", "@manhattan:poses=6000", "--initial",
                                             "incremental:step=1", "-o", best, "--json", json},
                                            "initial estimate: incremental", SIGINT);
  EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("of 6000: the others are not optimised"));
  EXPECT_EQ(parse_json(read_text(json)).at("status").as_string(), "interrupted");
  EXPECT_EQ(report_of({"info", best}).at("graph").at("variables").as_int64(), 6000);
}

TEST_F(Interrupts, EndAPageThatIsBeingMade) {
  if (!Registry().has("picture", "html")) GTEST_SKIP() << "built without the page";
  graph();
  const Outcome outcome = shell(
      "mkfifo pipe; $C view graph.g2o pipe -o page.html & exec 3>pipe; kill -TERM $!; "
      "wait $!; echo code=$? >&2",
      folder_);
  EXPECT_THAT(outcome.err, HasSubstr("code=130"));
  EXPECT_THAT(folder_.contents(), Not(Contains(HasSubstr("page"))));
}

}  // namespace
}  // namespace cairn::test
