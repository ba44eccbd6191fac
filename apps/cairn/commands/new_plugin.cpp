// SPDX-License-Identifier: BSD-3-Clause
// cairn new-plugin NAME --factor|…: a project to begin a plugin with, from the templates that are
// installed with the program.
#include <stdlib.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <boost/json/array.hpp>
#include <boost/json/object.hpp>

#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/version.hpp"

namespace cairn::app {
namespace {

namespace fs = std::filesystem;
namespace json = boost::json;

/// One kind of plugin: a folder of templates, and what its manifest offers.
struct Kind {
  const char* option;  // without --
  const char* folder;
  const char* description;
  const char* offers;
  const char* tag;        // of types; empty for a component
  const char* use;        // a first command
  const char* libraries;  // that it needs besides the core; "" for none
  bool example = false;   // a graph comes with it
};
constexpr const char* kCompact = "\n  LIBRARIES cairn::compact";  // policies
constexpr const char* kSlam = "\n  LIBRARIES cairn::slam";        // lib: updates, motions, formats
constexpr std::array<Kind, 8> kKinds{
    {{"factor", "factor", "A factor of its own",
      "\"types|@NAME@|measurements of @NAME@\"\n"
      "         \"factor|@TAG@|distance from a pose to a landmark\"",
      "EDGE_@UPPER@", "cairn optimize example.g2o --plugin build/@NAME@.so", "", true},
     {"variable", "variable", "A variable of its own",
      "\"types|@NAME@|variables of @NAME@\"\n"
      "         \"variable|@TAG@|a heading\"\n"
      "         \"factor|EDGE_PRIOR_@UPPER@|a measured heading\"",
      "VERTEX_@UPPER@", "cairn optimize example.g2o --plugin build/@NAME@.so", "", true},
     {"loss", "loss", "A robust loss of its own", "\"loss|@NAME@|a robust loss\"", "",
      "cairn optimize @manhattan --loss @NAME@:scale=2 --plugin build/@NAME@.so", ""},
     {"linear-solver", "linear_solver", "A linear solver of its own",
      "\"linear_solver|@NAME@|a dense factorisation\"", "",
      "cairn optimize @ring --linear-solver @NAME@ --plugin build/@NAME@.so", ""},
     {"optimizer", "optimizer", "An optimizer of its own",
      "\"optimizer|@NAME@|Gauss-Newton with limited steps\"", "",
      "cairn optimize @ring --optimizer @NAME@ --plugin build/@NAME@.so", ""},
     {"estimator", "estimator", "An online estimator of its own",
      "\"estimator|@NAME@|optimises everything again\"", "",
      "cairn replay @ring --estimator @NAME@ --plugin build/@NAME@.so", kSlam},
     {"format", "format", "A file format of its own", "\"format|@NAME@|one record a line\"", "",
      "cairn convert @ring ring.@NAME@ --plugin build/@NAME@.so", kSlam},
     {"policy", "policy", "A pose policy of its own",
      "\"pose_policy|@NAME@|a pose every so many metres\"", "",
      "cairn compact @ring --policy @NAME@:distance=2 --plugin build/@NAME@.so", kCompact}}};

constexpr const char* kExamplePrefix = "$HOME/cairn";  // to install to

/// Where the templates are, from the program's own place: PREFIX/bin/cairn.
fs::path template_folder() {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  fs::path folder = program.parent_path().parent_path() / CAIRN_TEMPLATE_FOLDER;
  if (error || !fs::is_directory(folder)) {
    throw Error(ErrorCode::input,
                fmt::format("{}: the templates of new plugins are not there; install cairn with "
                            "'cmake --install'",
                            folder.string()));
  }
  return folder;
}

/// "laser_range" as "LaserRange" and as "LASER_RANGE".
std::string class_name(const std::string& name) {
  std::string result;
  bool first = true;
  for (const char c : name) {
    if (c != '_') result += first ? static_cast<char>(std::toupper(c)) : c;
    first = c == '_';
  }
  return result;
}
/// Whether a word stands in a text by itself, not as a part of another.
bool has_word(std::string_view text, std::string_view word) {
  const auto continues = [&](std::size_t at) {
    return at < text.size() &&
           (std::isalnum(static_cast<unsigned char>(text[at])) != 0 || text[at] == '_');
  };
  for (std::size_t at = 0; (at = text.find(word, at)) != text.npos; at += word.size()) {
    if (!continues(at + word.size()) && (at == 0 || !continues(at - 1))) return true;
  }
  return false;
}

std::string upper_case(std::string name) {
  std::ranges::transform(name, name.begin(),
                         [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return name;
}

constexpr std::size_t kLongestName = 64;

void check_name(const std::string& name) {
  const bool good = !name.empty() && name.front() >= 'a' && name.front() <= 'z' &&
                    std::ranges::all_of(name, [](char c) {
                      return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
                    });
  if (good && name.size() > kLongestName) {
    throw Error(ErrorCode::usage,
                fmt::format("the name of a plugin has at most {} characters, and this has {}",
                            kLongestName, name.size()));
  }
  if (good) return;
  throw Error(ErrorCode::usage,
              fmt::format("'{}' cannot be the name of a plugin: a letter from a to z, then a-z, "
                          "0-9 and _, such as laser_range",
                          name));
}

using Words = std::vector<std::pair<std::string, std::string>>;

/// What stands for each @WORD@ of the templates. Values may hold words that come after them.
Words words_for(const Kind& kind, const std::string& name, const fs::path& templates) {
  // What the template declares, or uses, is no name for a class of its own: Vector, Tools.
  std::string own = class_name(name);
  if (has_word(read_file((templates / kind.folder / "plugin.cpp.in").string()), own))
    own += class_name(kind.folder);
  return {{"@DESCRIPTION@", kind.description},
          {"@OFFERS@", kind.offers},
          {"@LIBRARIES@", kind.libraries},
          {"@USE@", kind.use},
          {"@TAG@", kind.tag},
          {"@VERSION@", CAIRN_VERSION},
          {"@CLASS@", own},
          {"@UPPER@", upper_case(name)},
          {"@NAME@", name}};
}

std::string filled_in(std::string text, const Words& words) {
  for (const auto& [word, value] : words) {
    for (std::size_t at = 0; (at = text.find(word, at)) != std::string::npos; at += value.size())
      text.replace(at, word.size(), value);
  }
  return text;
}

/// A folder beside the final one, which it becomes once it is whole.
class UnfinishedFolder {
 public:
  explicit UnfinishedFolder(fs::path folder) : final_(std::move(folder)) {
    std::error_code unknown;
    if (fs::exists(fs::symlink_status(final_, unknown)))
      throw Error(ErrorCode::input,
                  fmt::format("{}: there already; choose another name or folder", final_.string()));
    std::string name = final_.string() + ".XXXXXX";
    if (!::mkdtemp(name.data()))
      throw Error(ErrorCode::input, fmt::format("{}: {}", final_.string(), std::strerror(errno)));
    path_ = name;
  }
  UnfinishedFolder(const UnfinishedFolder&) = delete;
  UnfinishedFolder& operator=(const UnfinishedFolder&) = delete;
  ~UnfinishedFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }

  const fs::path& path() const { return path_; }
  void finish() {
    std::error_code error;
    fs::permissions(path_, fs::perms::owner_all | fs::perms::group_read | fs::perms::group_exec |
                               fs::perms::others_read | fs::perms::others_exec);
    fs::rename(path_, final_, error);
    if (error)
      throw Error(ErrorCode::input, fmt::format("{}: {}", final_.string(), error.message()));
    path_.clear();
  }

 private:
  fs::path final_, path_;
};

struct Chosen {
  std::string name;
  std::string folder;
  bool factor = false, variable = false, loss = false, linear_solver = false, optimizer = false,
       estimator = false, format = false, policy = false;

  static auto fields() {
    using O = Chosen;
    return OptionFields<O>()
        .text("name", &O::name, "of the plugin and its files: a-z, 0-9 and _")
        .positional()
        .placeholder("NAME")
        .required()
        .boolean("factor", &O::factor, "a measurement between variables")
        .boolean("variable", &O::variable, "a type of states, with a factor on it")
        .boolean("loss", &O::loss, "a robust loss, with an option")
        .boolean("linear_solver", &O::linear_solver, "a solver of H x = g")
        .boolean("optimizer", &O::optimizer, "a way to the minimum of chi2")
        .boolean("estimator", &O::estimator, "an estimate that follows a growing graph")
        .boolean("format", &O::format, "a text format, read and written")
        .boolean("policy", &O::policy, "a choice of the poses and links that are kept")
        .text("folder", &O::folder, "where it is written; must not exist [NAME]")
        .placeholder("FOLDER");
  }
};

/// In the order of `kKinds`.
constexpr std::array kFlags{&Chosen::factor,        &Chosen::variable,  &Chosen::loss,
                            &Chosen::linear_solver, &Chosen::optimizer, &Chosen::estimator,
                            &Chosen::format,        &Chosen::policy};

const Kind& kind_of(const Chosen& chosen) {
  const auto is_chosen = [&](bool Chosen::*flag) { return chosen.*flag; };
  if (std::ranges::count_if(kFlags, is_chosen) != 1) {
    std::string all;
    for (const Kind& kind : kKinds)
      all += fmt::format("{}--{}", all.empty() ? "" : ", ", kind.option);
    throw Error(ErrorCode::usage, fmt::format("one kind of plugin must be given: {}", all));
  }
  return kKinds[static_cast<std::size_t>(std::ranges::find_if(kFlags, is_chosen) - kFlags.begin())];
}

/// Of two components of one name neither could be used.
void check_not_on_offer(const Kind& kind, const std::string& name, const Registry& registry) {
  const std::string_view offers = kind.offers;
  const std::string_view of = offers.substr(1, offers.find('|') - 1);
  if (!registry.has(of, name)) return;
  std::string words(of);
  std::ranges::replace(words, '_', ' ');
  throw Error(ErrorCode::usage,
              fmt::format("{} '{}' is on offer already; choose another name", words, name));
}

int make_project(const Chosen& chosen, Session& session) {
  check_name(chosen.name);
  const Kind& kind = kind_of(chosen);
  check_not_on_offer(kind, chosen.name, session.registry());
  const fs::path templates = template_folder();
  const fs::path folder = chosen.folder.empty() ? chosen.name : chosen.folder;
  const Words words = words_for(kind, chosen.name, templates);
  struct File {
    fs::path from, to;
  };
  const fs::path own = templates / kind.folder;
  std::vector<File> files{
      {templates / "common" / "CMakeLists.txt", "CMakeLists.txt"},
      {templates / "common" / "README.md", "README.md"},
      {own / "plugin.cpp", chosen.name + ".cpp"},
      {own / "tests" / "plugin_test.cpp", fs::path("tests") / (chosen.name + "_test.cpp")}};
  if (kind.example) files.push_back({own / "example.g2o", "example.g2o"});

  UnfinishedFolder unfinished(folder);
  fs::create_directory(unfinished.path() / "tests");
  std::vector<std::string> written;
  for (const File& file : files) {
    write_file(unfinished.path() / file.to,
               filled_in(read_file(file.from.string() + ".in"), words));
    written.push_back((folder / file.to).string());
  }
  unfinished.finish();

  json::object report = begin_report("new-plugin");
  report["folder"] = folder.string();
  report["files"] = strings_json(written);
  session.write_json(report);
  const std::string place = templates.parent_path().parent_path().parent_path().string();
  const bool installed = !fs::exists(fs::path(place) / "CMakeCache.txt");
  const std::string install =
      installed ? ""
                : fmt::format(
                      "  cmake --install {} --prefix {}  # this cairn is in its build "
                      "folder, against which nothing else can be built\n",
                      printable(place), kExamplePrefix);
  session.print(fmt::format(
      "{}\n\nNext:\n{}  cd {}\n  cmake -B build -DCMAKE_PREFIX_PATH={} && cmake --build build\n"
      "  ctest --test-dir build --output-on-failure\n  {}\n",
      printable(joined(written, "\n"), true), install, printable(folder.string()),
      installed ? printable(place) : kExamplePrefix, filled_in(kind.use, words)));
  return 0;
}

}  // namespace

void add_new_plugin(Registrar& registrar) {
  add_command<Chosen>(
      registrar, "new-plugin",
      "It builds against the installed cairn, works as it is, and passes its own tests, which run "
      "the\nconformance suite (cairn plugins --check).\n\n"
      "Example:\n"
      "  cairn new-plugin laser_range --factor",
      make_project);
}

}  // namespace cairn::app
