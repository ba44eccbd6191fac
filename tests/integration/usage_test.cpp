// SPDX-License-Identifier: BSD-3-Clause
// What every subcommand has in common: help, errors, common options, streams.
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>
#include <utility>

#include <boost/json/parse.hpp>

#include "integration/process.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;

constexpr int kUsage = 2, kInput = 3, kPlugin = 5;

const std::vector<std::string> kCommands{"info",    "optimize", "bench",   "evaluate",
                                         "convert", "generate", "plugins", "new-plugin",
                                         "view",    "plot",     "study"};

void expect_fits_a_screen(const Outcome& help) {
  EXPECT_EQ(help.exit_code, 0) << help.err;
  EXPECT_LE(lines(help.out).size(), 40u);
  for (const std::string& line : lines(help.out)) EXPECT_LE(columns(line), 100u) << line;
  EXPECT_THAT(help.out, HasSubstr("Example:"));
  EXPECT_THAT(help.out, HasSubstr("Usage: cairn"));
}

/// One line on standard error that begins with the program's name, and nothing on standard output.
void expect_error(const Outcome& outcome, int exit_code, const std::string& says) {
  EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
  EXPECT_EQ(outcome.out, "");
  EXPECT_THAT(lines(outcome.err), SizeIs(1)) << outcome.err;
  EXPECT_THAT(outcome.err, StartsWith("cairn: "));
  EXPECT_THAT(outcome.err, HasSubstr(says));
}

TEST(Usage, HelpFitsAScreenAndShowsAnExample) {
  expect_fits_a_screen(cairn({"--help"}));
  for (const std::string& command : kCommands) {
    SCOPED_TRACE(command);
    expect_fits_a_screen(cairn({command, "--help"}));
    EXPECT_THAT(cairn({"--help"}).out, HasSubstr("  " + command + " "));
  }
}

TEST(Usage, HelpIsACommandToo) {
  EXPECT_EQ(cairn({"help"}).out, cairn({"--help"}).out);
  for (const std::string& command : kCommands) {
    const Outcome outcome = cairn({"help", command});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(outcome.out, cairn({command, "--help"}).out);
  }
  expect_fits_a_screen(cairn({"help", "help"}));
  expect_error(cairn({"help", "optimise"}), kUsage, "did you mean 'optimize'?");
}

TEST(Usage, WithoutACommandTheHelpGoesToStandardError) {
  const Outcome outcome = cairn({});
  EXPECT_EQ(outcome.exit_code, kUsage);
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(outcome.err, cairn({"--help"}).out);
}

TEST(Usage, TellsItsVersion) { EXPECT_THAT(cairn({"--version"}).out, StartsWith("cairn ")); }

TEST(Usage, AnUnknownCommandIsAnsweredWithTheNearest) {
  expect_error(cairn({"optimise", "x.g2o", "--iterations", "3"}), kUsage,
               "did you mean 'optimize'?");
  expect_error(cairn({"frobnicate"}), kUsage, "evaluate");
}

TEST(Usage, AnUnknownOptionIsAnsweredWithTheNearest) {
  expect_error(cairn({"optimize", "x.g2o", "--iteratons", "5"}), kUsage,
               "did you mean '--iterations'?");
  // Its value stands where the graph belongs: the option is still what is wrong.
  expect_error(cairn({"optimize", "--iteratons", "5", "x.g2o"}), kUsage, "'--iteratons'");
  expect_error(cairn({"info", "x.g2o", "--thread=2"}), kUsage, "did you mean '--threads'?");
  expect_error(cairn({"--frobnicate"}), kUsage, "'--frobnicate'");
  expect_error(cairn({"sparsify", "x.g2o", "--keep", "100"}), kUsage,
               "did you mean '--keep-every'?");
}

TEST(Usage, MissingAndSurplusAndMalformedArgumentsAreRefused) {
  expect_error(cairn({"optimize"}), kUsage,
               "GRAPH is missing; usage: cairn optimize [OPTIONS] GRAPH");
  expect_error(cairn({"bench"}), kUsage, "usage: cairn bench [OPTIONS] GRAPH...");
  expect_error(cairn({"generate", "ring"}), kUsage,
               "--output OUT is missing; usage: cairn generate [OPTIONS] KIND[:k=v] -o OUT");
  expect_error(cairn({"info", "a.g2o", "b.g2o"}), kUsage, "'b.g2o' is one argument too many");
  expect_error(cairn({"optimize", "@ring", "--iterations", "many"}), kUsage,
               "--iterations: 'many' is not an integer from 0 to 1000000000");
  expect_error(cairn({"generate", "ring", "-o", "x.g2o", "--seed", "abc"}), kUsage,
               "--seed: 'abc' is not an integer from 0");
  expect_error(cairn({"optimize", "@ring", "--covariance", "all"}), kUsage,
               "--covariance: 'all' is not one of blocks, none");
  expect_error(cairn({"optimize", "@ring", "--json"}), kUsage, "--json needs a value: --json FILE");
  expect_error(cairn({"optimize", "@ring", "--loss", "huber", "--loss", "cauchy"}), kUsage,
               "--loss is given more than once");
  expect_error(cairn({"optimize", "@ring", "--output", ""}), kUsage,
               "--output: an empty word is no value; leave the option out");
  expect_error(cairn({"optimize", ""}), kUsage, "an empty word is no value");
  expect_error(cairn({"optimize", "@ring", "--config", ""}), kUsage, "an empty word is no value");
  expect_error(cairn({"optimize", "@ring", "--iterations=-1"}), kUsage, "-1");
  expect_error(cairn({"optimize", "@ring", "--tolerance", "2"}), kUsage, "--tolerance");
  expect_error(cairn({"optimize", "@ring", "--threads", "100000"}), kUsage, "--threads");
}

TEST(Usage, ExitCodesTellInputFromPluginFromUsage) {
  expect_error(cairn({"info", "there-is-no-such-file.g2o"}), kInput, "there-is-no-such-file.g2o");
  expect_error(cairn({"optimize", "@ring", "--linear-solver", "chomod"}), kPlugin,
               "no linear solver 'chomod'");
  expect_error(cairn({"optimize", "@ring", "--optimizer", "levenberg"}), kPlugin,
               "levenberg_marquardt");
  expect_error(cairn({"optimize", "@ring", "--initial", "oodometry"}), kPlugin, "odometry");
  expect_error(cairn({"optimize", "@ring", "--plugin", "there-is-no-such-plugin.so"}), kPlugin,
               "there-is-no-such-plugin.so");
  expect_error(cairn({"info", "@ring", "--types", "slam3d:metric=manhattan"}), kUsage, "logarithm");
  expect_error(cairn({"info", "@ring", "--types", "slam3d:metrik=g2o"}), kUsage, "'metric'");
}

TEST(Usage, ABadFileIsRefusedInOneLineThatNamesTheLine) {
  const TemporaryFolder folder;
  write_text(folder.file("bad.g2o"), "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 zero 0\n");
  expect_error(cairn({"info", folder.file("bad.g2o")}), kInput, "bad.g2o:2");
}

TEST(Usage, JsonOnStandardOutputIsAlone) {
  const TemporaryFolder folder;
  const std::string graph = folder.file("graph.g2o"), best = folder.file("best.g2o");
  const std::vector<Arguments> runs{{"generate", "ring:poses=40", "-o", graph, "--json", "-"},
                                    {"info", graph, "--json", "-"},
                                    {"optimize", graph, "-o", best, "--json", "-"},
                                    {"convert", graph, folder.file("graph.tum"), "--json", "-"},
                                    {"evaluate", best, graph, "--json", "-"},
                                    {"bench", graph, "--repeat", "1", "--json", "-"},
                                    {"plugins", "--json", "-"},
                                    {"plugins", "levenberg_marquardt", "--json", "-"}};
  for (const Arguments& run : runs) {
    SCOPED_TRACE(run.front());
    const Outcome outcome = cairn(run);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    const auto report = parse_json(outcome.out).as_object();
    EXPECT_TRUE(report.at("cairn").is_string());
    EXPECT_EQ(report.at("command").as_string(), run.front());
  }
}

TEST(Usage, JsonIsUtf8WhateverTheNameOfAFile) {
  TemporaryFolder folder;
  const std::string graph = folder.file("r\xff.g2o"), json = folder.file("run.json");
  ASSERT_EQ(cairn({"generate", "ring:poses=12", "-o", graph}).exit_code, 0);
  ASSERT_EQ(cairn({"optimize", graph, "--json", json}).exit_code, 0);
  boost::system::error_code invalid;
  const auto report = boost::json::parse(read_text(json), invalid);
  ASSERT_FALSE(invalid) << invalid.message();
  EXPECT_THAT(std::string(report.at("graph").at("file").as_string()),
              EndsWith("r\xEF\xBF\xBD.g2o"));
}

TEST(Usage, CommonOptionsMayStandBeforeTheCommand) {
  const Outcome before = cairn({"--json", "-", "--quiet", "info", "@ring:poses=20"});
  EXPECT_EQ(parse_json(before.out).at("command").as_string(), "info");
}

TEST(Usage, QuietLeavesStandardErrorEmpty) {
  for (const Arguments& run :
       std::vector<Arguments>{{"optimize", "@ring:poses=40", "--quiet"},
                              {"bench", "@ring:poses=40", "--repeat", "1", "--quiet"},
                              {"info", "@ring:poses=40", "--quiet"}}) {
    const Outcome outcome = cairn(run);
    EXPECT_EQ(outcome.exit_code, 0);
    EXPECT_EQ(outcome.err, "");
    EXPECT_NE(outcome.out, "");
  }
}

TEST(Usage, OptionsOfEveryCommandMayStandBeforeIt) {
  const Outcome after = cairn({"info", "@ring:poses=40", "--threads", "1"});
  const Outcome before = cairn({"--threads", "1", "info", "@ring:poses=40"});
  EXPECT_EQ(before.exit_code, 0) << before.err;
  EXPECT_EQ(before.out, after.out);
  expect_error(cairn({"--threads", "1", "inof", "@ring"}), kUsage, "did you mean 'info'?");
}

TEST(Usage, AConfigurationFileStandsBehindTheCommandLine) {
  const TemporaryFolder folder;
  write_text(folder.file("run.toml"),
             "quiet = true\n[optimize]\niterations = 2\ntolerance = 0\n"
             "linear-solver = \"eigen\"\n[bench]\nrepeat = 3\n");
  const Arguments base{"optimize", "@ring:poses=60", "--json",
                       "-",        "--config",       folder.file("run.toml")};
  const auto by_file = parse_json(cairn(base).out);
  EXPECT_EQ(by_file.at("iterations").as_array().size(), 2u);
  EXPECT_EQ(by_file.at("linear_solver").as_string(), "eigen");
  Arguments more = base;
  more.insert(more.end(), {"--iterations", "3"});
  const auto by_line = parse_json(cairn(more).out);
  EXPECT_EQ(by_line.at("iterations").as_array().size(), 3u);
}

TEST(Usage, AConfigurationFileWithUnknownKeysIsRefused) {
  const TemporaryFolder folder;
  const auto with = [&](const std::string& text) {
    write_text(folder.file("run.toml"), text);
    return cairn({"optimize", "@ring", "--config", folder.file("run.toml")});
  };
  expect_error(with("[optimize]\niteratons = 2\n"), kUsage, "did you mean '--iterations'?");
  expect_error(with("[bench]\nrepet = 2\n"), kUsage, "did you mean '--repeat'?");
  expect_error(with("iterations = 2\n"), kUsage, "'iterations'");
  expect_error(with("[optimise]\niterations = 2\n"), kUsage, "'optimise'");
  write_text(folder.file("again.toml"), "config = \"run.toml\"\n");
  expect_error(cairn({"info", "@ring", "--config", folder.file("again.toml")}), kUsage,
               "--config: 'config' is for the command line alone");
  expect_error(cairn({"info", "@ring", "--config", folder.file("none.toml")}), kInput, "none.toml");
  expect_error(cairn({"info", "@ring", "--config", "/dev/zero"}), kInput, "more than 1 MB");
}

TEST(Usage, AReaderThatGoesAwayIsNoError) {
  for (const std::string& words :
       {std::string("plugins"), std::string("convert @manhattan:poses=5000 - --to g2o")}) {
    const Outcome outcome =
        run_program({"bash", "-c", program() + " " + words + " | true; echo ${PIPESTATUS[0]}"});
    EXPECT_EQ(outcome.out, "0\n") << words << outcome.err;
    EXPECT_EQ(outcome.err, "");
  }
}

TEST(Usage, AFullDiskIsAnError) {
  for (const std::string& words :
       {std::string("plugins"), std::string("convert @ring - --to g2o")}) {
    const Outcome outcome = run_program({"bash", "-c", program() + " " + words + " > /dev/full"});
    EXPECT_EQ(outcome.exit_code, kInput) << words;
    EXPECT_THAT(outcome.err, HasSubstr("cannot be written"));
  }
}

TEST(Usage, ColoursOnlyOnATerminalThatWantsThem) {
  EXPECT_THAT(cairn_on_terminal({"plugins"}, {{"TERM", "xterm"}, {"NO_COLOR", ""}}).out,
              HasSubstr("\x1b[1m"));
  EXPECT_THAT(cairn_on_terminal({"plugins"}, {{"TERM", "xterm"}, {"NO_COLOR", "1"}}).out,
              Not(HasSubstr("\x1b")));
  EXPECT_THAT(cairn_on_terminal({"plugins"}, {{"TERM", "dumb"}}).out, Not(HasSubstr("\x1b[1m")));
  EXPECT_THAT(cairn({"plugins"}, {{"TERM", "xterm"}}).out, Not(HasSubstr("\x1b")));
}

TEST(Usage, ProgressNeverWrapsOnATerminal) {
  const TemporaryFolder folder;
  const std::string graph = folder.file(std::string(100, 'x') + ".g2o");
  ASSERT_EQ(cairn({"generate", "ring:poses=40", "-o", graph}).exit_code, 0);
  for (const auto& [told, width] : std::vector<std::pair<int, std::size_t>>{{60, 60}, {0, 80}}) {
    const Outcome bench = cairn_on_terminal(
        {"bench", graph, "--repeat", "2", "--linear-solver", "eigen", "--json", "-"},
        {{"TERM", "xterm"}}, told);
    std::size_t longest = 0;
    for (std::size_t begin = 0; (begin = bench.out.find('\r', begin)) != std::string::npos;) {
      const std::size_t end = bench.out.find_first_of("\r\n", ++begin);
      longest = std::max(longest, columns(bench.out.substr(begin, end - begin)));
    }
    EXPECT_EQ(longest, width - 1);  // the last column would wrap on some
  }
}

TEST(Usage, TablesFitTheTerminal) {
  for (const auto& [told, width] : std::vector<std::pair<int, std::size_t>>{{72, 72}, {0, 100}}) {
    for (const Arguments& run : std::vector<Arguments>{
             {"plugins"},
             {"plugins", "incremental_cholesky"},
             {"plugins", "schur"},
             {"bench", "@ring:poses=40", "--repeat", "1", "--quiet", "--no-memory"},
             {"bench", "@ring:poses=40", "--repeat", "1", "--quiet", "--no-memory", "--optimizer",
              "levenberg_marquardt:initial_lambda=1e-7,dogleg"},
             {"info", "@bundle"},
             {"marginals", "@sphere:turns=2", "--quiet"}}) {
      const Outcome outcome = cairn_on_terminal(run, {}, told);
      EXPECT_EQ(outcome.exit_code, 0);
      for (const std::string& line : lines(outcome.out)) {
        if (line.find(".so") != std::string::npos) continue;  // a path stays whole, to be copied
        EXPECT_LE(columns(line), width) << line;
      }
    }
  }
}

TEST(Usage, PipesNeedNoNameOfAFormat) {
  const std::string cairn_ = program();
  const Outcome outcome =
      run_program({"bash", "-c",
                   cairn_ + " generate ring:poses=50 -o - | " + cairn_ + " optimize - -o - | " +
                       cairn_ + " convert - - | " + cairn_ + " info - --json -"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto report = parse_json(outcome.out);
  EXPECT_EQ(report.at("graph").at("variables").as_int64(), 50);
  EXPECT_EQ(report.at("graph").at("file").as_string(), "-");
  EXPECT_EQ(report.at("graph").at("name").as_string(), "standard input");
  EXPECT_EQ(report.at("format").as_string(), "g2o");
}

TEST(Usage, AnExceptionInAPluginNamesThePluginsPart) {
  const TemporaryFolder folder;
  const std::string solver = bad_plugins() + "/solver_throws/fragile.so";
  const auto with = [&](const std::string& where) {
    return cairn({"optimize", "@ring:poses=30", "--quiet", "--plugin", solver, "--linear-solver",
                  "fragile:in=" + where});
  };
  expect_error(with("construction"), kPlugin, "linear solver 'fragile' failed: the solver broke");
  for (const char* where : {"analyze", "factorize"}) {
    const Outcome outcome = with(where);
    expect_error(outcome, kPlugin, std::string("failed: the solver broke in ") + where);
    EXPECT_THAT(outcome.err, HasSubstr("with linear solver 'fragile:in="));
  }
  expect_error(with("number"), kPlugin, "threw what is not a std::exception");
  expect_error(cairn({"marginals", "@ring:poses=30", "--quiet", "--plugin", solver, "--optimizer",
                      "dogleg:linear_solver=fragile"}),
               kPlugin, "optimizer 'dogleg:linear_solver=fragile' failed: the solver broke");

  // Where estimators, sparsifiers and policies run it, they are named, and what there is is
  // written.
  const std::string estimate = folder.file("estimate.g2o");
  expect_error(cairn({"replay", "@ring:poses=30", "--quiet", "--plugin", solver, "--estimator",
                      "batch:linear_solver=fragile", "-o", estimate}),
               kPlugin, "estimator 'batch:linear_solver=fragile' failed: the solver broke");
  EXPECT_TRUE(std::filesystem::exists(estimate));
  expect_error(
      cairn({"online", "--quiet", "--plugin", solver, "--estimator", "batch:linear_solver=fragile",
             "-o", folder.file("online.g2o")},
            {}, "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n"),
      kPlugin, "estimator 'batch:linear_solver=fragile' failed: the solver broke");
  // The update is undone, and there was none before.
  EXPECT_FALSE(std::filesystem::exists(folder.file("online.g2o")));
  expect_error(cairn({"sparsify", "@ring:poses=30", "--quiet", "--plugin", solver, "--initial",
                      "chordal", "--optimizer", "dogleg:linear_solver=fragile"}),
               kPlugin, "optimizer 'dogleg' failed: the solver broke");

  write_text(folder.file("brittle.g2o"),
             "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n"
             "EDGE_BRITTLE 1 7 1\n");
  const std::string factor = bad_plugins() + "/factor_throws/brittle.so";
  for (const char* command : {"info", "optimize"}) {
    expect_error(cairn({command, folder.file("brittle.g2o"), "--plugin", factor, "--quiet"}),
                 kPlugin, "factor 'EDGE_BRITTLE' failed: the measurement is out of my range");
  }
  for (const char* estimator : {"incremental_cholesky", "incremental_qr", "ekf", "batch"}) {
    expect_error(cairn({"replay", folder.file("brittle.g2o"), "--plugin", factor, "--estimator",
                        estimator, "--quiet"}),
                 kPlugin, "factor 'EDGE_BRITTLE' failed: the measurement is out of my range");
  }
  // A session goes on, as if the line had not come; what its journal has is the same.
  const std::vector<std::string> session{
      "online", "--plugin", factor, "--output", "all", "--journal", folder.file("brittle.log")};
  const Outcome online = cairn(session, {},
                               "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n"
                               "EDGE_SE2 0 1 1.1 0 0 1 0 0 1 0 1\nEDGE_BRITTLE 1 7 1\n"
                               "EDGE_BRITTLE 1 0.9 1\nCHI2\nESTIMATE ALL\n");
  EXPECT_EQ(online.exit_code, 0) << online.err;
  EXPECT_THAT(online.out, HasSubstr("ERROR line 4: factor 'EDGE_BRITTLE' failed: the measurement "
                                    "is out of my range (EDGE_BRITTLE 1)\n"));
  EXPECT_THAT(online.out, HasSubstr("OK 7 variables 2 factors 2 owed 0\n"));
  const Outcome restored = cairn(session, {}, "CHI2\nESTIMATE ALL\n");
  const auto answers = [](const std::string& out) {
    std::string text;  // without the numbers of lines
    const std::size_t begin = out.rfind("CHI2");
    for (const char c : out.substr(begin, out.rfind("OK") - begin)) text += c;
    return text.substr(0, text.find("OK")) + text.substr(text.find("VERTEX"));
  };
  EXPECT_EQ(answers(restored.out), answers(online.out));
  expect_error(cairn({"info", folder.file("brittle.g2o"), "--plugin", factor, "--types",
                      "brittle:sound=false"}),
               kPlugin, "brittle.so: types 'brittle' failed: no types of mine");
  write_text(folder.file("below.g2o"), "VERTEX_SE2 0 0 0 0\nEDGE_BRITTLE 0 -1 1\n");
  expect_error(cairn({"info", folder.file("below.g2o"), "--plugin", factor}), kPlugin,
               "below.g2o:2: EDGE_BRITTLE: its normalize() failed: below my range");
}

TEST(Usage, ANewPluginHasANameOfItsOwn) {
  const TemporaryFolder folder;
  const auto refused = [&](const Arguments& more, int code) {
    Arguments arguments{"new-plugin"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = cairn(arguments);
    EXPECT_EQ(outcome.exit_code, code) << outcome.err;
    return outcome.err;
  };
  EXPECT_THAT(refused({std::string(260, 'x'), "--loss"}, kUsage), HasSubstr("at most 64"));
  EXPECT_THAT(refused({"g2o", "--format", "--folder", folder.file("a")}, kUsage),
              HasSubstr("format 'g2o' is on offer already"));
  EXPECT_EQ(folder.contents().size(), 0U);
}

/// Whatever names the templates use: `Vector` in that of a factor, `Tools` in an estimator's.
TEST(Usage, ANewPluginHasAClassOfItsOwn) {
  const TemporaryFolder folder;
  for (const auto& [name, kind, expected] :
       {std::tuple("vector", "factor", "struct VectorFactor {"),
        {"tools", "estimator", "class ToolsEstimator final"},
        {"laser_range", "factor", "struct LaserRange {"}}) {
    const std::string own = folder.file(std::string(name) + kind);
    const Outcome made = cairn({"new-plugin", name, std::string("--") + kind, "--folder", own});
    ASSERT_EQ(made.exit_code, 0) << made.err;
    EXPECT_THAT(read_text(own + "/" + name + ".cpp"), HasSubstr(expected));
  }
}

TEST(Usage, ANewPluginOfACairnInItsBuildFolderSaysToInstallThatFirst) {
  const TemporaryFolder folder;
  const std::string own = folder.file("mine");
  const Outcome made = cairn({"new-plugin", "mine", "--loss", "--folder", own});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const std::string install = "\nNext:\n  cmake --install ";
  const std::size_t next = made.out.find(install);
  ASSERT_NE(next, std::string::npos) << made.out;
  EXPECT_THAT(made.out.substr(next),
              AllOf(HasSubstr(" --prefix $HOME/cairn  # "), HasSubstr("\n  cd " + own + "\n"),
                    HasSubstr("-DCMAKE_PREFIX_PATH=$HOME/cairn && cmake --build build\n")));
  const std::size_t begin = next + install.size();
  const std::string build = made.out.substr(begin, made.out.find(" --prefix ") - begin);
  EXPECT_TRUE(std::filesystem::exists(build + "/CMakeCache.txt")) << build;
}

TEST(Usage, IntegersAreDecimalAndInRange) {
  for (const char* seed : {"-1", "18446744073709551616", "1.5", "0x10", ""}) {
    expect_error(
        cairn({"generate", "ring:poses=9", "-o", "/dev/null", "--to", "g2o", "--seed", seed}),
        kUsage, "is not an integer from 0 to 1000000000000000");
  }
  expect_error(cairn({"compact", "@ring:poses=9", "--begin", "99999999999999999999"}), kUsage,
               "is not an integer from -9223372036854775808");
  const Outcome zero = cairn({"optimize", "@ring:poses=9", "--tolerance", "0", "--iterations",
                              "010", "--json", "-", "--quiet"});
  EXPECT_EQ(parse_json(zero.out).at("iterations").as_array().size(), 10);
}

TEST(Usage, AStaticConstructorOrDestructorOfAPluginHurtsNobody) {
  const TemporaryFolder folder;
  const Arguments arguments{"optimize", "@ring:poses=30",
                            "--loss",   "eager",
                            "--plugin", bad_plugins() + "/static_constructor/eager.so",
                            "-o",       folder.file("best.g2o")};
  expect_error(cairn(arguments, {{"CAIRN_TEST_CONSTRUCTOR", "throws"}}), kPlugin, "eager.so");
  EXPECT_TRUE(folder.contents().empty());
#if !defined(CAIRN_SANITIZED) && !defined(CAIRN_COVERAGE)  // where static destructors do run
  const Outcome outcome = cairn(arguments, {{"CAIRN_TEST_CONSTRUCTOR", "crashes at the end"}});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(folder.contents(), (std::vector<std::string>{"best.g2o"}));
#endif
}

TEST(Usage, AToleranceThatNoSolverCanMeetIsRefused) {
  expect_error(cairn({"optimize", "@ring:poses=9", "--linear-solver", "pcg:tolerance=1"}), kUsage,
               "option 'tolerance' is '1'");
}

TEST(Usage, NumbersAreDecimalFiniteAndNotTooSmall) {
  for (const char* number : {"1e-400", "1e400", "inf", "nan", "0x1p-3", " 1", "1 ", "0,1", "++1"}) {
    expect_error(cairn({"optimize", "@ring:poses=9", "--tolerance", number}), kUsage,
                 "is not a number from 0 to 1");
  }
  for (const char* number : {"inf", "1e400", "0x10", " 5", "0"})
    expect_error(cairn({"explore", "@rooms", "--until", std::string("distance=") + number}), kUsage,
                 "is no number above zero");
  for (const char* number : {"0.001", "+1e-3", ".001", "1E-3"}) {
    EXPECT_EQ(cairn({"optimize", "@ring:poses=9", "--tolerance", number}).exit_code, 0) << number;
  }
}

TEST(Usage, MessagesCutWordsThatAreNoNames) {
  const TemporaryFolder folder;
  write_text(folder.file("brackets"), std::string(900000, '['));
  const std::string name(100000, 'x');
  for (const Arguments& arguments :
       {Arguments{"info", "@ring:poses=9", "--config", folder.file("brackets")},
        Arguments{"optimize", "@ring:poses=9", "--optimizer", name},
        Arguments{"optimize", "@ring:poses=9", "--" + name}}) {
    const Outcome outcome = cairn(arguments);
    EXPECT_NE(outcome.exit_code, 0);
    EXPECT_LT(outcome.err.size(), 2000U);
    EXPECT_THAT(outcome.err, HasSubstr("..."));
  }
}

TEST(Usage, APluginThatEndsTheProgramIsAnError) {
  const TemporaryFolder folder;
  const std::string solver = bad_plugins() + "/solver_throws/fragile.so";
  expect_error(
      cairn({"optimize", "@ring:poses=30", "--quiet", "--plugin", solver, "--linear-solver",
             "fragile:in=exit", "-o", folder.file("best.g2o"), "--record", folder.file("run")}),
      kPlugin, "a plugin, or a library below it, has ended the program");
  EXPECT_TRUE(folder.contents().empty());
}

TEST(Usage, MessagesOfLibrariesNameTheOptionsOfTheProgram) {
  const TemporaryFolder folder;
  write_text(folder.file("odd.g2o"), "VERTEX_SE2 0 0 0 0\nEDGE_ODD 0 1\n");
  const Outcome outcome = cairn({"info", folder.file("odd.g2o")});
  expect_error(outcome, kInput, "--skip-unknown leaves such lines out");
  EXPECT_THAT(outcome.err, Not(HasSubstr("ReadOptions")));
}

TEST(Usage, AnOptionOfTheCommandThatIsGivenToAComponentIsPointedTo) {
  CAIRN_NEEDS("optimizer", "gauss_newton");
  const auto error = [](const Arguments& arguments) { return cairn(arguments).err; };
  EXPECT_THAT(error({"optimize", "@ring", "--optimizer", "gauss_newton:iterations=5"}),
              HasSubstr("gauss_newton has no option 'iterations', but cairn optimize has "
                        "--iterations; "));
  EXPECT_THAT(error({"optimize", "@ring", "--optimizer", "gauss_newton:colour=5"}),
              Not(HasSubstr("cairn optimize has")));
  if (Registry().has("initial_guess", "as_given")) {
    EXPECT_THAT(error({"optimize", "@ring", "--initial", "as_given:linear_solver=eigen"}),
                HasSubstr("as_given takes no options, but 'linear_solver' was given; cairn "
                          "optimize has --linear-solver\n"));
  }
}

TEST(Usage, ProgressIsOneLineOnATerminalAndPlainLinesElsewhere) {
  const Arguments run{"optimize", "@ring:poses=60", "--initial", "as_given", "--iterations",
                      "4",        "--tolerance",    "0"};
  EXPECT_THAT(cairn_on_terminal(run, {{"TERM", "xterm"}}).out, HasSubstr("\r[#"));
  const std::string err = cairn(run).err;
  EXPECT_THAT(err, HasSubstr("iteration   4  chi2 "));
  EXPECT_THAT(err, Not(HasSubstr("\r")));
  EXPECT_EQ(lines(err).size(), 5u) << err;  // the start, and four iterations
}

}  // namespace
}  // namespace cairn::test
