// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <set>

#include "cairn/plugin/plugin_search.hpp"
#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

using ::testing::Contains;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

TEST(PluginsCommand, ListsEverythingOnOffer) {
  const Registry registry;
  const auto report = parse_json(cairn({"plugins", "--json", "-"}).out);
  std::set<std::pair<std::string, std::string>> listed;
  for (const auto& offer : report.at("offers").as_array()) {
    listed.emplace(offer.at("kind").as_string().c_str(), offer.at("name").as_string().c_str());
    for (const char* member : {"summary", "plugin", "file", "licence", "version"}) {
      EXPECT_FALSE(offer.at(member).as_string().empty()) << member;
    }
  }
  const std::string table = cairn({"plugins"}).out;
  const std::string words = unfolded(table);
  for (const Offer& offer : registry.offers()) {
    EXPECT_TRUE(listed.contains({offer.kind, offer.name})) << offer.name;
    EXPECT_THAT(table, HasSubstr(" " + offer.name + " "));
    EXPECT_THAT(words, HasSubstr(" " + offer.name + " " + offer.summary + " "));
  }
  EXPECT_EQ(listed.size(), registry.offers().size());
}

TEST(PluginsCommand, WritesNoControlCharactersOfSidecarFiles) {
  const TemporaryFolder folder;
  write_text(folder.file("a.json"),
             R"({"name": "a", "version": "1", "licence": "x\u0007", "description": "",
                 "file": "a.so", "offers": [{"kind": "loss\u001b]0;kind\u0007",
                 "name": "red\u001b[31m", "summary": "one\u009b2J\ntwo"}]})");
  write_text(folder.file("b.json"), "broken");
  std::filesystem::rename(folder.file("b.json"), folder.file("b\x1b[2J.json"));
  const Environment found{{"CAIRN_PLUGIN_PATH", folder.path().string()}};
  for (const Arguments& arguments :
       {Arguments{"plugins"}, Arguments{"plugins", "red\x1b[31m"},
        Arguments{"optimize", "@ring", "--optimizer", "none\x1b[31m"}}) {
    const Outcome outcome = cairn(arguments, found);
    for (const char c : {'\x1b', '\x07', '\x9b'})
      EXPECT_EQ((outcome.out + outcome.err).find(c), std::string::npos) << arguments.front();
  }
  const std::string list = cairn({"plugins"}, found).out;
  EXPECT_THAT(list, HasSubstr("red\\x1b[31m"));
  EXPECT_THAT(list, HasSubstr("one\\x9b2J\\x0atwo"));
}

TEST(PluginsCommand, OpensNoPluginForTheList) {
  // The dynamic linker itself tells every object that it looks for.
  const Outcome list = cairn({"plugins"}, {{"LD_DEBUG", "files"}});
  EXPECT_EQ(list.exit_code, 0);
  EXPECT_THAT(list.err, HasSubstr("libcairn.so"));
  for (const Offer& offer : Registry().offers()) {
    const bool is_of_command = offer.plugin == "commands";  // that of `cairn plugins` itself
    EXPECT_EQ(list.err.find("/" + offer.file.filename().string()) != std::string::npos,
              is_of_command)
        << offer.name;
  }
  const Outcome one = cairn({"plugins", "eigen"}, {{"LD_DEBUG", "files"}});
  EXPECT_THAT(one.err, HasSubstr("eigen.so"));
}

TEST(PluginsCommand, ShowsTheOptionsOfOneName) {
  const auto report = parse_json(cairn({"plugins", "levenberg_marquardt", "--json", "-"}).out);
  const auto& offer = report.at("offers").as_array().at(0);
  EXPECT_EQ(offer.at("kind").as_string(), "optimizer");
  std::vector<std::string> names;
  for (const auto& option : offer.at("options").as_array()) {
    names.emplace_back(option.at("name").as_string().c_str());
    EXPECT_FALSE(option.at("help").as_string().empty());
  }
  EXPECT_THAT(names, Contains("linear_solver"));
  const std::string text = cairn({"plugins", "levenberg_marquardt"}).out;
  for (const std::string& name : names) EXPECT_THAT(text, HasSubstr("  " + name + " "));
  EXPECT_THAT(text, HasSubstr("BSD-3-Clause"));
}

TEST(PluginsCommand, ShowsEveryName) {
  for (const Offer& offer : Registry().offers()) {
    const Outcome outcome = cairn({"plugins", offer.name});
    EXPECT_EQ(outcome.exit_code, 0) << offer.name << ": " << outcome.err;
    EXPECT_THAT(unfolded(outcome.out), HasSubstr(offer.summary));
    EXPECT_THAT(outcome.out, Not(ContainsRegex("name of a [aeiou]")));
  }
}

TEST(PluginsCommand, APluginsNameShowsAllThatItOffers) {
  const std::string text = cairn({"plugins", "generate"}).out;
  EXPECT_THAT(text, HasSubstr("manhattan (generator)"));
  EXPECT_THAT(text, HasSubstr("sphere (generator)"));
}

TEST(PluginsCommand, AKindListsWhatItHas) {
  CAIRN_NEEDS("loss", "huber");
  for (const char* kind : {"initial_guess", "initial guess"}) {
    const Outcome outcome = cairn({"plugins", kind});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  }
  const std::string text = cairn({"plugins", "loss"}).out;
  EXPECT_THAT(text, HasSubstr("  huber"));
  EXPECT_THAT(text, Not(HasSubstr("block_cholesky")));
}

TEST(PluginsCommand, AFolderIsNoPluginToCheck) {
  const TemporaryFolder folder;
  const Outcome outcome = cairn({"plugins", "--check", folder.path().string()});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("is a folder; give the plugin's .so file"));
}

TEST(PluginsCommand, WhatAnOptionMeansHasATitleOfItsOwn) {
  const auto table = lines(cairn({"plugins", "levenberg_marquardt"}).out);
  const auto title = std::ranges::find_if(
      table, [](const std::string& line) { return line.starts_with("  option "); });
  ASSERT_NE(title, table.end());
  const std::size_t column = title->find("meaning");
  ASSERT_NE(column, std::string::npos);
  const auto option = std::ranges::find_if(
      table, [](const std::string& line) { return line.starts_with("  linear_solver "); });
  ASSERT_NE(option, table.end());
  EXPECT_EQ(option->find("solves the normal equations"), column);
}

TEST(PluginsCommand, TellsAbilities) {
  if (Registry().has("linear_solver", "pcg")) {
    EXPECT_THAT(cairn({"plugins", "pcg"}).out, HasSubstr("iterative"));
  }
  EXPECT_THAT(cairn({"plugins", "block_cholesky"}).out, Not(HasSubstr("iterative")));
  EXPECT_THAT(cairn({"plugins", "VERTEX_SE2"}).out, HasSubstr("Lie group"));
  EXPECT_THAT(cairn({"plugins", "EDGE_SE2"}).out, HasSubstr("relative pose"));
  EXPECT_THAT(cairn({"plugins", "g2o"}).out, HasSubstr("reads, writes, .g2o"));
}

TEST(PluginsCommand, AnUnknownTagIsAnsweredWithWhatIsWrongWithPlugins) {
  const TemporaryFolder folder;
  write_text(folder.file("broken.json"), "{");
  write_text(folder.file("odd.g2o"), "VERTEX_SE2 0 0 0 0\nEDGE_OF_ANOTHER 0 1\n");
  const Outcome outcome = cairn({"info", folder.file("odd.g2o")},
                                {{"CAIRN_PLUGIN_PATH", folder.path().string() + ":/no/such"}});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("unknown tag 'EDGE_OF_ANOTHER'"));
  EXPECT_THAT(outcome.err, HasSubstr("note: " + folder.file("broken.json")));
  EXPECT_THAT(outcome.err, HasSubstr("note: /no/such: no such folder"));
  EXPECT_EQ(lines(outcome.err).size(), 1);
}

TEST(PluginsCommand, AnUnknownNameIsAnsweredWithTheNearest) {
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  const Outcome outcome = cairn({"plugins", "block_cholesk"});
  EXPECT_EQ(outcome.exit_code, 5);
  EXPECT_THAT(outcome.err, HasSubstr("did you mean 'block_cholesky'?"));
}

/// A copy of the libraries and plugins, without some files.
Environment installation_without(const TemporaryFolder& folder,
                                 const std::vector<std::string>& missing) {
  const auto plugins = Registry().offers().front().file.parent_path();
  std::filesystem::copy(plugins, folder.path() / "cairn");
  for (const auto& entry : std::filesystem::directory_iterator(plugins.parent_path())) {
    if (entry.path().filename().string().starts_with("libcairn.so")) {
      std::filesystem::copy(entry.path(), folder.path() / entry.path().filename());
    }
  }
  for (const std::string& name : missing) std::filesystem::remove(folder.path() / "cairn" / name);
  return {{"LD_LIBRARY_PATH", folder.path().string()}};
}

TEST(PluginsCommand, ASharedObjectThatIsGoneIsMissedOnlyByWhoAsksForIt) {
  const TemporaryFolder folder;
  const Environment environment = installation_without(folder, {"eigen.so"});
  const Outcome asked =
      cairn({"optimize", "@ring:poses=40", "--linear-solver", "eigen"}, environment);
  EXPECT_EQ(asked.exit_code, 5);
  EXPECT_THAT(asked.err, HasSubstr((folder.path() / "cairn" / "eigen.so").string()));
  EXPECT_THAT(asked.err, HasSubstr("block_cholesky"));
  const Outcome bench =
      cairn({"bench", "@ring:poses=40", "--repeat", "1", "--no-memory"}, environment);
  EXPECT_EQ(bench.exit_code, 0) << bench.err;
  EXPECT_THAT(bench.err, HasSubstr("note: left out: linear solver 'eigen'"));
  for (const Arguments& other :
       std::vector<Arguments>{{"optimize", "@ring:poses=40"},
                              {"info", "@ring:poses=40"},
                              {"plugins"},
                              {"convert", "@ring:poses=40", "-", "--to", "g2o"}}) {
    EXPECT_EQ(cairn(other, environment).exit_code, 0) << other.front();
  }
}

TEST(PluginsCommand, WithoutAnyPluginTheFoldersOfTheSearchAreNamed) {
  const TemporaryFolder folder;
  Environment environment = installation_without(folder, {});
  std::filesystem::remove_all(folder.path() / "cairn");
  environment["XDG_DATA_HOME"] = folder.path().string();
  const std::string where =
      "no plugin was found in " + (folder.path() / "cairn").string() + ", nor in";
  const Outcome all = cairn({"plugins"}, environment);
  EXPECT_EQ(all.exit_code, 5);
  EXPECT_THAT(all.err, StartsWith("cairn: no plugins found; "));
  EXPECT_THAT(all.err, HasSubstr(where));
  write_text(folder.file("map.g2o"), "VERTEX_SE2 0 0 0 0\n");
  write_text(folder.file("floor.yaml"), "image: floor.pgm\n");
  const std::string graph = folder.file("map.g2o");
  for (const Arguments& arguments :
       std::vector<Arguments>{{"optimize", "@ring"},
                              {"online"},
                              {"explore", "@rooms"},
                              {"explore", folder.file("floor.yaml")},
                              {"plot", "@ring", "-o", folder.file("ring.svg")},
                              {"plugins", "cholmod"},
                              {"plugins", "linear_solver"},
                              {"optimize", graph, "--optimizer", "dogleg"},
                              {"optimize", graph, "--linear-solver", "cholmod"},
                              {"bench", "@ring", "--linear-solver", "cholmod"},
                              {"marginals", "@ring"},
                              {"generate", "ring", "-o", folder.file("ring.g2o")},
                              {"convert", graph, folder.file("other.g2o")},
                              {"convert", graph, "-", "--to", "g2o"},
                              {"info", "@ring"},
                              {"compact", "@ring"},
                              {"sparsify", "@ring"},
                              {"replay", "@ring"},
                              {"evaluate", graph, graph},
                              {"view", graph},
                              {"bench", "@ring", "--html", folder.file("bench.html")},
                              {"map", folder.file("log.clf")}}) {
    const Outcome outcome = cairn(arguments, environment);
    EXPECT_NE(outcome.exit_code, 0);
    EXPECT_THAT(outcome.err, HasSubstr(where)) << testing::PrintToString(arguments);
  }
  EXPECT_EQ(cairn({"--version"}, environment).exit_code, 0);
}

TEST(PluginsCommand, APluginThatIsGoneAltogetherIsNotOnOffer) {
  CAIRN_NEEDS("linear_solver", "block_cholesky");
  const TemporaryFolder folder;
  const Environment environment = installation_without(folder, {"eigen.so", "eigen.json"});
  const Outcome asked =
      cairn({"optimize", "@ring:poses=40", "--linear-solver", "eigen"}, environment);
  EXPECT_EQ(asked.exit_code, 5);
  EXPECT_THAT(asked.err, HasSubstr("there is no linear solver 'eigen'"));
  EXPECT_THAT(asked.err, HasSubstr("block_cholesky"));
  const Outcome bench =
      cairn({"bench", "@ring:poses=40", "--repeat", "1", "--no-memory", "--quiet"}, environment);
  EXPECT_EQ(bench.exit_code, 0) << bench.err;
}

TEST(PluginsCommand, ListsWhatIsWrongWithPlugins) {
  const TemporaryFolder folder;
  write_text(folder.file("broken.json"), "{ this is no JSON");
  const Environment path{{"CAIRN_PLUGIN_PATH", folder.path().string()}};
  const Outcome outcome = cairn({"plugins"}, path);
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.out, HasSubstr("problems"));
  EXPECT_THAT(outcome.out, HasSubstr("broken.json"));
  EXPECT_THAT(outcome.out, HasSubstr("linear solver"));  // the others are there all the same
  const auto report = parse_json(cairn({"plugins", "--json", "-"}, path).out);
  EXPECT_EQ(report.at("problems").as_array().size(), 1u);
}

}  // namespace
}  // namespace cairn::test
