// SPDX-License-Identifier: BSD-3-Clause
// What a user is told about each plugin that is wrong. Every plugin here is a real shared object,
// built wrong on purpose (see CMakeLists.txt); nothing of it may hurt whoever does not ask for it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "cairn/plugin/fingerprint.hpp"
#include "cairn/plugin/plugin.hpp"
#include "cairn/plugin/plugin_search.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/loss.hpp"

namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

namespace fs = std::filesystem;

const fs::path kBad = CAIRN_BAD_PLUGINS;

/// A folder of its own for each test, removed at its end.
class PluginBoundary : public testing::Test {
 protected:
  PluginBoundary() {
    std::string name = (fs::temp_directory_path() / "cairn-plugins-XXXXXX").string();
    if (!mkdtemp(name.data()))
      throw fs::filesystem_error("mkdtemp", name, std::error_code(errno, std::generic_category()));
    folder_ = fs::canonical(name);
  }
  ~PluginBoundary() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }

  /// Copies a plugin (shared object and sidecar) of the build into the test's folder.
  fs::path copy(const fs::path& from, const std::string& name) const {
    for (const char* ending : {".so", ".json"}) {
      fs::copy_file(kBad / from / (name + ending), folder_ / (name + ending));
    }
    return folder_ / (name + ".so");
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
  }
  const fs::path& folder() const { return folder_; }

 private:
  fs::path folder_;
};

/// Looks in these folders alone.
cairn::PluginSearch search_in(std::initializer_list<fs::path> folders) {
  std::string list;
  for (const fs::path& folder : folders) list += (list.empty() ? "" : ":") + folder.string();
  setenv("CAIRN_PLUGIN_PATH", list.c_str(), 1);
  return {.files = {}, .environment = true, .user_folder = false, .default_folder = false};
}

/// The message of the error that asking for a loss ends with; it must be an error of the plugin.
std::string message_of(cairn::Registry& registry, const std::string& name) {
  try {
    registry.make<cairn::Loss>(name);
  } catch (const cairn::Error& error) {
    EXPECT_EQ(error.code(), cairn::ErrorCode::plugin);
    return error.what();
  }
  ADD_FAILURE() << name << " was made";
  return {};
}

std::string so(const fs::path& folder, const std::string& name) {
  return (kBad / folder / (name + ".so")).string();
}

std::vector<std::string> messages(const cairn::Registry& registry) {
  std::vector<std::string> result;
  for (const cairn::PluginProblem& problem : registry.problems()) result.push_back(problem.message);
  return result;
}

TEST_F(PluginBoundary, APluginWithoutFaultIsMade) {
  cairn::Registry registry(search_in({kBad / "nothing_wrong"}));
  EXPECT_THAT(registry.problems(), IsEmpty());
  ASSERT_EQ(registry.offers().size(), 1U);
  EXPECT_EQ(registry.offers()[0].file, kBad / "nothing_wrong" / "plain.so");
  EXPECT_EQ(registry.offers()[0].licence, "BSD-3-Clause");
  const auto loss = registry.make<cairn::Loss>("plain");
  const double s[] = {2.0};
  double rho[] = {0.0};
  loss->evaluate(s, rho, {});
  EXPECT_EQ(rho[0], 2.0);
}

#if defined(CAIRN_HAS_OTHER_ALIGNMENT)
TEST_F(PluginBoundary, AnotherEigenAlignmentIsRefusedWithBothFingerprints) {
  cairn::Registry registry(search_in({kBad / "other_alignment"}));
  const std::string message = message_of(registry, "plain");
  EXPECT_THAT(
      message,
      StartsWith(so("other_alignment", "wide") +
                 ": built differently from the core, so its objects cannot be passed around\n"));
  // Side by side, and only the line that differs is marked.
  EXPECT_THAT(message, testing::ContainsRegex("\n    core +plugin\n"));
  EXPECT_THAT(message, testing::ContainsRegex(
                           "\n  ! Eigen [0-9.]+ max-align=[0-9]+ max-static-align=[0-9]+ +"
                           "Eigen [0-9.]+ max-align=64 max-static-align=64\n"));
  EXPECT_THAT(message, testing::ContainsRegex("\n    headers [0-9a-f]+ +headers [0-9a-f]+\n"));
  EXPECT_THAT(message, HasSubstr("leave out -march=native, -mavx"));
}
#endif

TEST_F(PluginBoundary, AWrongFingerprintIsRefusedWithBothFingerprints) {
  cairn::Registry registry(search_in({kBad / "foreign"}));
  const std::string message = message_of(registry, "foreign");
  EXPECT_THAT(message, StartsWith(so("foreign", "foreign") + ": built differently from the core"));
  const std::string fingerprint = CAIRN_ABI_FINGERPRINT;
  for (std::size_t begin = 0; begin < fingerprint.size();) {
    const std::size_t end = std::min(fingerprint.find("; ", begin), fingerprint.size());
    EXPECT_THAT(message, HasSubstr("  ! " + fingerprint.substr(begin, end - begin)));
    begin = end + 2;
  }
  for (const char* part : {"cairn abi 0", "msvc 19", "Eigen 2"})
    EXPECT_THAT(message, HasSubstr(part));
  EXPECT_THAT(message, HasSubstr("\n  build the plugin again, with the headers of this cairn"));
}

TEST_F(PluginBoundary, APluginIsBoundToTheLibrariesThatItIsLinkedWith) {
  cairn::Registry today(search_in({kBad / "same_layer"}));
  EXPECT_NE(today.make<cairn::Loss>("plain"), nullptr);
  cairn::Registry another(search_in({kBad / "other_layer"}));
  EXPECT_THAT(message_of(another, "plain"),
              AllOf(StartsWith(so("other_layer", "of_another_day") +
                               ": built with other headers of the library libcairn_slam"),
                    HasSubstr("the plugin 0123456789abcdef"),
                    HasSubstr("build the plugin again, with the headers of this cairn")));
}

TEST_F(PluginBoundary, AStandardLibraryWithChecksIsRefusedWithBothFingerprints) {
  cairn::Registry registry(search_in({kBad / "debug_library"}));
  const std::string message = message_of(registry, "plain");
  EXPECT_THAT(message,
              StartsWith(so("debug_library", "checked") + ": built differently from the core"));
  EXPECT_THAT(message,
              testing::ContainsRegex("\n  ! libstdc\\+\\+ cxx11-abi=[01] debug=0 assertions=[01] +"
                                     "libstdc\\+\\+ cxx11-abi=[01] debug=1 assertions=[01]\n"));
  EXPECT_THAT(message, testing::ContainsRegex("\n    headers [0-9a-f]+ +headers [0-9a-f]+\n"));
  EXPECT_THAT(message, HasSubstr("-D_GLIBCXX_DEBUG"));
}

TEST_F(PluginBoundary, UnoptimisedCodeIsAcceptedAndNamed) {
#if defined(_GLIBCXX_ASSERTIONS) && defined(__OPTIMIZE__)
  GTEST_SKIP() << "this core has assertions that unoptimised code does not name in its fingerprint";
#endif
  cairn::Registry slow(search_in({kBad / "unoptimized"}));
  EXPECT_THAT(slow.unoptimized(), IsEmpty());  // nothing is loaded yet
  EXPECT_NE(slow.make<cairn::Loss>("plain"), nullptr);
  EXPECT_THAT(slow.unoptimized(), ElementsAre("slow"));
  cairn::Registry quick(search_in({kBad / "optimized"}));
  EXPECT_NE(quick.make<cairn::Loss>("plain"), nullptr);
  EXPECT_THAT(quick.unoptimized(), IsEmpty());
}

TEST_F(PluginBoundary, NoEntryPointIsNoPlugin) {
  cairn::Registry registry(search_in({kBad / "no_entry"}));
  EXPECT_EQ(message_of(registry, "no_entry"),
            so("no_entry", "no_entry") +
                ": not a plugin of cairn: it has no entry point cairn_plugin_v1; build it with "
                "cairn_add_plugin()");
}

TEST_F(PluginBoundary, WhatItThrowsWhileRegisteringIsPassedOn) {
  cairn::Registry registry(search_in({kBad / "throws", kBad / "throws_a_number"}));
  EXPECT_EQ(message_of(registry, "throwing"),
            so("throws", "throwing") +
                ": plugin 'throwing' failed while registering: the calibration of this plugin is "
                "not to be found");
  EXPECT_EQ(message_of(registry, "throwing_number"),
            so("throws_a_number", "throwing_number") +
                ": plugin 'throwing_number' failed while registering");
}

/// An exception of a static constructor would end the process, as exit() does.
TEST_F(PluginBoundary, WhatAStaticConstructorDoesIsAnErrorWithItsName) {
  const std::vector<std::pair<const char*, const char*>> cases{
      {"throws", "threw an exception: there is no camera"},
      {"throws a number", "threw an exception: it is not a std::exception"},
      {"exits", "ended the process with exit code 0"},
      {"ends at once", "ended the process with exit code 3"},
      {"crashes", "crashed (Segmentation fault)"}};
  for (const auto& [does, expected] : cases) {
    ASSERT_EQ(::setenv("CAIRN_TEST_CONSTRUCTOR", does, 1), 0);
    cairn::Registry registry(search_in({kBad / "static_constructor"}));
    EXPECT_EQ(message_of(registry, "eager"), "a static constructor " + std::string(expected) +
                                                 "\n  while loading plugin " +
                                                 so("static_constructor", "eager"));
  }
  ::unsetenv("CAIRN_TEST_CONSTRUCTOR");
  cairn::Registry registry(search_in({kBad / "static_constructor"}));
  EXPECT_NE(registry.make<cairn::Loss>("eager"), nullptr);
}

TEST_F(PluginBoundary, TwoOfOneNameAreAnErrorThatNamesBothFilesOnlyWhenAskedFor) {
  cairn::Registry registry(search_in({kBad / "twice/first", kBad / "twice/second"}));
  const std::string expected = "2 plugins offer loss 'twice': " + so("twice/first", "twice_first") +
                               " and " + so("twice/second", "twice_second") +
                               "; remove one, or take its folder off the search path";
  EXPECT_THAT(messages(registry), ElementsAre(expected));  // listed, not thrown
  EXPECT_NE(registry.make<cairn::Loss>("first"), nullptr);
  EXPECT_NE(registry.make<cairn::Loss>("second"), nullptr);
  EXPECT_EQ(message_of(registry, "twice"), expected);
}

TEST_F(PluginBoundary, OnePluginInTwoPlacesOfTheSearchIsNoConflict) {
  const fs::path folder = kBad / "nothing_wrong";
  cairn::PluginSearch search = search_in({folder, folder / ".." / "nothing_wrong"});
  search.files = {folder / "plain.so"};
  cairn::Registry registry(search);
  EXPECT_THAT(registry.problems(), IsEmpty());
  EXPECT_NE(registry.make<cairn::Loss>("plain"), nullptr);
}

TEST_F(PluginBoundary, AnUndefinedSymbolIsToldInTheWordsOfTheDynamicLinker) {
  cairn::Registry registry(search_in({kBad / "undefined_symbol"}));
  const std::string message = message_of(registry, "unresolved");
  const std::size_t symbol =
      message.find("undefined symbol: _Z43a_function_of_a_library_that_was_not_linkedv");
  const std::size_t ours =
      message.find("while loading plugin " + so("undefined_symbol", "unresolved"));
  ASSERT_NE(symbol, std::string::npos) << message;
  ASSERT_NE(ours, std::string::npos) << message;
  EXPECT_LT(symbol, ours);
  EXPECT_THAT(message, testing::Not(HasSubstr("entry point")));
  EXPECT_THAT(message, testing::Not(HasSubstr("built differently")));
}

TEST_F(PluginBoundary, WhatCannotBeLoadedIsComparedToo) {
  cairn::Registry registry(search_in({kBad / "other_library"}));
  const std::string message = message_of(registry, "unresolved");
  const std::size_t symbol = message.find("undefined symbol: ");
  const std::size_t difference = message.find("built differently from the core");
  ASSERT_NE(symbol, std::string::npos) << message;
  ASSERT_NE(difference, std::string::npos) << message;
  EXPECT_LT(symbol, difference);
  EXPECT_THAT(message, testing::ContainsRegex("\n  ! libstdc\\+\\+ .*debug=0 .*debug=1 "));
  EXPECT_THAT(message, testing::ContainsRegex("\n    headers [0-9a-f]+ +headers [0-9a-f]+\n"));
}

TEST_F(PluginBoundary, WhatIsNoSharedObjectIsToldInTheWordsOfTheDynamicLinker) {
  const fs::path library = copy("nothing_wrong", "plain");
  fs::remove(library);
  write("plain.so", "this is a text\n");
  cairn::Registry registry(search_in({folder()}));
  const std::string message = message_of(registry, "plain");
  EXPECT_THAT(message, AllOf(HasSubstr("plain.so: file too short"),
                             HasSubstr("while loading plugin " + library.string())));
}

TEST_F(PluginBoundary, AFolderThatOthersMayWriteToIsRefused) {
  copy("nothing_wrong", "plain");
  fs::permissions(folder(), fs::perms::others_write, fs::perm_options::add);
  cairn::Registry registry(search_in({folder()}));
  const std::string refusal =
      folder().string() + ": refused, since other users may write to this folder; 'chmod o-w' it";
  EXPECT_THAT(registry.offers(), IsEmpty());
  EXPECT_THAT(messages(registry), ElementsAre(refusal));
  // An error about a name that is missing mentions it.
  EXPECT_THAT(message_of(registry, "plain"),
              AllOf(StartsWith("there is no loss 'plain'"), HasSubstr(refusal)));
}

TEST_F(PluginBoundary, AFolderBelowOneThatOthersMayWriteToIsRefused) {
  fs::create_directory(folder() / "below");
  fs::permissions(folder(), fs::perms::others_write, fs::perm_options::add);
  cairn::Registry registry(search_in({folder() / "below"}));
  EXPECT_THAT(messages(registry), ElementsAre((folder() / "below").string() +
                                              ": refused, since other users may write to " +
                                              folder().string() + "; 'chmod o-w' it"));
  // A sticky folder, in which nobody may exchange what is another's, is as good as /tmp.
  fs::permissions(folder(), fs::perms::sticky_bit, fs::perm_options::add);
  cairn::Registry sticky(search_in({folder() / "below"}));
  EXPECT_THAT(sticky.problems(), IsEmpty());
}

TEST_F(PluginBoundary, AFolderOfAnotherUserIsRefused) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give a folder to another user";
  const fs::path own = folder() / "cairn" / "plugins";
  fs::create_directories(own);
  copy("nothing_wrong", "plain");
  fs::rename(folder() / "plain.so", own / "plain.so");
  fs::rename(folder() / "plain.json", own / "plain.json");
  ASSERT_EQ(::setenv("XDG_DATA_HOME", folder().c_str(), 1), 0);
  cairn::PluginSearch search = search_in({});
  search.user_folder = true;
  EXPECT_THAT(messages(cairn::Registry(search)), IsEmpty());
  ASSERT_EQ(::chown(own.c_str(), 12345, 12345), 0);
  const cairn::Registry registry(search);
  EXPECT_THAT(messages(registry),
              ElementsAre(own.string() + ": refused, it belongs to another user"));
  EXPECT_THAT(registry.offers(), IsEmpty());
  ::unsetenv("XDG_DATA_HOME");
}

TEST_F(PluginBoundary, ASidecarThatIsNoFileIsAProblemAndNoMore) {
  copy("nothing_wrong", "plain");
  fs::create_directory(folder() / "folder.json");
  ASSERT_EQ(mkfifo((folder() / "fifo.json").c_str(), 0600), 0);
  fs::create_symlink("/dev/zero", folder() / "zero.json");
  write("large.json", std::string(2 << 20, ' '));
  cairn::Registry registry(search_in({folder()}));
  EXPECT_THAT(messages(registry), ElementsAre(HasSubstr("fifo.json: is not a regular file"),
                                              HasSubstr("folder.json: is not a regular file"),
                                              HasSubstr("large.json: has more than 1 MB"),
                                              HasSubstr("zero.json: is not a regular file")));
  EXPECT_NE(registry.make<cairn::Loss>("plain"), nullptr);
}

TEST_F(PluginBoundary, AFileThatOthersMayWriteToIsRefusedByNameToo) {
  const fs::path library = copy("nothing_wrong", "plain");
  fs::permissions(library, fs::perms::others_write, fs::perm_options::add);
  const auto construct = [&] {
    cairn::PluginSearch search = search_in({});
    search.files = {library};
    cairn::Registry registry(search);
  };
  EXPECT_THAT(construct,
              testing::ThrowsMessage<cairn::Error>(
                  library.string() +
                  ": refused, since other users may write to it or its folder; 'chmod o-w' them"));
}

TEST_F(PluginBoundary, TheWorkingDirectoryIsNeverSearched) {
  copy("nothing_wrong", "plain");
  fs::current_path(folder());
  cairn::PluginSearch search = search_in({});
  for (const char* path : {"", ":", "."}) {
    setenv("CAIRN_PLUGIN_PATH", path, 1);
    cairn::Registry registry(search);
    EXPECT_THAT(registry.offers(), IsEmpty()) << "CAIRN_PLUGIN_PATH='" << path << "'";
  }
  fs::current_path("/");
}

TEST_F(PluginBoundary, FoldersThatTheProgramNamesAreSearched) {
  copy("nothing_wrong", "plain");
  cairn::PluginSearch search{
      .files = {}, .environment = false, .user_folder = false, .default_folder = false};
  EXPECT_FALSE(cairn::Registry(search).has("loss", "plain"));
  search.folders = {folder(), folder() / "none"};
  cairn::Registry registry(search);
  EXPECT_TRUE(registry.make<cairn::Loss>("plain"));
  ASSERT_THAT(registry.problems(), testing::SizeIs(1));
  EXPECT_EQ(registry.problems()[0].where, folder() / "none");
}

TEST_F(PluginBoundary, TheUsersOwnFolderIsSearched) {
  const cairn::PluginSearch users_only{
      .files = {}, .environment = false, .user_folder = true, .default_folder = false};
  const auto found = [&] { return cairn::Registry(users_only).has("loss", "plain"); };
  copy("nothing_wrong", "plain");
  fs::create_directories(folder() / "data/cairn");
  fs::create_directories(folder() / "home/.local/share/cairn");
  const auto put_into = [&](const fs::path& place) {
    fs::remove_all(folder() / "data/cairn/plugins");
    fs::remove_all(folder() / "home/.local/share/cairn/plugins");
    fs::create_directory(folder() / place);
    for (const char* file : {"plain.so", "plain.json"})
      fs::copy_file(folder() / file, folder() / place / file);
  };
  setenv("HOME", (folder() / "home").c_str(), 1);
  setenv("XDG_DATA_HOME", (folder() / "data").c_str(), 1);
  EXPECT_FALSE(found());
  EXPECT_THAT(cairn::Registry(users_only).problems(), IsEmpty());  // nobody has to have one
  put_into("data/cairn/plugins");
  EXPECT_TRUE(found());
  EXPECT_FALSE(cairn::Registry(search_in({})).has("loss", "plain"));  // switched off

  put_into("home/.local/share/cairn/plugins");
  EXPECT_FALSE(found());
  fs::current_path(folder());
  for (const char* unusable : {"", "data"}) {  // empty, and relative
    setenv("XDG_DATA_HOME", unusable, 1);
    EXPECT_TRUE(found());
  }
  fs::current_path("/");
  unsetenv("XDG_DATA_HOME");
  EXPECT_TRUE(found());
  unsetenv("HOME");
  EXPECT_FALSE(found());
}

TEST_F(PluginBoundary, TheUsersOwnFolderComesAfterTheEnvironmentAndIsRefusedIfOthersMayWriteToIt) {
  const fs::path users = folder() / "cairn/plugins";
  fs::create_directories(users);
  for (const char* ending : {".so", ".json"}) {
    const std::string file = std::string("twice_first") + ending;
    fs::copy_file(kBad / "twice/first" / file, users / file);
  }
  cairn::PluginSearch search = search_in({kBad / "twice/second"});
  search.user_folder = true;
  setenv("XDG_DATA_HOME", folder().c_str(), 1);
  {
    cairn::Registry registry(search);
    EXPECT_THAT(message_of(registry, "twice"),
                HasSubstr(so("twice/second", "twice_second") + " and " +
                          (users / "twice_first.so").string()));
  }
  fs::permissions(users, fs::perms::others_write, fs::perm_options::add);
  cairn::Registry registry(search);
  EXPECT_FALSE(registry.has("loss", "first"));
  EXPECT_THAT(messages(registry), ElementsAre(HasSubstr("other users may write to this folder")));
}

TEST_F(PluginBoundary, AFolderThatIsNotThereIsReported) {
  cairn::Registry registry(search_in({folder() / "nowhere", kBad / "nothing_wrong"}));
  EXPECT_THAT(messages(registry),
              ElementsAre((folder() / "nowhere").string() + ": no such folder"));
  EXPECT_TRUE(registry.has("loss", "plain"));
}

TEST_F(PluginBoundary, AMissingSharedObjectIsNamedWithWhatIsThere) {
  fs::remove(copy("nothing_wrong", "plain"));
  cairn::Registry registry(search_in({folder(), kBad / "twice/first"}));
  EXPECT_EQ(message_of(registry, "plain"), "loss 'plain' is not available: the shared object " +
                                               (folder() / "plain.so").string() +
                                               " is missing; build or install plugin 'plain', or "
                                               "choose from what is there: first, twice");
  EXPECT_NE(registry.make<cairn::Loss>("first"), nullptr);
}

TEST_F(PluginBoundary, AMissingSidecarMeansThatThePluginIsNotOnOffer) {
  const fs::path library = copy("nothing_wrong", "plain");
  fs::remove(folder() / "plain.json");
  EXPECT_FALSE(cairn::Registry(search_in({folder()})).has("loss", "plain"));
  // By file it is: then the shared object itself is asked.
  cairn::PluginSearch search = search_in({});
  search.files = {library};
  cairn::Registry registry(search);
  EXPECT_NE(registry.make<cairn::Loss>("plain"), nullptr);
}

TEST_F(PluginBoundary, ABrokenSidecarHurtsNobodyElse) {
  const std::string whole =
      R"({"name": "x", "version": "1", "licence": "MIT", "description": "", )";
  write("empty.json", "");
  write("list.json", "[]");
  write("no_file.json", whole + R"("offers": []})");
  write("no_offers.json", whole + R"("file": "x.so"})");
  write("not_json.json", "{\"name\": \"x\",");
  write("odd_offer.json", whole + R"("file": "x.so", "offers": [{"kind": "loss", "name": 7}]})");
  write("outside.json", whole + R"("file": "../x.so", "offers": []})");
  write("parent.json", whole + R"("file": "..", "offers": []})");
  write("zero.json", whole + R"("file": "x\u0000.so", "offers": []})");
  copy("nothing_wrong", "plain");
  cairn::Registry registry(search_in({folder()}));
  EXPECT_NE(registry.make<cairn::Loss>("plain"), nullptr);

  const auto about = [&](const char* file, const char* why) {
    return AllOf(StartsWith((folder() / file).string() + ": "), HasSubstr(why),
                 HasSubstr("; build the plugin again, or remove the file"));
  };
  EXPECT_THAT(
      messages(registry),
      ElementsAre(about("empty.json", "is not JSON"), about("list.json", "has no text 'name'"),
                  about("no_file.json", "has no text 'file'"),
                  about("no_offers.json", "has no list 'offers'"),
                  about("not_json.json", "is not JSON"),
                  about("odd_offer.json", "has no text 'name'"),
                  about("outside.json", "names no file of its own folder"),
                  about("parent.json", "names no file of its own folder"),
                  about("zero.json", "names no file of its own folder")));
}

TEST_F(PluginBoundary, ASidecarOfAnotherBuildIsNoticed) {
  const fs::path library = copy("nothing_wrong", "plain");
  write(
      "plain.json",
      R"({"name": "plain", "version": "1", "licence": "MIT", "description": "", "file": "plain.so",
                          "offers": [{"kind": "loss", "name": "splendid", "summary": ""}]})");
  cairn::Registry registry(search_in({folder()}));
  EXPECT_EQ(
      message_of(registry, "splendid"),
      library.string() +
          ": the file beside it (plain.json) is not of this build: they offer different names; "
          "build the plugin again");
}

TEST_F(PluginBoundary, APromiseNotKeptIsAnError) {
  cairn::Registry registry(search_in({kBad / "promises_more"}));
  const std::string expected = so("promises_more", "promising") +
                               ": the plugin offers loss 'forgotten' but does not register it";
  EXPECT_EQ(message_of(registry, "forgotten"), expected);
  EXPECT_EQ(message_of(registry, "kept"), expected);
}

TEST_F(PluginBoundary, ARegistrationNotPromisedIsAnError) {
  cairn::Registry registry(search_in({kBad / "registers_more"}));
  EXPECT_EQ(message_of(registry, "named"),
            so("registers_more", "generous") +
                ": the plugin registers loss 'stowaway', which its manifest does not offer");
}

TEST_F(PluginBoundary, AddingANameTwiceIsAnError) {
  cairn::Registry registry(search_in({kBad / "adds_twice"}));
  EXPECT_EQ(message_of(registry, "doubled"),
            so("adds_twice", "doubling") +
                ": plugin 'doubling' failed while registering: it adds loss 'doubled' twice");
}

TEST_F(PluginBoundary, MakingNothingIsAnError) {
  cairn::Registry registry(search_in({kBad / "makes_nothing"}));
  EXPECT_EQ(message_of(registry, "empty"),
            so("makes_nothing", "empty") + ": the plugin made nothing for loss 'empty'");
}

TEST_F(PluginBoundary, ATypePromisedAndNotMadeIsAnError) {
  cairn::Registry registry(search_in({kBad / "forgets_a_type"}));
  EXPECT_THAT([&] { registry.factor_type("EDGE_FORGOTTEN"); },
              testing::ThrowsMessage<cairn::Error>(
                  so("forgets_a_type", "forgetful") +
                  ": the plugin offers factor 'EDGE_FORGOTTEN' but does not make it"));
}

TEST_F(PluginBoundary, AFailedPluginFailsTheSameWayAgain) {
  cairn::Registry registry(search_in({kBad / "throws", kBad / "foreign", kBad / "nothing_wrong"}));
  for (const char* name : {"throwing", "foreign"}) {
    const std::string first = message_of(registry, name);
    EXPECT_EQ(message_of(registry, name), first);
  }
  EXPECT_NE(registry.make<cairn::Loss>("plain"), nullptr);
}

TEST_F(PluginBoundary, WhatAPluginMadeOutlivesTheRegistry) {
  std::unique_ptr<cairn::Loss> loss;
  {
    cairn::Registry registry(search_in({kBad / "nothing_wrong"}));
    loss = registry.make<cairn::Loss>("plain");
  }
  EXPECT_EQ(loss->second_derivative(1.0), 0.0);
}

}  // namespace
