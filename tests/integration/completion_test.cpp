// SPDX-License-Identifier: BSD-3-Clause
// cairn complete, and the shells that ask it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "integration/process.hpp"

namespace cairn::test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;
using Words = std::vector<std::string>;

/// What may come next. The word "" says that files may.
Words completions(Arguments words) {
  words.insert(words.begin(), {"complete", "--"});
  const Outcome outcome = cairn(words);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  Words found;
  for (const std::string& line : lines(outcome.out))
    found.push_back(line.substr(0, line.find('\t')));
  return found;
}

/// By kind, what is on offer.
std::map<std::string, std::set<std::string>> offers() {
  std::map<std::string, std::set<std::string>> all;
  const auto report = report_of({"plugins"});
  for (const auto& offer : report.at("offers").as_array())
    all[offer.at("kind").as_string().c_str()].insert(offer.at("name").as_string().c_str());
  return all;
}

std::set<std::string> as_set(const Words& words) { return {words.begin(), words.end()}; }

TEST(Completion, KnowsCommandsAndTheirOptions) {
  EXPECT_THAT(completions({""}), AllOf(Contains("optimize"), Contains("help"), Not(Contains(""))));
  EXPECT_THAT(completions({"opt"}), ElementsAre("optimize"));
  EXPECT_THAT(completions({"study", "prob"}), ElementsAre("problems"));
  EXPECT_THAT(completions({"help", "bench"}), ElementsAre("bench"));
  EXPECT_THAT(completions({"optimize", "--lin"}), ElementsAre("--linear-solver"));
  EXPECT_THAT(completions({"optimize", "x.g2o", "--iterations", "3", "--thr"}),
              ElementsAre("--threads"));
  EXPECT_THAT(completions({"--quiet", "--threads", "2", "optimize", "--lin"}),
              ElementsAre("--linear-solver"));
  EXPECT_THAT(completions({"info", "--iter"}), IsEmpty());
  EXPECT_THAT(completions({"frobnicate", "--js"}), ElementsAre("--json"));
}

TEST(Completion, KnowsWhatAValueMayBe) {
  EXPECT_THAT(completions({"optimize", "--covariance", ""}), ElementsAre("blocks", "none"));
  EXPECT_THAT(completions({"optimize", "--covariance=n"}), ElementsAre("--covariance=none"));
  EXPECT_THAT(completions({"optimize", "--iterations", ""}), IsEmpty());
  EXPECT_THAT(completions({"optimize", "--json", ""}), ElementsAre(""));
  EXPECT_THAT(completions({"optimize", ""}), ElementsAre(""));
  EXPECT_THAT(completions({"optimize", "x.g2o", ""}), IsEmpty());  // it takes one graph
  EXPECT_THAT(completions({"bench", "x.g2o", ""}), ElementsAre(""));
  EXPECT_THAT(completions({"optimize", "--", "--linear"}), ElementsAre(""));  // a file's name
}

TEST(Completion, NamesTheComponentsThatAreOnOffer) {
  auto on_offer = offers();
  EXPECT_EQ(as_set(completions({"optimize", "--linear-solver", ""})), on_offer["linear_solver"]);
  EXPECT_EQ(as_set(completions({"optimize", "--initial", ""})), on_offer["initial_guess"]);
  EXPECT_EQ(as_set(completions({"convert", "a", "b", "--to", ""})), on_offer["format"]);
  std::set<std::string> makes = on_offer["generator"];
  makes.insert(on_offer["floor_plan"].begin(), on_offer["floor_plan"].end());
  EXPECT_EQ(as_set(completions({"generate", ""})), makes);
  for (const std::string& name : completions({"info", "@"}))
    EXPECT_TRUE(on_offer["generator"].contains(name.substr(1))) << name;
  EXPECT_EQ(completions({"info", "@"}).size(), on_offer["generator"].size());
  const std::string first = *on_offer["linear_solver"].begin();
  EXPECT_EQ(completions({"bench", "x", "--linear-solver", first + ","}).size(),
            on_offer["linear_solver"].size());
  EXPECT_THAT(completions({"optimize", "--linear-solver", first + ","}), IsEmpty());
}

/// The name of the component that a manual page gives as an option's default.
std::string default_of(const std::string& option, const std::string& page) {
  const std::string roff = std::regex_replace(option, std::regex("-"), "\\-");
  std::string item = page.substr(page.find("\\fB" + roff + "\\fR"));
  item.resize(std::min(item.size(), item.find("\n.TP")));
  std::smatch found;
  return std::regex_search(item, found, std::regex(R"(Default: \\fB([a-z0-9_]+))")) ? found[1].str()
                                                                                    : "";
}

/// Every option of every command whose value is a NAME: those of exactly one kind, its default
/// among them.
TEST(Completion, KnowsTheKindOfEveryOption) {
  const auto on_offer = offers();
  const std::regex kOption("^  (?:-[a-z], )?(--[-a-z]+) NAMES? .*$");
  int checked = 0, with_default = 0;
  Words commands = completions({""});
  for (const std::string& inner : completions({"study", ""})) commands.push_back("study " + inner);
  for (const std::string& command : commands) {
    Arguments words;
    for (std::size_t k = 0; k <= command.size();) {
      const std::size_t blank = std::min(command.find(' ', k), command.size());
      words.push_back(command.substr(k, blank - k));
      k = blank + 1;
    }
    Arguments help = words;
    help.insert(help.begin(), "help");
    Arguments manual = help;
    manual.emplace_back("--man");
    const std::string page = cairn(manual).out;
    for (const std::string& line : lines(cairn(help).out)) {
      std::smatch found;
      if (!std::regex_match(line, found, kOption) || found[1] == "--strategy") continue;
      SCOPED_TRACE(command + " " + found[1].str());
      Arguments typed = words;
      typed.insert(typed.end(), {found[1].str(), ""});
      const std::set<std::string> names = as_set(completions(typed));
      EXPECT_TRUE(
          std::ranges::any_of(on_offer, [&](const auto& kind) { return kind.second == names; }) ||
          names.empty());
      const std::string standard = default_of(found[1].str(), page);
      const bool known = std::ranges::any_of(
          on_offer, [&](const auto& kind) { return kind.second.contains(standard); });
      EXPECT_TRUE(names.contains(standard) || !known) << standard;
      with_default += known ? 1 : 0;
      ++checked;
    }
  }
  EXPECT_GE(checked, 30);
  EXPECT_TRUE(with_default >= 10 || on_offer.at("linear_solver").empty());
}

TEST(Completion, KnowsTheOptionsOfAComponent) {
  int values = 0;
  const auto on_offer = offers();
  for (const std::string& name : on_offer.at("linear_solver")) {
    SCOPED_TRACE(name);
    const auto report = report_of({"plugins", name});
    std::set<std::string> expected;
    for (const auto& offer : report.at("offers").as_array()) {
      if (offer.at("kind").as_string() != "linear_solver") continue;
      for (const auto& option : offer.at("options").as_array()) {
        const std::string key = name + ":" + option.at("name").as_string().c_str() + "=";
        expected.insert(key);
        if (option.at("type").as_string() == "boolean") {
          EXPECT_THAT(completions({"optimize", "--linear-solver", key}),
                      ElementsAre(key + "true", key + "false"));
          ++values;
        }
        if (option.at("type").as_string() == "choice") {
          EXPECT_THAT(completions({"optimize", "--linear-solver", key}), Each(StartsWith(key)));
          EXPECT_THAT(completions({"optimize", "--linear-solver", key}), Not(IsEmpty()));
          ++values;
        }
      }
    }
    EXPECT_EQ(as_set(completions({"optimize", "--linear-solver", name + ":"})), expected);
  }
  EXPECT_GE(values, on_offer.at("linear_solver").contains("block_cholesky") ? 1 : 0);
}

/// What bash puts in place of the last word of the line.
Words in_bash(const std::string& line) {
  const std::filesystem::path script =
      std::filesystem::path(source_folder()) / "apps/cairn/completion/cairn.bash";
  const Outcome outcome = run_program({"bash", "-c",
                                       "set -u; source " + script.string() +
                                           "\nCOMP_LINE=$1 COMP_POINT=${#1}\n_cairn \"$2\"\nprintf "
                                           "'%s\\n' ${COMPREPLY[@]+\"${COMPREPLY[@]}\"}",
                                       "bash", line, program()});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  return lines(outcome.out);
}

TEST(Completion, IsWhatBashShows) {
  EXPECT_THAT(in_bash("cairn opti"), ElementsAre("optimize"));
  EXPECT_THAT(in_bash("cairn optimize x.g2o --covariance "), ElementsAre("blocks", "none"));
  // = : and @ end words of bash, which replaces what stands after them.
  EXPECT_THAT(in_bash("cairn optimize --covariance=b"), ElementsAre("blocks"));
  const auto on_offer = offers();
  for (const std::string& name : on_offer.at("generator"))
    EXPECT_THAT(in_bash("cairn info @" + name), Contains(name));
  const TemporaryFolder folder;
  write_text(folder.file("a graph.g2o"), "");
  EXPECT_THAT(in_bash("cairn optimize " + folder.file("a")),
              ElementsAre(folder.file("a graph.g2o")));
}

TEST(Completion, ScriptsAreShellsOwnLanguage) {
  const std::string folder = source_folder() + "/apps/cairn/completion/";
  const Outcome bash = run_program({"bash", "-n", folder + "cairn.bash"});
  EXPECT_EQ(bash.exit_code, 0) << bash.err;
  if (run_program({"zsh", "--version"}).exit_code != 0) GTEST_SKIP() << "without zsh";
  const Outcome zsh = run_program({"zsh", "-n", folder + "_cairn"});
  EXPECT_EQ(zsh.exit_code, 0) << zsh.err;
}

}  // namespace
}  // namespace cairn::test
