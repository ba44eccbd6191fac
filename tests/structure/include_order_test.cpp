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
const Names kWings{"types", "solvers/linear", "solvers/nonlinear", "solvers/incremental", "plugins",
                   "apps"};

std::string read(const fs::path& file) {
  std::ifstream stream(file);
  EXPECT_TRUE(stream) << file;
  return {std::istreambuf_iterator<char>(stream), {}};
}

bool lies_below(const std::string& file) {
  return std::ranges::any_of(kBelow, [&](const auto& folder) { return file.starts_with(folder); });
}

/// Position in a list, or -1.
int position(const Names& list, std::string_view name) {
  const auto it = std::ranges::find(list, name);
  return it == list.end() ? -1 : static_cast<int>(it - list.begin());
}

/// The subjects of lib/ in their order, from the line `set(subjects …)` of its CMakeLists.txt.
Names subjects_of(const fs::path& root) {
  const std::string text = read(root / "lib/CMakeLists.txt"), begin = "set(subjects ";
  const std::size_t at = text.find(begin);
  if (at == std::string::npos) return {};
  std::istringstream words(text.substr(at + begin.size(), text.find(')', at) - at - begin.size()));
  return {std::istream_iterator<std::string>(words), {}};
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

/// The wing's folder that a file below the root lies in ("solvers/linear/pcg"); empty outside.
std::string unit_of(const std::string& file) {
  if (file.starts_with(kProgram + "/")) return kProgram;
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

/// All C++ files below a root, and what is wrong with their includes.
class Tree {
 public:
  explicit Tree(const fs::path& root) : root_(root), subjects_(subjects_of(root)) {
    for (const char* top : {"core", "lib", "types", "solvers", "plugins", "apps"}) {
      if (!fs::exists(root / top)) continue;
      for (const fs::directory_entry& entry : fs::recursive_directory_iterator(root / top)) {
        const std::string ending = entry.path().extension();
        if (ending == ".hpp" || ending == ".cpp")
          files_.push_back(fs::relative(entry.path(), root).generic_string());
      }
    }
    std::ranges::sort(files_);
  }
  const Names& files() const { return files_; }
  const Names& subjects() const { return subjects_; }

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
  /// The layer or subject that a file of core or lib belongs to; empty elsewhere.
  std::string part_of(const std::string& file) const {
    if (file.starts_with(kProgram + "/")) return {};  // no subject of the library
    const std::string core_headers = "core/include/cairn/", core_sources = "core/src/";
    for (const std::string& begin :
         {core_headers, core_sources, kBelow.front(), std::string("lib/")}) {
      if (file.starts_with(begin))
        return file.substr(begin.size(), file.find('/', begin.size()) - begin.size());
    }
    return {};
  }

  /// What is wrong with an include of a public header, `cairn/<layer or subject>/…`.
  std::string public_fault(const std::string& file, const std::string& name) const {
    const std::string part = name.substr(6, name.find('/', 6) - 6);
    const int layer = position(kLayers, part), subject = position(subjects_, part);
    if (position(kPublicBelow, part) >= 0) {
      const bool other = lies_below(file) && part_of(file) != part;
      return other ? "each stands for itself" : "";
    }
    if (lies_below(file)) return "what lies below the core includes nothing of it";
    if (layer < 0 && subject < 0) return part + " is neither a layer of the core nor a subject";
    if (file.starts_with("core/")) {
      if (layer < 0) return "the core includes nothing of lib";
      if (layer > position(kLayers, part_of(file))) return part + " is a later layer";
    }
    if (file.starts_with("lib/") && !file.starts_with(kProgram + "/") &&
        subject > position(subjects_, part_of(file)))
      return part + " is a later subject";
    return {};
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

  std::string fault_between(const std::string& file, const std::string& other) const {
    if (lies_below(other)) return {};
    const std::string from = part_of(file), to = part_of(other);
    if (!from.empty() || !to.empty()) {
      // Within the core, also those of earlier layers.
      const bool earlier = file.starts_with("core/") && other.starts_with("core/") &&
                           position(kLayers, to) < position(kLayers, from);
      return from == to || earlier ? "" : "a private header of " + (to.empty() ? other : to);
    }
    const std::string unit = unit_of(other);
    if (unit_of(file) == unit || position(kShared, unit) >= 0) return {};
    if (unit == kProgram)
      return file.starts_with("plugins/") || file.starts_with("apps/cairn/") ? ""
                                                                             : "of commands alone";
    return unit + " is another plugin's folder";
  }

  fs::path root_;
  Names files_, subjects_;
};

TEST(Structure, EveryIncludeFollowsTheOrderOfTheFolders) {
  const Tree tree(CAIRN_SOURCE_FOLDER);
  EXPECT_THAT(tree.subjects(), SizeIs(testing::Ge(7U)));
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
  write("core/src/graph/graph.cpp",
        "#include \"cairn/graph/graph.hpp\"\n#include \"cairn/types/t.hpp\"\n#include <map>\n");
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

TEST_F(FaultyTree, ALaterLayerOrSubjectIsAFault) {
  write("core/include/cairn/types/t.hpp", "  #  include \"cairn/graph/graph.hpp\"\n");
  write("lib/geometry/include/cairn/geometry/g.hpp", "#include \"cairn/update/u.hpp\"\n");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("graph is a later layer"),
                                    HasSubstr("update is a later subject")));
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
  write("lib/program/table.hpp", "");
  write("lib/program/report.cpp",
        "#include \"cairn/update/u.hpp\"\n#include \"program/table.hpp\"\n");
  for (const char* file : {"plugins/one/command.cpp", "apps/cairn/help.cpp"})
    write(file, "#include \"program/table.hpp\"\n");
  EXPECT_THAT(faults(), IsEmpty());
  for (const char* file : {"types/one/t.cpp", "solvers/linear/one/one.cpp", "lib/update/src/u.cpp"})
    write(file, "#include \"program/table.hpp\"\n");
  EXPECT_THAT(faults(), SizeIs(3));
}

TEST_F(FaultyTree, LibInTheCoreIsAFault) {
  write("core/src/plugin/file.cpp", "#include \"cairn/geometry/g.hpp\"\n");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("the core includes nothing of lib")));
}

TEST_F(FaultyTree, AnotherPluginOrAPrivateHeaderIsAFault) {
  write("core/src/plugin/loader.hpp", "");
  write("types/slam2d/pose.hpp", "");
  write(
      "plugins/plot/plot.cpp",
      "#include \"loader.hpp\"\n#include \"slam2d/pose.hpp\"\n#include \"cairn/nowhere/x.hpp\"\n");
  write("solvers/linear/one/one.cpp", "#include \"../two/two.hpp\"\n");
  write("solvers/linear/two/two.hpp", "");
  EXPECT_THAT(faults(),
              ElementsAre(HasSubstr("a private header of plugin"),
                          HasSubstr("types/slam2d is another plugin's folder"),
                          HasSubstr("nowhere is neither a layer of the core nor a subject"),
                          HasSubstr("solvers/linear/two is another plugin's folder")));
}

}  // namespace
