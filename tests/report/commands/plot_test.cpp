// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <set>

#include "integration/process.hpp"
#include "support/plots.hpp"

namespace cairn::test {
namespace {

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class PlotCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!draws_plots()) GTEST_SKIP() << "nothing draws plots";
    run({"generate", "manhattan:poses=120,outliers=1", "-o", graph_, "--seed", "4"});
  }
  static void run(const Arguments& arguments) {
    const Outcome outcome = cairn(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  }
  std::string plot(Arguments arguments, const std::string& ending) {
    const std::string file = folder_.file("picture." + ending);
    arguments.insert(arguments.begin(), "plot");
    arguments.insert(arguments.end(), {"-o", file});
    run(arguments);
    return read_text(file);
  }
  TemporaryFolder folder_;
  std::string graph_ = folder_.file("city.g2o"), report_ = folder_.file("run.json");
};

TEST_F(PlotCommand, TheEndingChoosesTheFormat) {
  EXPECT_THAT(plot({graph_}, "svg"), StartsWith("<?xml"));
  EXPECT_THAT(plot({graph_}, "PNG"), StartsWith("\x89PNG"));
  EXPECT_THAT(plot({graph_}, "pdf"), StartsWith("%PDF-"));
  const Outcome other = cairn({"plot", graph_, "-o", folder_.file("picture.gif")});
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr(".svg"));
}

TEST_F(PlotCommand, DrawsEveryKind) {
  run({"optimize", graph_, "--json", report_, "--quiet"});
  const std::string bench = folder_.file("bench.json");
  run({"bench", graph_, "--linear-solver", "block_cholesky,eigen", "--repeat", "2", "--no-memory",
       "--quiet", "--json", bench});
  std::set<std::string> pictures;
  for (const Arguments& arguments :
       {Arguments{graph_}, Arguments{graph_, "--colour", "residual"}, Arguments{bench},
        Arguments{bench, "--what", "scaling"}, Arguments{graph_, "--what", "sparsity"},
        Arguments{report_, "--what", "convergence"},
        Arguments{report_, "--what", "convergence", "--x", "time"},
        Arguments{report_, "--what", "steps"}, Arguments{graph_, "--theme", "dark"}}) {
    pictures.insert(plot(arguments, "svg"));
  }
  EXPECT_EQ(pictures.size(), 9U) << "each is another picture";
}

std::int64_t count(const std::string& text, const std::string& part) {
  std::int64_t found = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
    ++found;
  return found;
}

/// The part of an SVG with that id, such as "poses"; empty where there is none.
std::string part(const std::string& picture, const std::string& id) {
  const std::size_t begin = picture.find("<g id=\"" + id + "\">");
  return begin == std::string::npos ? std::string()
                                    : picture.substr(begin, picture.find("</g>", begin) - begin);
}

/// Lines that a part of a picture has.
std::int64_t lines(const std::string& picture, const std::string& id) {
  return count(part(picture, id), "M ");
}

TEST_F(PlotCommand, MarksEachPose) {
  EXPECT_EQ(part(plot({graph_}, "svg"), "poses"), "");
  EXPECT_EQ(count(part(plot({graph_, "--poses"}, "svg"), "poses"), "<use "), 120);
}

TEST_F(PlotCommand, DrawsCovariancesAsEllipses) {
  const std::string best = folder_.file("best.g2o");
  run({"optimize", graph_, "--covariance", "blocks", "-o", best, "--json", report_, "--quiet"});
  // The pose that is anchored has no covariance.
  EXPECT_EQ(lines(plot({graph_, report_, "--ellipses", "3"}, "svg"), "covariances"), 119);
  EXPECT_EQ(lines(plot({best, report_, "--ellipses", "3"}, "svg"), "covariances"), 119);
  const Outcome none = cairn({"plot", graph_, "--ellipses", "3", "-o", folder_.file("x.svg")});
  EXPECT_EQ(none.exit_code, 3);
  EXPECT_THAT(none.err, HasSubstr("--covariance blocks"));
}

TEST_F(PlotCommand, TheOutputOfARunFromStandardInputHasItsCovariances) {
  const std::string best = folder_.file("best.g2o");
  const Outcome optimized =
      cairn({"optimize", "-", "--covariance", "blocks", "-o", best, "--json", report_, "--quiet"},
            {}, read_text(graph_));
  EXPECT_EQ(optimized.exit_code, 0) << optimized.err;
  EXPECT_EQ(lines(plot({report_, "--ellipses", "3"}, "svg"), "covariances"), 119);
  EXPECT_EQ(cairn({"plot", report_, "-o", folder_.file("curves.svg")}).err, "");
}

TEST_F(PlotCommand, GraphsWithTheSamePosesAreDrawnBesideEachOther) {
  const std::string best = folder_.file("best.g2o");
  run({"optimize", graph_, "-o", best, "--quiet"});
  const std::string over = plot({graph_, best}, "svg");
  EXPECT_NE(part(over, "initial"), "");
  EXPECT_NE(part(over, "estimate"), "");
  EXPECT_EQ(part(over, "estimate-2"), "");
  const std::string beside = plot({graph_, best, "--apart"}, "svg");
  EXPECT_EQ(part(beside, "initial"), "");
  EXPECT_NE(part(beside, "estimate-2"), "");
  const Outcome titled = cairn({"plot", graph_, best, "--apart", "--title", "both"});
  EXPECT_EQ(titled.exit_code, 2);
  EXPECT_THAT(titled.err, HasSubstr("--apart each has the name of its file, or one by --name"));
  plot({graph_, "--apart", "--title", "alone"}, "svg");
}

TEST_F(PlotCommand, TheTruthIsDrawnOverTheEstimateThinAndDashed) {
  const std::string best = folder_.file("best.g2o"), truth = folder_.file("truth.g2o");
  run({"generate", "manhattan:poses=120", "-o", graph_, "--ground-truth", truth, "--seed", "4"});
  run({"optimize", graph_, "-o", best, "--quiet"});
  const std::string dashes = "stroke-dasharray: 4.5,3";  // 6 and 4 pixels
  for (const Arguments& files : {Arguments{best}, Arguments{graph_, best}}) {
    Arguments arguments = files;
    arguments.insert(arguments.end(), {"--truth", truth});
    const std::string picture = plot(arguments, "svg");
    EXPECT_THAT(part(picture, "truth"), HasSubstr(dashes));
    EXPECT_THAT(part(picture, "truth"), HasSubstr("#1a1d21"));
    EXPECT_THAT(part(picture, "estimate"),
                AllOf(HasSubstr("#0072b2"), Not(HasSubstr("dasharray"))));
    EXPECT_LT(picture.find("\"estimate\""), picture.find("\"truth\""));
  }
  // The residuals and loop closures are those of the estimate all the same.
  const std::string coloured = plot({best, "--truth", truth, "--colour", "residual"}, "svg");
  EXPECT_THAT(part(coloured, "largest-residual"), HasSubstr("#5c0a12"));
  EXPECT_THAT(part(coloured, "truth"), HasSubstr(dashes));
  EXPECT_EQ(part(coloured, "estimate"), "");
}

TEST_F(PlotCommand, TheWrongLoopClosureIsTheOneInTheWorstColour) {
  const std::string best = folder_.file("best.g2o");
  run({"optimize", graph_, "--initial", "odometry", "--loss", "cauchy", "--loss-on", "loops", "-o",
       best, "--quiet"});
  const std::string picture = plot({best, "--colour", "residual"}, "svg");
  EXPECT_EQ(lines(picture, "largest-residual"), 1);
  EXPECT_GT(lines(picture, "residuals"), 1);
}

TEST_F(PlotCommand, TheSparsityOfLIsThatOfTheChosenOrder) {
  const auto blocks = [&](const std::string& solver) {
    const auto numbers =
        parse_json(plot({graph_, "--what", "sparsity", "--linear-solver", solver}, "json"));
    return numbers.at("sparsity").at("L").at("blocks").as_int64();
  };
  EXPECT_LT(blocks("block_cholesky"), blocks("block_cholesky:ordering=natural"));
  const std::string picture = plot({graph_, "--what", "sparsity"}, "svg");
  EXPECT_THAT(picture, HasSubstr("<!-- L, ordering amd -->"));
  EXPECT_GT(lines(picture, "blocks-2"), 100);
  const Outcome silent = cairn({"plot", graph_, "--what", "sparsity", "--linear-solver", "eigen",
                                "-o", folder_.file("x.svg")});
  EXPECT_EQ(silent.exit_code, 2);
  EXPECT_THAT(silent.err, HasSubstr("block_cholesky"));
}

TEST_F(PlotCommand, TheSizeIsTheOneAskedFor) {
  const std::string picture = plot({graph_, "--size", "320x200"}, "png");
  // Width and height stand big-endian in the header chunk of a PNG.
  EXPECT_EQ(picture.substr(16, 8), std::string("\0\0\x01\x40\0\0\0\xc8", 8));
  for (const char* size : {"320", "0x5", "ax5", "-3x4", "99999999x9"}) {
    EXPECT_EQ(cairn({"plot", graph_, "--size", size, "-o", folder_.file("x.png")}).exit_code, 2)
        << size;
  }
}

TEST_F(PlotCommand, WithoutANameThePictureIsCalledAsTheFirstFile) {
  const auto in_folder = [&](const std::string& words) {
    return run_program(
        {"bash", "-c", "cd '" + folder_.path().string() + "' && " + program() + " plot " + words});
  };
  const Outcome first = in_folder("city.g2o");
  EXPECT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.out, StartsWith("city.svg: "));
  const std::string picture = read_text(folder_.file("city.svg"));
  EXPECT_THAT(picture, StartsWith("<?xml"));
  write_text(folder_.file("city.svg"), "somebody's own");
  const Outcome second = in_folder("city.g2o --theme dark");
  EXPECT_EQ(second.exit_code, 2);
  EXPECT_THAT(second.err, HasSubstr("city.svg is there already; name it, or another, with -o"));
  EXPECT_EQ(read_text(folder_.file("city.svg")), "somebody's own");
}

TEST_F(PlotCommand, SizesAreInUnitsThatFit) {
  const std::string file = folder_.file("small.png");
  const Outcome outcome = cairn({"plot", graph_, "-o", file});
  EXPECT_THAT(outcome.out, ContainsRegex("[1-9][0-9]*\\.[0-9] KiB"));
}

TEST_F(PlotCommand, AComparisonShowsNamesAndLabelsNotPaths) {
  const std::string bench = folder_.file("bench.json");
  run({"bench", graph_, "--linear-solver", "block_cholesky,eigen", "--repeat", "2", "--no-memory",
       "--quiet", "--name", "city", "--json", bench});
  const std::string text = read_text(bench);
  const auto with = [&](const std::string& old, const std::string& other) {
    std::string changed = text;
    std::size_t at = 0;
    int count = 0;
    for (; (at = changed.find(old, at)) != std::string::npos; at += other.size(), ++count)
      changed.replace(at, old.size(), other);
    EXPECT_GT(count, 0) << old;
    write_text(bench, changed);
  };
  for (const std::string what : {"bars", "scaling", "convergence"}) {
    write_text(bench, text);
    const std::string picture = plot({bench, "--what", what}, "svg");
    with(graph_, folder_.file("elsewhere/" + std::string(60, 'x')));
    EXPECT_EQ(plot({bench, "--what", what}, "svg"), picture) << what;
    with("levenberg_marquardt", "dogleg");
    EXPECT_EQ(plot({bench, "--what", what}, "svg"), picture) << what;
    with("\"eigen\"", "\"other\"");
    EXPECT_NE(plot({bench, "--what", what}, "svg"), picture) << what;
  }
}

TEST_F(PlotCommand, GrowthOfMemoryIsDrawnWhereItWasMeasured) {
  const std::string bench = folder_.file("scaling.json");
  const Arguments with = {"bench", graph_, "--repeat", "1", "--json", bench, "--quiet"};
  Arguments without = with;
  without.emplace_back("--no-memory");
  const std::string memory = "<!-- peak memory [MiB] -->", time = "<!-- time [s] -->";
  ASSERT_EQ(cairn(with).exit_code, 0);
  EXPECT_THAT(plot({bench, "--what", "scaling"}, "svg"), AllOf(HasSubstr(time), HasSubstr(memory)));
  ASSERT_EQ(cairn(without).exit_code, 0);
  EXPECT_THAT(plot({bench, "--what", "scaling"}, "svg"),
              AllOf(HasSubstr(time), Not(HasSubstr(memory))));
}

TEST_F(PlotCommand, WithoutPythonOrItsModulesItIsSaidWhatToInstall) {
  const std::string file = folder_.file("x.svg"), other = folder_.file("python");
  const auto refused = [&](const std::string& interpreter) {
    const Outcome outcome = cairn({"plot", graph_, "-o", file}, {{"CAIRN_PYTHON", interpreter}});
    EXPECT_EQ(outcome.exit_code, 5);
    EXPECT_FALSE(std::filesystem::exists(file));
    EXPECT_THAT(unfolded(outcome.err), HasSubstr("apt install python3-matplotlib python3-cairn"));
    return unfolded(outcome.err);
  };
  EXPECT_THAT(refused(other), HasSubstr(other + " is not there"));
  const auto write_program = [&](const std::string& script) {
    write_text(other, "#!/bin/sh\n" + script);
    std::filesystem::permissions(other, std::filesystem::perms::owner_all);
  };
  write_program("printf matplotlib\n");
  EXPECT_THAT(refused(other), HasSubstr(other + " has no module matplotlib;"));
  write_program("echo one >&2; echo two >&2; exit 3\n");
  EXPECT_THAT(refused(other), HasSubstr(other + " ends with code 3: two;"));
  write_program("kill -9 $$\n");
  EXPECT_THAT(refused(other), HasSubstr(other + " was ended by signal 9"));
  // All modules are there, and what is run fails.
  write_program("case \"$2\" in *find_spec*) ;; *) echo broken >&2; exit 1 ;; esac\n");
  EXPECT_THAT(refused(other), HasSubstr(other + " ends with code 1: broken;"));
  const Outcome replay =
      cairn({"replay", graph_, "--plot", file}, {{"CAIRN_PYTHON", folder_.file("none")}});
  EXPECT_EQ(replay.exit_code, 5);
  EXPECT_THAT(replay.out, Not(HasSubstr("chi2"))) << "it is found out before the work";
}

TEST_F(PlotCommand, FilesOfTheFolderItRunsInAreNoModules) {
  for (const char* name : {"json.py", "numpy.py", "matplotlib.py", "cairn.py", "runpy.py"})
    write_text(folder_.file(name), "raise SystemExit('not this one')\n");
  const Outcome outcome = run_program(
      {"bash", "-c",
       "cd '" + folder_.path().string() + "' && " + program() + " plot city.g2o -o x.svg"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
}

TEST_F(PlotCommand, AnyNameCanBeDrawn) {
  const std::string name = folder_.file("<script>\xff\n\x01.g2o");
  std::filesystem::copy_file(graph_, name);
  EXPECT_THAT(plot({name}, "svg"), Not(HasSubstr("<script")));
}

TEST_F(PlotCommand, DrawsColumnsOfCsv) {
  const std::string csv = folder_.file("steps.csv");
  write_text(csv, "step,seconds,seconds_all,name\n1,0.1,0.2,a\n2,0.01,0.4,b\n3,,0.8,c\n");
  const std::string one = plot({csv}, "svg");
  const std::string two = plot({csv, "--y", "seconds", "--y", "*all"}, "svg");
  const std::string logarithmic = plot({csv, "--log", "y"}, "svg");
  EXPECT_NE(one, two);
  EXPECT_NE(one, logarithmic);
  EXPECT_EQ(plot({csv, "--what", "columns", "--x", "step", "--y", "seconds*"}, "svg"), one)
      << "the first column is the horizontal axis, and a column without numbers is not drawn";
  EXPECT_NE(plot({csv, "--y", "seconds_all", "--x-max", "2"}, "svg"),
            plot({csv, "--y", "seconds_all"}, "svg"));
  const std::string other = folder_.file("other.csv");
  write_text(other, "step,seconds\n1,5\n");
  EXPECT_NE(plot({csv, other, "--y", "seconds"}, "svg"), plot({csv, "--y", "seconds"}, "svg"));
  // Columns of two methods, one in each file: what they are called is that of the method's file.
  write_text(csv, "step,map error a:x=1\n1,0.1\n2,0.2\n");
  write_text(other, "step,map error b\n1,0.3\n2,0.1\n");
  const std::string both = plot({csv, other, "--y", "map error *", "--name", "first"}, "svg");
  write_text(csv, "step,map error c\n1,0.1\n2,0.2\n");
  EXPECT_EQ(plot({csv, other, "--y", "map error *", "--name", "first"}, "svg"), both);
}

TEST_F(PlotCommand, SaysWhichColumnsThereAre) {
  const std::string csv = folder_.file("steps.csv");
  write_text(csv, "step,seconds\n1,2\n");
  const auto refused = [&](Arguments arguments, int code) {
    arguments.insert(arguments.begin(), "plot");
    arguments.insert(arguments.end(), {"-o", folder_.file("x.svg")});
    const Outcome outcome = cairn(arguments);
    EXPECT_EQ(outcome.exit_code, code) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(folder_.file("x.svg")));
    return outcome.err;
  };
  EXPECT_THAT(refused({csv, "--x", "time"}, 2), HasSubstr("it has step, seconds"));
  EXPECT_THAT(refused({csv, "--y", "chi2"}, 2), HasSubstr("matches 'chi2'"));
  EXPECT_THAT(refused({graph_, "--x", "step"}, 2), HasSubstr("iterations or time"));
  EXPECT_THAT(refused({graph_, "--y", "step"}, 2), HasSubstr("CSV"));
  EXPECT_THAT(refused({graph_, "--what", "columns"}, 3), HasSubstr("--steps"));
  EXPECT_THAT(refused({csv, "--x-max", "0"}, 3), HasSubstr("no point can be drawn"));
  write_text(csv, "step,seconds\n0,1\n1,-2\n");
  EXPECT_THAT(refused({csv, "--log", "xy"}, 3), HasSubstr("positive"));
  write_text(csv, "step,seconds\n1,2,3\n");
  EXPECT_THAT(refused({csv}, 3), HasSubstr("steps.csv:2: expected 2 fields"));
  write_text(csv, "step,seconds\n1,2\n");
  const Outcome page = cairn({"view", csv, "-o", folder_.file("x.html")});
  EXPECT_EQ(page.exit_code, 3);
  EXPECT_THAT(page.err, HasSubstr("cairn plot"));
}

TEST_F(PlotCommand, ColumnsOfTextAreLeftOut) {
  const std::string csv = folder_.file("runs.csv"), plot = folder_.file("runs.svg");
  write_text(csv, "explorer,seed,coverage,end\nfrontier,1,20,finished\nrandom,2,30,limit\n");
  const Outcome outcome = cairn({"plot", csv, "-o", plot});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(unfolded(outcome.err), HasSubstr("no numbers, explorer, end; --x COLUMN"));
  const std::string numbers = folder_.file("numbers.csv"), same = folder_.file("numbers.svg");
  write_text(numbers, "seed,coverage\n1,20\n2,30\n");
  ASSERT_EQ(cairn({"plot", numbers, "-o", same}).exit_code, 0);
  EXPECT_EQ(read_text(plot), read_text(same));
}

TEST_F(PlotCommand, WhatHasNoGraphIsRefusedWithWhatWouldWork) {
  const std::string report = folder_.file("run.json"), floor = folder_.file("floor.yaml");
  write_text(report, R"({"cairn":"0","command":"explore","steps":[]})");
  write_text(floor, "image: floor.png\nresolution: 0.1\n");
  for (const char* command : {"plot", "view"}) {
    const std::string page = folder_.file(std::string("x.") + (*command == 'p' ? "svg" : "html"));
    const Outcome of_json = cairn({command, report, "-o", page});
    EXPECT_EQ(of_json.exit_code, 3);
    EXPECT_THAT(unfolded(of_json.err), HasSubstr("--record FILE.jsonl"));
    const Outcome of_floor = cairn({command, floor, "-o", page});
    EXPECT_EQ(of_floor.exit_code, 3);
    EXPECT_THAT(unfolded(of_floor.err), HasSubstr("is the map of a floor"));
  }
  EXPECT_THAT(cairn({"view", "--help"}).out, Not(HasSubstr("CSV")));
}

TEST_F(PlotCommand, SaysWhatIsMissing) {
  const Outcome outcome = cairn({"plot", graph_, "--what", "bars", "-o", folder_.file("x.svg")});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("the JSON that cairn bench --json writes"));
  const std::string csv = folder_.file("bench.csv");
  write_text(csv, "graph,seconds\nsphere,1\n");
  for (const std::string what : {"bars", "scaling", "steps"}) {
    const Outcome of_csv = cairn({"plot", csv, "--what", what, "-o", folder_.file("x.svg")});
    EXPECT_EQ(of_csv.exit_code, 3) << what;
    EXPECT_THAT(unfolded(of_csv.err), HasSubstr("of a CSV file columns are drawn")) << what;
  }
}

}  // namespace
}  // namespace cairn::test
