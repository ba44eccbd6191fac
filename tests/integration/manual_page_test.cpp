// SPDX-License-Identifier: BSD-3-Clause
// cairn help --man and --man-pages: the manual has what the help has, and man reads it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "integration/process.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;

/// First words of the indented lines below "Commands:".
std::vector<std::string> commands_of(const std::string& help) {
  std::vector<std::string> commands;
  bool below = false;
  for (const std::string& line : lines(help)) {
    if (line == "Commands:") {
      below = true;
    } else if (line.empty()) {
      below = false;
    } else if (below && line.size() > 2 && line[2] != ' ') {
      commands.push_back(line.substr(2, line.find(' ', 2) - 2));
    }
  }
  return commands;
}

/// Words of each command: {} is the program, {"study", "problems"} a command of a command.
std::vector<Arguments> all_commands() {
  std::vector<Arguments> all{{}};
  for (const std::string& command : commands_of(cairn({"--help"}).out)) {
    all.push_back({command});
    if (command == "help" || command == "complete") continue;  // their help is that of a command
    for (const std::string& inner : commands_of(cairn({command, "--help"}).out))
      all.push_back({command, inner});
  }
  return all;
}

std::string help_of(const Arguments& command) {
  Arguments words{"help"};
  words.insert(words.end(), command.begin(), command.end());
  return cairn(words).out;
}

std::string page_of(const Arguments& command) {
  Arguments words{"help", "--man"};
  words.insert(words.end(), command.begin(), command.end());
  const Outcome outcome = cairn(words);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  return outcome.out;
}

std::string page_name(const Arguments& command) {
  std::string name = "cairn";
  for (const std::string& word : command) name += "-" + word;
  return name;
}

/// "-o" and "--output" of the help's lines "  -o, --output OUT  …".
std::vector<std::string> options_of(const std::string& help) {
  std::vector<std::string> options;
  static const std::regex kLine("^  (-[a-zA-Z])?(?:, )?(--[a-z][-a-z]*)?( .*)?$");
  for (const std::string& line : lines(help)) {
    std::smatch found;
    if (!std::regex_match(line, found, kLine)) continue;
    for (const int k : {1, 2}) {
      if (found[k].matched) options.push_back(found[k].str());
    }
  }
  return options;
}

std::string bold_in_roff(std::string name) {
  for (std::size_t k = 0; (k = name.find('-', k)) != std::string::npos; k += 2)
    name.replace(k, 1, "\\-");
  return "\\fB" + name + "\\fR";
}

TEST(ManualPages, EveryCommandHasOne) {
  const TemporaryFolder folder;
  const Outcome outcome = cairn({"help", "--man-pages", folder.file("man1")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.out + outcome.err, "");
  std::set<std::string> expected;
  for (const Arguments& command : all_commands()) {
    expected.insert(page_name(command) + ".1");
    const std::string page = read_text(folder.path() / "man1" / (page_name(command) + ".1"));
    EXPECT_EQ(page, page_of(command)) << page_name(command);
  }
  EXPECT_GE(expected.size(), 20U);
  EXPECT_TRUE(expected.contains("cairn-study-problems.1"));
  std::set<std::string> written;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path() / "man1"))
    written.insert(entry.path().filename().string());
  EXPECT_EQ(written, expected);
}

TEST(ManualPages, HaveEveryOptionAndCommandOfTheHelp) {
  const std::vector<std::string> common = options_of(cairn({"--help"}).out);
  EXPECT_GE(common.size(), 8U);
  for (const Arguments& command : all_commands()) {
    SCOPED_TRACE(page_name(command));
    const std::string help = help_of(command), page = page_of(command);
    const std::string options = page.substr(page.find(".SH OPTIONS"));
    std::vector<std::string> expected = options_of(help);
    EXPECT_GE(expected.size(), page_name(command) == "cairn-optimize" ? 15U : 0U);
    for (const std::string& name : common) {
      if (name != "--version") expected.push_back(name);
    }
    for (const std::string& name : expected) EXPECT_THAT(options, HasSubstr(bold_in_roff(name)));
    for (const std::string& inner : commands_of(help)) {
      Arguments words = command;
      words.push_back(inner);
      std::string reference = bold_in_roff(page_name(words));
      reference = reference.substr(3, reference.size() - 6);
      EXPECT_THAT(page, HasSubstr(".BR " + reference + " (1)"));
    }
  }
}

TEST(ManualPages, ManReadsThemWithoutAWarning) {
  if (run_program({"groff", "--version"}).exit_code != 0) GTEST_SKIP() << "without groff";
  const TemporaryFolder folder;
  ASSERT_EQ(cairn({"help", "--man-pages", folder.path().string()}).exit_code, 0);
  for (const std::string& page : folder.contents()) {
    SCOPED_TRACE(page);
    const Outcome shown =
        run_program({"groff", "-man", "-ww", "-Tutf8", "-P-cbou", folder.file(page)});
    EXPECT_EQ(shown.exit_code, 0);
    EXPECT_EQ(shown.err, "");
    for (const char* title : {"NAME", "SYNOPSIS", "DESCRIPTION", "EXIT STATUS", "EXAMPLES"})
      EXPECT_THAT(shown.out, HasSubstr("\n" + std::string(title) + "\n"));
  }
  // What stands for itself: quotes, hyphens, Greek letters.
  const std::string sparsify = unfolded(
      run_program({"groff", "-man", "-Tutf8", "-P-cbou", folder.file("cairn-sparsify.1")}).out);
  EXPECT_THAT(sparsify, HasSubstr("tree:γ, fill:α or loss:KLD"));
  EXPECT_THAT(sparsify, HasSubstr("--keep-every N"));
}

TEST(ManualPages, AnUnknownCommandIsRefusedInACommandToo) {
  const Outcome outcome = cairn({"help", "study", "problem", "--man"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("did you mean 'problems'?"));
}

}  // namespace
}  // namespace cairn::test
