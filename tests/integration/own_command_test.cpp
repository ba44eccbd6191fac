// SPDX-License-Identifier: BSD-3-Clause
// The program knows no command: one that a plugin brings is as good as its own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "integration/process.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// The plugin of tests/integration/own_command.
std::string greeter() { return CAIRN_GREETER; }

TEST(OwnCommand, IsFoundByTheFileOfItsPlugin) {
  for (const Arguments& arguments :
       {Arguments{"greet", "Ann", "Bo", "-n", "2", "--plugin", greeter()},
        Arguments{"--plugin=" + greeter(), "greet", "--how-often", "2", "Ann", "Bo"}})
    EXPECT_EQ(cairn(arguments).out, "hello Ann and Bo\nhello Ann and Bo\n");
  EXPECT_THAT(cairn({"greet", "Ann"}).err, HasSubstr("there is no command 'greet'"));
}

TEST(OwnCommand, HasHelpManualPageAndCompletion) {
  const std::string help = cairn({"greet", "--help", "--plugin", greeter()}).out;
  for (const char* part : {"cairn greet: says hello", "Usage: cairn greet [OPTIONS] WHOM...",
                           "  -n, --how-often N  how many times [1]", "  cairn greet Ann"})
    EXPECT_THAT(help, HasSubstr(part));
  EXPECT_EQ(cairn({"help", "greet", "--plugin", greeter()}).out, help);
  EXPECT_THAT(cairn({"--help", "--plugin", greeter()}).out, HasSubstr("  greet       says hello"));
  EXPECT_THAT(cairn({"help", "greet", "--man", "--plugin", greeter()}).out,
              HasSubstr("\\fB\\-n\\fR, \\fB\\-\\-how\\-often\\fR"));
  EXPECT_THAT(cairn({"complete", "--", "--plugin", greeter(), "gr"}).out,
              HasSubstr("greet\tsays hello"));
}

TEST(OwnCommand, HasItsWordsCheckedAndASectionOfTheConfiguration) {
  const auto refusal = [](Arguments arguments) {
    arguments.insert(arguments.end(), {"--plugin", greeter()});
    const Outcome outcome = cairn(arguments);
    EXPECT_EQ(outcome.exit_code, 2);
    return outcome.err;
  };
  EXPECT_THAT(refusal({"greet"}),
              HasSubstr("WHOM is missing; usage: cairn greet [OPTIONS] WHOM..."));
  EXPECT_THAT(refusal({"greet", "Ann", "-n", "4"}),
              HasSubstr("--how-often: '4' is not an integer from 1 to 3"));
  EXPECT_THAT(refusal({"greet", "Ann", "--allowed"}), HasSubstr("did you mean '--aloud'?"));
  const TemporaryFolder folder;
  const std::string config = folder.file("c.toml");
  write_text(config, "plugin = [\"" + greeter() + "\"]\n[greet]\nhow-often = 3\naloud = true\n");
  EXPECT_EQ(cairn({"greet", "Ann", "--config", config, "--plugin", greeter()}).out,
            "hello Ann!\nhello Ann!\nhello Ann!\n");
}

TEST(OwnCommand, WhosePluginIsNotThereConcernsNobodyElse) {
  const std::string none = "/nowhere/plugin.so";
  EXPECT_EQ(cairn({"--version", "--plugin", none}).exit_code, 0);
  EXPECT_EQ(cairn({"info", "--help", "--plugin", none}).exit_code, 0);
  EXPECT_THAT(cairn({"complete", "--", "optimize", "--plugin", "no"}).out, HasSubstr("\tfiles"));
  EXPECT_EQ(cairn({"info", "@ring", "--plugin", none}).exit_code, 5);
  EXPECT_EQ(cairn({"info", "@ring", "--plugin", ""}).exit_code, 2);
  const TemporaryFolder folder;
  write_text(folder.file("a.json"),
             R"({"name": "a", "version": "1", "licence": "x", "description": "", "file": "a.so",
                 "offers": [{"kind": "command", "name": "gone", "summary": "one"},
                            {"kind": "command", "name": "help", "summary": "two"}]})");
  write_text(folder.file("b.json"), "{");
  const std::string config = folder.file("c.toml");
  write_text(config, "[convert]\nin = \"@ring\"\nout = \"" + folder.file("ring.tum") + "\"\n");
  const Environment found{{"CAIRN_PLUGIN_PATH", folder.path().string()}};
  EXPECT_EQ(cairn({"convert", "--config", config}, found).exit_code, 0);
  EXPECT_EQ(cairn({"help", "info"}, found).exit_code, 0);
  EXPECT_EQ(cairn({"gone"}, found).exit_code, 5);
  EXPECT_EQ(cairn({"study compact"}).exit_code, 2);
  EXPECT_THAT(cairn({"none"}, found).err, HasSubstr("b.json"));
}

TEST(OwnCommand, WhoseNameIsNoWordIsNotThere) {
  const TemporaryFolder folder;
  write_text(folder.file("a.json"),
             R"({"name": "a", "version": "1", "licence": "x", "description": "", "file": "a.so",
                 "offers": [{"kind": "command", "name": "-x", "summary": "one"},
                            {"kind": "command", "name": "help", "summary": "two"},
                            {"kind": "command", "name": "a b c", "summary": "three"},
                            {"kind": "command", "name": "red\u001b[31m", "summary": "four"},
                            {"kind": "command", "name": "good", "summary": "fi\u001b[31mve"}]})");
  const Outcome outcome = cairn({"--help"}, {{"CAIRN_PLUGIN_PATH", folder.path().string()}});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.out, HasSubstr("  good "));
  EXPECT_EQ(outcome.out.find('\x1b'), std::string::npos);
  for (const char* absent : {"one\n", "two\n", "three\n", "four\n"})
    EXPECT_THAT(outcome.out, Not(HasSubstr(absent)));
}

}  // namespace
}  // namespace cairn::test
