// SPDX-License-Identifier: BSD-3-Clause
// The folders are the architecture: each #include line of the project goes only where
// docs/architecture.md allows it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using Names = std::vector<std::string>;

/// The layers of the core: each may include itself and those before it.
const Names kLayers{"runtime", "types", "graph", "linear", "solve", "plugin"};
/// Libraries beside plugins, which plugins (and libraries) may include.
const Names kShared{"solvers/block", "solvers/linear/blas", "solvers/linear/iterative",
                    "solvers/nonlinear/descent"};
/// What commands share: of the subjects' folders and the program alone.
const std::string kProgram = "lib/program";
/// Below the core: what everything may include, and includes nothing of cairn.
const Names kBelow{"core/numeric/"};
/// Of what lies below the core, the folders of public headers: several numbers at a time, arrays.
const Names kPublicBelow{"pack", "memory", "text"};
/// Folders each of whose folders stands for itself: it includes no other.
const Names kWings{"lib",     "types", "solvers/linear", "solvers/nonlinear", "solvers/incremental",
                   "plugins", "apps"};

std::string read(const fs::path& file) {
  std::ifstream stream(file);
  EXPECT_TRUE(stream) << file;
  return {std::istreambuf_iterator<char>(stream), {}};
}

bool lies_below(const std::string& file) {
  return std::ranges::any_of(kBelow, [&](const auto& folder) { return file.starts_with(folder); });
}

/// The words after a begin, up to the next parenthesis, in a CMake file.
Names words_after(const fs::path& file, const std::string& begin) {
  const std::string text = read(file);
  const std::size_t at = text.find(begin);
  if (at == std::string::npos) return {};
  std::istringstream words(text.substr(at + begin.size(), text.find(')', at) - at - begin.size()));
  return {std::istream_iterator<std::string>(words), {}};
}

/// Position in a list, or -1.
int position(const Names& list, std::string_view name) {
  const auto it = std::ranges::find(list, name);
  return it == list.end() ? -1 : static_cast<int>(it - list.begin());
}

/// The names between quotes in the #include lines of a text.
Names quoted_includes(const std::string& text) {
  Names names;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t hash = line.find_first_not_of(" \t");
    if (hash == std::string::npos || line[hash] != '#') continue;
    const std::size_t word = line.find_first_not_of(" \t", hash + 1);
    const std::size_t open = line.find('"'), close = line.rfind('"');
    if (word == std::string::npos || line.compare(word, 7, "include") != 0 || open == close)
      continue;
    names.push_back(line.substr(open + 1, close - open - 1));
  }
  return names;
}

/// A file's place: "core", "lib/io", "solvers/linear/pcg", "plugins/compact"; empty outside of all.
std::string place_of(const std::string& file) {
  if (file.starts_with("core/")) return "core";
  for (const std::string& shared : kShared) {
    if (file.starts_with(shared + "/")) return shared;
  }
  for (const std::string& wing : kWings) {
    if (!file.starts_with(wing + "/")) continue;
    const std::size_t end = file.find('/', wing.size() + 1);
    if (end != std::string::npos) return file.substr(0, end);
  }
  return {};
}

/// The part of a place whose private headers a file sees: a folder of a subject, or of the core.
std::string room_of(const std::string& file) {
  const std::string place = place_of(file);
  std::size_t begin = 0;
  for (const std::string& floor :
       {std::string("core/src/"), std::string("core/include/cairn/"), place + "/"}) {
    if (file.starts_with(floor)) {
      begin = floor.size();
      break;
    }
  }
  const bool has_rooms = place == "core" || place.starts_with("plugins/");
  const std::size_t end = file.find('/', begin);
  return has_rooms && end != std::string::npos ? file.substr(begin, end - begin) : std::string();
}

/// All C++ files below a root, and what is wrong with their includes.
class Tree {
 public:
  explicit Tree(const fs::path& root)
      : root_(root), parts_(words_after(root / "lib/CMakeLists.txt", "set(subjects ")) {
    for (const char* top : {"core", "lib", "types", "solvers", "plugins", "apps"}) {
      if (!fs::exists(root / top)) continue;
      for (const fs::directory_entry& entry : fs::recursive_directory_iterator(root / top)) {
        const std::string ending = entry.path().extension();
        if (ending == ".hpp" || ending == ".cpp")
          add(fs::relative(entry.path(), root).generic_string());
      }
    }
    std::ranges::sort(files_);
    for (const std::string& file : files_) {
      const std::string place = place_of(file);
      if (place.starts_with("plugins/") && !needs_.contains(place)) needs_[place] = needs_of(place);
    }
  }
  const Names& files() const { return files_; }
  const Names& parts() const { return parts_; }

  /// One line for each include that is not allowed.
  Names faults() const {
    Names all;
    for (const std::string& file : files_) {
      for (const std::string& name : quoted_includes(read(root_ / file))) {
        const std::string why =
            name.starts_with("cairn/") ? public_fault(file, name) : private_fault(file, name);
        if (!why.empty()) all.push_back(file + " includes " + name + ": " + why);
      }
    }
    return all;
  }

 private:
  void add(const std::string& file) {
    files_.push_back(file);
    const std::size_t at = file.find("/include/cairn/");
    if (at != std::string::npos) public_[file.substr(at + 9)] = file;
  }

  /// The subjects that one may include: those of its file, and those that these need.
  std::set<std::string> needs_of(const std::string& subject) const {
    std::set<std::string> all;
    if (!fs::exists(root_ / subject / "subject.cmake")) return all;
    for (const std::string& name :
         words_after(root_ / subject / "subject.cmake", "set(CAIRN_SUBJECT_NEEDS")) {
      all.insert("plugins/" + name);
      all.merge(needs_of("plugins/" + name));
    }
    return all;
  }

  /// Where a place of lib comes in the order; after all others what is beside the first library.
  std::size_t rank(const std::string& place) const {
    const int at = position(parts_, place.substr(4));
    if (at >= 0) return static_cast<std::size_t>(at);
    return parts_.size() + (place == kProgram ? 1 : 0);
  }

  /// What is wrong with an include of a public header, `cairn/<part>/…`.
  std::string public_fault(const std::string& file, const std::string& name) const {
    const std::string part = name.substr(6, name.find('/', 6) - 6);
    if (position(kPublicBelow, part) >= 0) {
      const bool other = lies_below(file) && file.find("/" + part + "/") == std::string::npos;
      return other ? "each stands for itself" : "";
    }
    if (lies_below(file)) return "what lies below the core includes nothing of it";
    if (part == "abi" || name == "cairn/plugin/abi_tag.hpp") return {};  // written by CMake
    const auto found = public_.find(name);
    if (found == public_.end()) return "there is no such public header";
    const std::string from = place_of(file), to = place_of(found->second);
    if (to == "core") {
      const bool later =
          from == "core" && position(kLayers, part) > position(kLayers, room_of(file));
      return later ? part + " is a later layer" : "";
    }
    if (from == "core") return "the core includes nothing of lib";
    if (to.starts_with("lib/")) {
      if (from.starts_with("lib/") && rank(to) > rank(from)) return to + " comes later";
      if (to != kProgram) return {};
      const bool command = from.starts_with("plugins/") || from == "apps/cairn" || from == kProgram;
      return command ? "" : "of commands alone";
    }
    if (from == to) return {};
    const auto needs = needs_.find(from);
    if (needs != needs_.end() && needs->second.contains(to)) return {};
    return from == "apps/c" && to == "plugins/online" ? "" : from + " does not need " + to;
  }

  /// What is wrong with an include by a name below some source folder. The name stands for each
  /// file that it may mean; the one beside the including file comes first, as for the compiler.
  std::string private_fault(const std::string& file, const std::string& name) const {
    const fs::path beside = (fs::path(file).parent_path() / name).lexically_normal();
    Names meant;
    for (const std::string& other : files_) {
      if (other == beside.generic_string()) return fault_between(file, other);
      if (other.ends_with("/" + name)) meant.push_back(other);
    }
    std::string why;
    for (const std::string& other : meant) {
      why = fault_between(file, other);
      if (why.empty()) return {};
    }
    return why;
  }

  static std::string fault_between(const std::string& file, const std::string& other) {
    if (lies_below(other)) return {};
    const std::string from = place_of(file), to = place_of(other);
    if (position(kShared, to) >= 0) return {};
    // Helpers of the Python module, which its subjects' parts are compiled with.
    if (to == "apps/python" && file.find("/python/") != std::string::npos) return {};
    if (from != to) return "a private header of " + to;
    if (room_of(file) == room_of(other)) return {};
    // Within the core, also those of earlier layers.
    const bool earlier =
        from == "core" && position(kLayers, room_of(other)) < position(kLayers, room_of(file));
    return earlier ? "" : "a private header of " + room_of(other);
  }

  fs::path root_;
  Names files_, parts_;
  std::map<std::string, std::string> public_;           ///< file of each public header
  std::map<std::string, std::set<std::string>> needs_;  ///< of each subject
};

TEST(Structure, EveryIncludeFollowsTheOrderOfTheFolders) {
  const Tree tree(CAIRN_SOURCE_FOLDER);
  EXPECT_THAT(tree.parts(), SizeIs(testing::Ge(7U)));
  for (const std::string& layer : kLayers)
    EXPECT_TRUE(fs::is_directory(fs::path(CAIRN_SOURCE_FOLDER) / "core/include/cairn" / layer));
  EXPECT_THAT(tree.files(), SizeIs(testing::Ge(200U)));
  EXPECT_THAT(tree.faults(), IsEmpty());
}

TEST(Structure, EveryLayerOfTheCoreHasItsPlaceInTheOrder) {
  for (const char* folder : {"core/include/cairn", "core/src"}) {
    for (const fs::directory_entry& entry :
         fs::directory_iterator(fs::path(CAIRN_SOURCE_FOLDER) / folder)) {
      EXPECT_GE(position(kLayers, entry.path().filename().string()), 0) << entry.path();
    }
  }
}

/// A small tree with one fault of each kind, made for the test and removed after it.
class FaultyTree : public testing::Test {
 protected:
  FaultyTree() {
    std::string name = (fs::temp_directory_path() / "cairn-structure-XXXXXX").string();
    if (mkdtemp(name.data())) root_ = name;
    write("lib/CMakeLists.txt", "set(subjects geometry update)\n");
  }
  ~FaultyTree() override {
    std::error_code ignored;
    fs::remove_all(root_, ignored);
  }
  void write(const fs::path& file, const std::string& text) const {
    fs::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text;
  }
  Names faults() const { return Tree(root_).faults(); }

 private:
  fs::path root_;
};

TEST_F(FaultyTree, WhatIsAllowedIsNoFault) {
  write("core/include/cairn/graph/graph.hpp", "");
  write("core/include/cairn/types/t.hpp", "");
  write("core/include/cairn/plugin/options.hpp", "");
  write("core/src/graph/graph.cpp",
        "#include \"cairn/graph/graph.hpp\"\n#include \"cairn/types/t.hpp\"\n#include <map>\n");
  write("lib/geometry/include/cairn/geometry/g.hpp", "");
  write("lib/update/include/cairn/update/u.hpp", "");
  write("lib/update/src/u.cpp", "#include \"cairn/geometry/g.hpp\"\n#include \"own.hpp\"\n");
  write("lib/update/src/own.hpp", "#include \"cairn/plugin/options.hpp\"\n");
  write("solvers/block/front.hpp", "");
  write("solvers/linear/one/one.cpp", "#include \"block/front.hpp\"\n#include \"one.hpp\"\n");
  write("solvers/linear/one/one.hpp", "#include \"cairn/update/u.hpp\"\n");
  write("solvers/linear/two/one.hpp", "");
  write("core/numeric/dense/lu.hpp", "#include \"dense/products.hpp\"\n");
  write("core/numeric/dense/products.hpp", "#include <Eigen/Core>\n");
  for (const char* file : {"core/src/graph/lu.cpp", "lib/update/src/lu.cpp", "types/one/lu.cpp"})
    write(file, "#include \"dense/lu.hpp\"\n");
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(FaultyTree, ALaterLayerOrPartIsAFault) {
  write("core/include/cairn/graph/graph.hpp", "");
  write("core/include/cairn/types/t.hpp", "  #  include \"cairn/graph/graph.hpp\"\n");
  write("lib/update/include/cairn/update/u.hpp", "");
  write("lib/geometry/include/cairn/geometry/g.hpp", "#include \"cairn/update/u.hpp\"\n");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("graph is a later layer"),
                                    HasSubstr("lib/update comes later")));
}

TEST_F(FaultyTree, ALayerInWhatLiesBelowTheCoreIsAFault) {
  write("core/numeric/dense/lu.hpp", "#include \"cairn/runtime/error.hpp\"\n");
  write("core/numeric/memory/aligned_memory.hpp", "#include \"cairn/runtime/error.hpp\"\n");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("below the core"), HasSubstr("below the core")));
}

TEST_F(FaultyTree, PacksMayBeIncludedEverywhereAndIncludeNothingElse) {
  write("core/include/cairn/types/t.hpp", "#include \"cairn/pack/pack.hpp\"\n");
  write("core/numeric/pack/include/cairn/pack/p.hpp", "#include \"cairn/pack/pack.hpp\"\n");
  EXPECT_THAT(faults(), IsEmpty());
  write("core/numeric/pack/include/cairn/pack/p.hpp", "#include \"cairn/types/t.hpp\"\n");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("below the core")));
  write("core/numeric/pack/include/cairn/pack/p.hpp",
        "#include \"cairn/memory/growing_array.hpp\"\n");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("each stands for itself")));
}

TEST_F(FaultyTree, WhatCommandsShareIsOfCommandsAlone) {
  write("lib/update/include/cairn/update/u.hpp", "");
  write("lib/program/include/cairn/program/table.hpp", "");
  write("lib/program/src/report.cpp",
        "#include \"cairn/update/u.hpp\"\n#include \"cairn/program/table.hpp\"\n");
  for (const char* file : {"plugins/one/commands/command.cpp", "apps/cairn/help.cpp"})
    write(file, "#include \"cairn/program/table.hpp\"\n");
  EXPECT_THAT(faults(), IsEmpty());
  for (const char* file : {"types/one/t.cpp", "solvers/linear/one/one.cpp", "lib/update/src/u.cpp"})
    write(file, "#include \"cairn/program/table.hpp\"\n");
  EXPECT_THAT(faults(), SizeIs(3));
}

TEST_F(FaultyTree, LibInTheCoreIsAFault) {
  write("lib/geometry/include/cairn/geometry/g.hpp", "");
  write("core/src/plugin/file.cpp", "#include \"cairn/geometry/g.hpp\"\n");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("the core includes nothing of lib")));
}

TEST_F(FaultyTree, ASubjectThatIsNotNeededIsAFault) {
  write("plugins/one/library/include/cairn/one/o.hpp", "");
  write("plugins/two/subject.cmake", "set(CAIRN_SUBJECT two)\nset(CAIRN_SUBJECT_NEEDS one)\n");
  write("plugins/two/library/src/t.cpp", "#include \"cairn/one/o.hpp\"\n");
  write("plugins/three/subject.cmake", "set(CAIRN_SUBJECT three)\nset(CAIRN_SUBJECT_NEEDS two)\n");
  write("plugins/three/commands/c.cpp", "#include \"cairn/one/o.hpp\"\n");
  EXPECT_THAT(faults(), IsEmpty());
  for (const char* file : {"plugins/four/f.cpp", "apps/cairn/commands/info.cpp",
                           "lib/update/src/u.cpp", "solvers/linear/one/one.cpp"})
    write(file, "#include \"cairn/one/o.hpp\"\n");
  EXPECT_THAT(faults(), SizeIs(4));
}

TEST_F(FaultyTree, AnotherPluginOrAPrivateHeaderIsAFault) {
  write("core/src/plugin/loader.hpp", "");
  write("types/slam2d/pose.hpp", "");
  write("plugins/report/page/page.hpp", "");
  write("plugins/report/plot/plot.cpp",
        "#include \"loader.hpp\"\n#include \"slam2d/pose.hpp\"\n#include \"cairn/nowhere/x.hpp\"\n"
        "#include \"page.hpp\"\n");
  write("solvers/linear/one/one.cpp", "#include \"../two/two.hpp\"\n");
  write("solvers/linear/two/two.hpp", "");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("a private header of core"),
                                    HasSubstr("a private header of types/slam2d"),
                                    HasSubstr("there is no such public header"),
                                    HasSubstr("a private header of page"),
                                    HasSubstr("a private header of solvers/linear/two")));
}

}  // namespace
