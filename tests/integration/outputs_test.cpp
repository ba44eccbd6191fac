// SPDX-License-Identifier: BSD-3-Clause
// Exit code 0 means that what was asked for is true and written; nothing is lost that was computed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

using Outputs = WithGraphFile;

/// Runs a command of the shell in which "$C" is the program and "$D" the test's folder.
Outcome shell(const std::string& command, const TemporaryFolder& folder) {
  return run_program({"sh", "-c", command}, {{"C", program()}, {"D", folder.path().string()}});
}

TEST_F(Outputs, AReaderThatIsGoneHidesNoError) {
  const std::string file = graph();
  for (const std::string arguments :
       {"optimize $D/none.g2o", "optimize $D/graph.g2o -o $D/no/x.g2o",
        "optimize $D/graph.g2o -o /dev/full --to g2o", "convert $D/none.g2o $D/x.g2o"}) {
    const Outcome outcome =
        shell("(sleep 0.2; $C " + arguments + "; echo code=$? >&2) | true", folder_);
    EXPECT_THAT(outcome.err, HasSubstr("code=3")) << arguments;
    EXPECT_THAT(outcome.err, HasSubstr("cairn: ")) << arguments;
  }
  const Outcome good = shell("(sleep 0.2; $C info $D/graph.g2o; echo code=$? >&2) | true", folder_);
  EXPECT_THAT(good.err, HasSubstr("code=0")) << file;
}

TEST_F(Outputs, NoneReplacesAnotherOrWhatIsRead) {
  const std::string file = graph(), before = read_text(file), same = folder_.file("same.g2o");
  std::filesystem::create_hard_link(file, folder_.file("alias.g2o"));
  std::filesystem::create_symlink("same.g2o", folder_.file("link.g2o"));  // to what is not there
  const std::vector<Arguments> refused{
      {"optimize", file, "--record", file},
      {"optimize", file, "--json", file},
      {"optimize", file, "--json", folder_.file("alias.g2o")},
      {"optimize", file, "-o", same, "--json", same},
      {"optimize", file, "-o", same, "--record", folder_.file("./same.g2o")},
      {"optimize", file, "-o", same, "--json", folder_.file("link.g2o")},
      {"bench", file, "--csv", file, "--linear-solver", "block_cholesky"},
      {"convert", file, same, "--json", same}};
  for (const Arguments& arguments : refused) {
    const Outcome outcome = cairn(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << testing::PrintToString(arguments);
    EXPECT_THAT(outcome.err, HasSubstr("name another")) << testing::PrintToString(arguments);
    EXPECT_EQ(read_text(file), before);
    EXPECT_FALSE(std::filesystem::exists(same));
  }
  // What is not a regular file may be named as often as one likes, and a graph may be replaced.
  EXPECT_EQ(cairn({"optimize", file, "--json", "/dev/null", "--record", "/dev/null"}).exit_code, 0);
  EXPECT_EQ(cairn({"optimize", file, "-o", file}).exit_code, 0);
  EXPECT_NE(read_text(file), before);
}

TEST_F(Outputs, OnlyOneGoesToStandardOutput) {
  const std::string file = graph();
  for (const Arguments& arguments :
       std::vector<Arguments>{{"optimize", file, "-o", "-", "--json", "-"},
                              {"compact", file, "-o", "-", "--trajectory", "-"},
                              {"compact", file, "-o", "-", "--steps", "-"},
                              {"replay", file, "-o", "-", "--steps", "-"},
                              {"generate", "ring:poses=9", "-o", "-", "--ground-truth", "-"},
                              {"bench", file, "--csv", "-", "--html", "-"},
                              {"explore", "@rooms", "--trajectory", "-", "--truth", "-"},
                              {"explore", "@rooms", "-o", "-", "--json", "-"},
                              {"explore", "@rooms", "--runs", "2", "--csv", "-", "--curves", "-"},
                              {"map", "robot.clf", "--graph", "-", "--trajectory", "-"}}) {
    const Outcome outcome = cairn(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << testing::PrintToString(arguments) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("one standard output")) << testing::PrintToString(arguments);
    EXPECT_EQ(outcome.out, "") << testing::PrintToString(arguments);
  }
}

TEST_F(Outputs, NoneReplacesAFileThatSaysHowToWork) {
  const std::string file = graph(), settings = folder_.file("settings.g2o");
  write_text(settings, "quiet = true\n");
  for (const Arguments& arguments :
       std::vector<Arguments>{{"optimize", file, "--config", settings, "-o", settings},
                              {"optimize", file, "--config", settings, "--json", settings},
                              {"compact", file, "--truth", settings, "-o", settings},
                              {"compact", file, "--thresholds", settings, "--steps", settings}}) {
    const Outcome outcome = cairn(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << testing::PrintToString(arguments);
    EXPECT_THAT(outcome.err, HasSubstr("name another")) << testing::PrintToString(arguments);
    EXPECT_EQ(read_text(settings), "quiet = true\n");
  }
}

TEST_F(Outputs, NoneReplacesAMapOrTheGraphByItsTrajectory) {
  const std::string file = graph(), map = folder_.file("map.g2o"), text = read_text(file);
  write_text(map, text);
  const std::string policy = "compact_pose";
  for (const Arguments& arguments :
       std::vector<Arguments>{{"compact", file, "--map", map, "--begin", "9", "--trajectory", map},
                              {"compact", file, "--map", map, "--begin", "9", "-o", map},
                              {"compact", file, "--trajectory", file},
                              {"online", "--policy", policy, "--map", map, "--trajectory", map},
                              {"online", "--policy", policy, "--map", map, "-o", map}}) {
    const Outcome outcome = cairn(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << testing::PrintToString(arguments);
    EXPECT_THAT(outcome.err, HasSubstr("name another")) << testing::PrintToString(arguments);
  }
  const Outcome saved =
      cairn({"online", "--policy", policy, "--map", map}, {}, "SAVE " + map + "\n");
  EXPECT_THAT(saved.out, HasSubstr("SAVE would replace the map that is continued"));
  EXPECT_EQ(read_text(file), text);
  EXPECT_EQ(read_text(map), text);
}

TEST_F(Outputs, DescriptorsAreWrittenWhereTheyStand) {
  graph();
  const Outcome outcome = shell(
      "cd $D; $C convert graph.g2o best.g2o --quiet; { echo first; "
      "$C convert graph.g2o /dev/stdout --to g2o --quiet; echo last; } > all.txt; "
      "$C convert graph.g2o /dev/fd/5 --to g2o --quiet 5> five.txt; "
      "$C convert graph.g2o /dev/stdout --to g2o --quiet | cat > piped.txt; "
      "$C convert graph.g2o /dev/stdin --to g2o --quiet < graph.g2o; echo code=$? >&2",
      folder_);
  EXPECT_THAT(outcome.err, HasSubstr("code=3"));  // open for reading only
  const std::string written = read_text(folder_.file("best.g2o"));
  EXPECT_EQ(read_text(folder_.file("five.txt")), written);
  // Standard output has what the command says besides; for `-` that goes to standard error.
  const std::string said = "graph.g2o (g2o): 200 variables, 462 factors written to /dev/stdout\n";
  EXPECT_TRUE(read_text(folder_.file("all.txt")) == "first\n" + written + said + "last\n");
  EXPECT_TRUE(read_text(folder_.file("piped.txt")) == written + said);
}

TEST_F(Outputs, NamesThatAreNotThereYetAreComparedToo) {
  graph();
  for (const std::string names : {"-o n.g2o --json ./n.g2o", "-o n.g2o --json $D/n.g2o"}) {
    const Outcome outcome =
        shell("cd $D; $C optimize graph.g2o " + names + "; echo code=$? >&2", folder_);
    EXPECT_THAT(outcome.err, HasSubstr("code=2")) << names;
  }
  const Outcome piped =
      shell("cd $D; $C optimize - --json graph.g2o < graph.g2o; echo code=$? >&2", folder_);
  EXPECT_THAT(piped.err, HasSubstr("code=2"));
}

TEST_F(Outputs, NothingThatIsPrintedLandsInAFile) {
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  CAIRN_NEEDS("optimizer", "levenberg_marquardt");
  CAIRN_NEEDS("generator", "ring");
  CAIRN_NEEDS("initial_guess", "auto");
  CAIRN_NEEDS("picture", "html");
  graph();
  const Outcome outcome = shell(
      "$C optimize $D/graph.g2o -o $D/best.g2o --record $D/run.jsonl 2>&- >/dev/null; "
      "$C view $D/graph.g2o $D/run.jsonl -o $D/page.html",
      folder_);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
}

TEST_F(Outputs, ARecordingThatCannotBeWrittenCostsNothingElse) {
  const std::string best = folder_.file("best.g2o"), report = folder_.file("run.json");
  const Outcome outcome =
      cairn({"optimize", graph(), "-o", best, "--json", report, "--record", "/dev/full"});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_TRUE(std::filesystem::exists(best));
  EXPECT_EQ(parse_json(read_text(report)).at("status").as_string(), "converged");
}

TEST_F(Outputs, OneThatFailsCostsNoneOfTheOthers) {
  const std::string file = graph(), report = folder_.file("run.json");
  const std::string record = folder_.file("run.jsonl"), steps = folder_.file("steps.csv");
  const Outcome optimized = cairn(
      {"optimize", file, "-o", "/dev/full", "--to", "g2o", "--json", report, "--record", record});
  EXPECT_EQ(optimized.exit_code, 3);
  EXPECT_THAT(optimized.err, HasSubstr("cairn: /dev/full: cannot be written"));
  EXPECT_THAT(optimized.out, HasSubstr("converged"));
  EXPECT_THAT(optimized.out, testing::Not(HasSubstr("/dev/full")));
  EXPECT_THAT(optimized.out, HasSubstr(record));
  EXPECT_EQ(parse_json(read_text(report)).at("status").as_string(), "converged");
  EXPECT_THAT(read_text(record), HasSubstr("{\"summary\":"));
  if (!Registry().has("estimator", "batch")) GTEST_SKIP() << "there is no estimator batch";
  // The first error is the one that is reported last; the others are notes.
  const Outcome replayed =
      cairn({"replay", file, "--estimator", "batch", "-o", "/dev/full", "--to", "g2o", "--steps",
             steps, "--solve-every", "100", "--json", "/dev/full"});
  EXPECT_EQ(replayed.exit_code, 3);
  EXPECT_THAT(replayed.err, HasSubstr("note: /dev/full: cannot be written"));
  EXPECT_THAT(replayed.err, HasSubstr("\ncairn: /dev/full: cannot be written"));
  EXPECT_EQ(lines(read_text(steps)).size(), 201U);
}

TEST_F(Outputs, EachOneThatFailsIsNamedAlsoWithQuiet) {
  const Outcome outcome = cairn(
      {"optimize", graph(), "-o", "/dev/full", "--to", "g2o", "--record", "/dev/full", "--quiet"});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("note: /dev/full: cannot be written"));
  EXPECT_THAT(outcome.err, HasSubstr("\ncairn: /dev/full: cannot be written"));
}

TEST_F(Outputs, OneThatDoesNotFitLeavesItsRoomToTheOthers) {
  graph();
  if (shell("unshare -rm true", folder_).exit_code != 0)
    GTEST_SKIP() << "this system does not let its users mount anything";
  const Outcome outcome = shell(
      "cd $D; mkdir disk; unshare -rm sh -c 'mount -t tmpfs -o size=200k tmpfs disk && "
      "$C optimize graph.g2o --optimizer gauss_newton --tolerance 0 --iterations 200 "
      "-o disk/best.g2o --json disk/run.json "
      "--record disk/run.jsonl --quiet; echo code=$? >&2; ls disk'",
      folder_);
  EXPECT_THAT(outcome.err, HasSubstr("code=3"));
  EXPECT_THAT(outcome.err, HasSubstr("cairn: disk/run.jsonl: cannot be written"));
  EXPECT_THAT(outcome.out, testing::EndsWith("best.g2o\nrun.json\n"));
}

TEST_F(Outputs, ARecordingReplacesAnotherOnlyWhenItIsWhole) {
  graph();
  write_text(folder_.file("run.jsonl"), "before");
  const Outcome outcome = shell(
      "ulimit -f 8; $C optimize $D/graph.g2o --record $D/run.jsonl; echo code=$? >&2", folder_);
  EXPECT_THAT(outcome.err, HasSubstr("code=3"));
  EXPECT_EQ(read_text(folder_.file("run.jsonl")), "before");
  EXPECT_EQ(folder_.contents(), (std::vector<std::string>{"graph.g2o", "run.jsonl"}));
}

TEST_F(Outputs, AreTriedAsTheyWillBeWritten) {
  const std::string file = graph();
  const Outcome name =
      cairn({"optimize", file, "-o", folder_.file(std::string(246, 'x') + ".g2o")});
  EXPECT_EQ(name.exit_code, 3);
  EXPECT_THAT(name.err, Not(HasSubstr("iteration")));
  EXPECT_THAT(name.err, Not(HasSubstr(".part")));
  const Outcome report = cairn({"optimize", file, "--json", folder_.file("no/run.json")});
  EXPECT_EQ(report.exit_code, 3);
  EXPECT_THAT(report.err, HasSubstr("folder"));
}

// Whenever the signal comes: before the work it ends the program, later the waiting.
TEST_F(Outputs, AFileThatCannotBeReplacedIsRefusedBeforeTheWork) {
  const std::string file = graph();
  if (shell("unshare -rm true", folder_).exit_code != 0)
    GTEST_SKIP() << "this system does not let its users mount anything";
  const Outcome mounted = shell(
      "cd $D; echo old > mounted.g2o; unshare -rm sh -c 'mount --bind mounted.g2o mounted.g2o && "
      "$C optimize graph.g2o -o mounted.g2o; echo code=$? >&2'",
      folder_);
  EXPECT_THAT(mounted.err, HasSubstr("code=3"));
  EXPECT_THAT(mounted.err, HasSubstr("mount its folder instead"));
  EXPECT_THAT(mounted.out, Not(HasSubstr("chi2")));
  EXPECT_EQ(read_text(folder_.file("mounted.g2o")), "old\n");
}

TEST_F(Outputs, AFileOfAnotherUserInAStickyFolderIsRefusedBeforeTheWork) {
  graph();
  // The program as somebody else, who may write to the file and to its folder.
  const std::string other = "setpriv --reuid=65534 --clear-groups ";
  if (shell(other + "$C --version", folder_).exit_code != 0)
    GTEST_SKIP() << "only root can run the program as another user, in a folder that he may read";
  const Outcome sticky = shell(
      "cd $D; chmod 755 .; mkdir sticky; chmod 1777 sticky; echo old > sticky/x.g2o; "
      "chmod 666 sticky/x.g2o; " +
          other + "$C optimize graph.g2o -o sticky/x.g2o; echo code=$? >&2",
      folder_);
  EXPECT_THAT(sticky.err, HasSubstr("code=3"));
  EXPECT_THAT(sticky.err, HasSubstr("folder sticky is sticky"));
  EXPECT_EQ(read_text(folder_.file("sticky/x.g2o")), "old\n");
}

TEST_F(Outputs, AFifoThatNothingReadsIsNotWaitedForAfterASignal) {
  graph();
  for (const char* seconds : {"0.05", "2"}) {
    const Outcome outcome =
        shell("mkfifo $D/fifo; timeout --preserve-status -s INT -k 60 " + std::string(seconds) +
                  " $C optimize $D/graph.g2o -o $D/fifo --to g2o; "
                  "echo code=$? >&2; rm $D/fifo",
              folder_);
    EXPECT_THAT(outcome.err, testing::AnyOf(HasSubstr("code=3"), HasSubstr("code=130")));
  }
}

TEST_F(Outputs, ALimitOfTheSizeOfFilesIsAnError) {
  graph();
  const Outcome outcome =
      shell("ulimit -f 8; $C optimize $D/graph.g2o -o $D/best.g2o; echo code=$? >&2", folder_);
  EXPECT_THAT(outcome.err, HasSubstr("code=3"));
  EXPECT_THAT(outcome.err, HasSubstr("best.g2o: cannot be written"));
  EXPECT_EQ(folder_.contents(), (std::vector<std::string>{"graph.g2o"}));
}

TEST_F(Outputs, ThreadsThatCannotBeStartedAreAnError) {
#if defined(CAIRN_SANITIZED)
  GTEST_SKIP() << "the sanitizer needs more address space than the limit leaves";
#endif
  graph();
  // 800 stacks of 8 MB do not fit.
  const Outcome outcome = shell(
      "ulimit -s 8192; ulimit -v 4000000; $C optimize $D/graph.g2o -o $D/best.g2o --threads 800; "
      "echo code=$? >&2",
      folder_);
  EXPECT_THAT(outcome.err, HasSubstr("code=4"));
  EXPECT_THAT(outcome.err, HasSubstr("cairn: the threads cannot be started"));
  EXPECT_THAT(outcome.err, HasSubstr("--threads"));
  EXPECT_EQ(folder_.contents(), (std::vector<std::string>{"graph.g2o"}));
}

TEST_F(Outputs, AnInterruptBeforeSparsificationWritesTheEstimate) {
  if (!Registry().has("sparsifier", "sparsify")) GTEST_SKIP() << "there is no sparsifier";
  const std::string sparse = folder_.file("sparse.g2o");
  const Outcome outcome = cairn_interrupted(
      {"sparsify", graph(), "-o", sparse, "--tolerance", "0", "--iterations", "1000000000"},
      "iteration   2 ", SIGINT);
  EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("nothing was taken out"));
  EXPECT_EQ(report_of({"info", sparse}).at("graph").at("variables").as_int64(), 200);
}

class OnlineOutputs : public Outputs {
 protected:
  void SetUp() override {
    CAIRN_NEEDS("estimator", "batch");
    CAIRN_NEEDS("linear_solver", "block_cholesky");
    CAIRN_NEEDS("optimizer", "levenberg_marquardt");
    CAIRN_NEEDS("stream_format", "g2o");
    CAIRN_NEEDS("types", "slam2d");
    std::string stream = "VERTEX_SE2 0 0 0 0\nFIX 0\n";
    for (int k = 1; k <= 20; ++k) {
      stream += "NEW VERTEX_SE2 " + std::to_string(k) + "\nEDGE_SE2 " + std::to_string(k - 1) +
                " " + std::to_string(k) + " 1 0 0 100 0 0 100 0 100\n";
    }
    write_text(folder_.file("stream.txt"), stream);
  }
  std::int64_t poses(const std::string& file) const {
    return report_of({"info", file}).at("graph").at("variables").as_int64();
  }
};

TEST_F(OnlineOutputs, GoOnWithoutAReaderOfTheAnswers) {
  const Outcome outcome = shell(
      "(while read -r line; do echo \"$line\"; sleep 0.01; done < $D/stream.txt) |"
      " ($C online --estimator batch -o $D/map.g2o; echo code=$? >&2) | head -n 1",
      folder_);
  EXPECT_THAT(outcome.err, HasSubstr("the reader of the answers is gone"));
  EXPECT_THAT(outcome.err, HasSubstr("code=0"));
  EXPECT_EQ(poses(folder_.file("map.g2o")), 21);
}

TEST_F(OnlineOutputs, ASessionThatFailsStillWritesItsMap) {
  const Outcome outcome = shell(
      "(cat $D/stream.txt; head -c 17000000 /dev/zero | tr '\\0' x) |"
      " $C online --estimator batch --output none -o $D/map.g2o",
      folder_);
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("16 MB"));
  EXPECT_EQ(poses(folder_.file("map.g2o")), 21);
}

TEST_F(OnlineOutputs, PosesAreWrittenWhereNoFormatExpressesTheGraph) {
  const Outcome outcome =
      cairn({"online", "--estimator", "batch", "--output", "none", "-o", folder_.file("map.g2o")},
            {}, read_text(folder_.file("stream.txt")) + "MARGINALIZE 3 4\n");
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("cannot express MARGINAL_PRIOR"));
  EXPECT_THAT(outcome.err, HasSubstr("the poses alone are in"));
  const std::string poses = read_text(folder_.file("map.g2o.tum"));
  EXPECT_EQ(std::ranges::count(poses, '\n'), 19);
}

TEST_F(OnlineOutputs, ALastLineWithoutItsEndIsNotTaken) {
  const Outcome outcome = cairn(
      {"online", "--estimator", "batch", "--output", "none", "-o", folder_.file("map.g2o")}, {},
      read_text(folder_.file("stream.txt")) + "VERTEX_SE2 21 1 0 0\nEDGE_SE2 20 21 1 0 0 10");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("the last line has no end, and was not taken: 'EDGE_SE2 20"));
  EXPECT_EQ(poses(folder_.file("map.g2o")), 21);
}

}  // namespace
}  // namespace cairn::test
