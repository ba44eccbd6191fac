// SPDX-License-Identifier: BSD-3-Clause
#include "plugin_loader.hpp"

#define BOOST_DLL_USE_STD_FS
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <new>
#include <sstream>
#include <system_error>

#include <fmt/core.h>
#include <boost/dll/runtime_symbol_info.hpp>
#include <boost/dll/shared_library.hpp>
#include <boost/json.hpp>

#include "cairn/plugin/fingerprint.hpp"
#include "cairn/runtime/error.hpp"
#include "trial_opening.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

Error plugin_error(const std::string& message) { return {ErrorCode::plugin, message}; }

/// Loaded libraries by path, a singleton that is never destroyed: objects that a plugin made, and
/// exceptions that it threw, may outlive whoever loaded it.
std::map<fs::path, boost::dll::shared_library>& loaded_libraries() {
  static auto* libraries = new std::map<fs::path, boost::dll::shared_library>();
  return *libraries;
}

constexpr std::uintmax_t kLargestSidecar = std::uintmax_t{1} << 20;  // they have some hundred bytes

struct stat status_of(const fs::path& path) {  // zeros where there is no such file
  struct stat status = {};
  return ::stat(path.c_str(), &status) == 0 ? status : decltype(status){};
}

bool others_may_write(const fs::path& path) { return (status_of(path).st_mode & S_IWOTH) != 0; }

/// Neither to this user nor to root, as in the HOME that sudo may keep.
bool belongs_to_another(const fs::path& path) {
  return status_of(path).st_uid != 0 && status_of(path).st_uid != ::geteuid();
}

/// The folder or, unless sticky (as /tmp is), one above it that all users may write to; or empty.
fs::path open_to_others(const fs::path& folder) {
  if (others_may_write(folder)) return folder;
  for (fs::path above = folder; above.has_relative_path();) {
    above = above.parent_path();
    if (others_may_write(above) && (status_of(above).st_mode & S_ISVTX) == 0) return above;
  }
  return {};
}

/// The folder of one user's plugins, by the XDG base directory specification, in which a relative
/// XDG_DATA_HOME counts for nothing. Empty where neither it nor HOME is set.
fs::path user_folder() {
  if (const char* data = std::getenv("XDG_DATA_HOME"); data && fs::path(data).is_absolute())
    return fs::path(data) / "cairn" / "plugins";
  if (const char* home = std::getenv("HOME"); home && fs::path(home).is_absolute())
    return fs::path(home) / ".local" / "share" / "cairn" / "plugins";
  return {};
}

std::vector<std::string> split_fingerprint(std::string_view text) {
  std::vector<std::string> parts;
  while (!text.empty()) {
    const std::size_t end = text.find("; ");
    parts.emplace_back(text.substr(0, end));
    text = end == std::string_view::npos ? std::string_view{} : text.substr(end + 2);
  }
  return parts;
}

/// Both fingerprints side by side, with a mark where they differ.
std::string compare_fingerprints(std::string_view core, std::string_view plugin) {
  std::vector<std::string> left = split_fingerprint(core), right = split_fingerprint(plugin);
  const std::size_t rows = std::max(left.size(), right.size());
  left.resize(rows);
  right.resize(rows);
  std::size_t width = 4;
  for (const std::string& part : left) width = std::max(width, part.size());
  std::string table = fmt::format("    {:<{}}    {}\n", "core", width, "plugin");
  for (std::size_t k = 0; k < rows; ++k) {
    table += fmt::format("  {} {:<{}}    {}\n", left[k] == right[k] ? ' ' : '!', left[k], width,
                         right[k]);
  }
  table.pop_back();
  return table;
}

/// What to do about two fingerprints that differ.
std::string remedy(std::string_view core, std::string_view plugin) {
  const std::vector<std::string> left = split_fingerprint(core), right = split_fingerprint(plugin);
  // First come the version and the headers of cairn.
  if (right.size() < 2 || !std::equal(left.begin(), left.begin() + 2, right.begin()))
    return "build the plugin again, with the headers of this cairn";
  return "build the plugin with the compiler and flags of the core (leave out -march=native, "
         "-mavx…, -stdlib=libc++ and -D_GLIBCXX_DEBUG)";
}

std::string difference(std::string_view plugin) {
  return fmt::format(
      "built differently from the core, so its objects cannot be passed around\n{}\n  {}",
      compare_fingerprints(core_fingerprint(), plugin), remedy(core_fingerprint(), plugin));
}

/// Throws `Error` (plugin) where a library above the core has other headers than the plugin was
/// compiled with.
void expect_layers(const fs::path& library, const PluginManifest& manifest) {
  for (const PluginLayer* layer = manifest.layers; layer->name; ++layer) {
    if (std::string_view(layer->built) == layer->here) continue;
    throw plugin_error(fmt::format(
        "{}: built with other headers of the library libcairn_{}, so its objects cannot be "
        "passed around (the library has {}, the plugin {})\n  build the plugin again, "
        "with the headers of this cairn",
        library.string(), layer->name, layer->here, layer->built));
  }
}

/// The fingerprint in a file that cannot be loaded; empty if there is none.
std::string fingerprint_in(const fs::path& library) {
  std::ifstream file(library, std::ios::binary);
  const std::string bytes(std::istreambuf_iterator<char>(file), {});
  const std::size_t inside = bytes.find("; headers ");
  return inside == std::string::npos ? "" : bytes.c_str() + bytes.rfind('\0', inside) + 1;
}

/// Whether the dynamic linker failed for lack of memory. That of glibc may also say then that there
/// is no such library, which is there and can be read.
bool lacked_memory(int code, const std::string& words, const fs::path& library) {
  return code == ENOMEM ||
         (words.find(library.string() + ": cannot open shared object file: No such file") !=
              std::string::npos &&
          ::access(library.c_str(), R_OK) == 0);
}

boost::dll::shared_library open_library(const fs::path& library) {
  errno = 0;
  try {
    return boost::dll::shared_library(
        library, boost::dll::load_mode::rtld_now | boost::dll::load_mode::rtld_local);
  } catch (const std::system_error& error) {
    const int code = errno;
    if (lacked_memory(code, error.what(), library)) throw std::bad_alloc();
    // The dynamic linker's words first: an undefined symbol must not be blamed on anything else.
    const std::string built = fingerprint_in(library);
    throw plugin_error(
        fmt::format("{}\n  while loading plugin {}{}", error.what(), library.string(),
                    built.empty() || built == core_fingerprint() ? "" : ", " + difference(built)));
  }
}

/// Of a plugin that is not installed with the core. An exception in a static constructor would end
/// the process, whatever program it is.
void expect_to_open(const fs::path& library) {
  const std::string failure = failure_of_static_constructors(library);
  if (!failure.empty())
    throw plugin_error(fmt::format("{}\n  while loading plugin {}", failure, library.string()));
}

}  // namespace

fs::path default_folder() {
  return fs::path(boost::dll::this_line_location().string()).parent_path() / "cairn";
}

const char* core_fingerprint() { return CAIRN_ABI_FINGERPRINT; }

Sidecar read_sidecar(const fs::path& file) {
  const auto broken = [&](const std::string& why) {
    return plugin_error(
        fmt::format("{}: {}; build the plugin again, or remove the file", file.string(), why));
  };
  std::error_code unknown;
  if (!fs::is_regular_file(file, unknown)) throw broken("is not a regular file");
  const std::uintmax_t size = fs::file_size(file, unknown);
  if (!unknown && size > kLargestSidecar) throw broken("has more than 1 MB");
  std::ifstream stream(file, std::ios::binary);
  std::string text(unknown ? 0 : size, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (!stream && errno == ENOMEM) throw std::bad_alloc();
  if (!stream) throw broken("cannot be read");
  boost::system::error_code error;
  const boost::json::value root = boost::json::parse(text, error);
  if (error) throw broken("is not JSON (" + error.message() + ")");
  const boost::json::object* object = root.if_object();
  const auto text_of = [&](const boost::json::object* from, const char* key) {
    const boost::json::value* value = from ? from->if_contains(key) : nullptr;
    if (!value || !value->is_string()) throw broken(fmt::format("has no text '{}'", key));
    return std::string(value->get_string());
  };
  Sidecar sidecar{text_of(object, "name"),    text_of(object, "version"),
                  text_of(object, "licence"), text_of(object, "description"),
                  text_of(object, "file"),    {}};
  // What is opened would end at a zero.
  if (sidecar.library.has_parent_path() || sidecar.library.extension() != ".so" ||
      sidecar.library.native().find('\0') != std::string::npos)
    throw broken("names no file of its own folder");
  sidecar.library = file.parent_path() / sidecar.library;
  const boost::json::value* offers = object->if_contains("offers");
  if (!offers || !offers->is_array()) throw broken("has no list 'offers'");
  for (const boost::json::value& offer : offers->get_array()) {
    const boost::json::object* entry = offer.if_object();
    sidecar.offers.push_back(
        {text_of(entry, "kind"), text_of(entry, "name"), text_of(entry, "summary")});
  }
  return sidecar;
}

std::string debian_package_with(std::string_view kind, std::string_view name) {
  std::ifstream lines(default_folder() / "packages.txt");
  std::string of_kind, of_name, package;
  while (lines >> of_kind >> of_name >> package) {
    if (of_kind == kind && of_name == name) return package;
  }
  return {};
}

std::vector<fs::path> plugin_folders(const PluginSearch& search,
                                     std::vector<PluginProblem>& problems) {
  std::vector<fs::path> folders;
  const auto add = [&](const fs::path& folder, bool must_exist) {
    std::error_code error;
    const fs::path canonical = fs::canonical(folder, error);
    if (error == std::errc::not_enough_memory) throw std::bad_alloc();
    if (error || !fs::is_directory(canonical)) {
      if (must_exist) problems.push_back({folder, folder.string() + ": no such folder"});
      return;
    }
    if (const fs::path open = open_to_others(canonical); !open.empty()) {
      problems.push_back(
          {folder,
           fmt::format("{}: refused, since other users may write to {}; 'chmod o-w' it",
                       folder.string(), open == canonical ? "this folder" : open.string())});
      return;
    }
    if (std::ranges::find(folders, canonical) == folders.end()) folders.push_back(canonical);
  };
  for (const fs::path& folder : search.folders) add(folder, true);
  if (const char* list = search.environment ? std::getenv("CAIRN_PLUGIN_PATH") : nullptr) {
    std::istringstream stream(list);
    for (std::string folder; std::getline(stream, folder, ':');) {
      if (folder.empty()) continue;  // an empty part would mean the working directory
      if (fs::path(folder).is_relative()) {
        problems.push_back(
            {folder, folder + ": refused, CAIRN_PLUGIN_PATH takes absolute folders only"});
        continue;
      }
      add(folder, true);
    }
  }
  if (search.user_folder) {
    if (const fs::path folder = user_folder(); belongs_to_another(folder))
      problems.push_back({folder, folder.string() + ": refused, it belongs to another user"});
    else
      add(folder, false);
  }
  if (search.default_folder) add(default_folder(), false);
  return folders;
}

const PluginManifest& load_plugin(const fs::path& library) {
  std::error_code error;
  const fs::path path = fs::canonical(library, error);
  if (error == std::errc::not_enough_memory) throw std::bad_alloc();
  if (error) throw plugin_error(fmt::format("{}: {}", library.string(), error.message()));
  auto& libraries = loaded_libraries();
  auto it = libraries.find(path);
  if (it == libraries.end()) {
    if (others_may_write(path) || !open_to_others(path.parent_path()).empty()) {
      throw plugin_error(fmt::format(
          "{}: refused, since other users may write to it or its folder; 'chmod o-w' them",
          library.string()));
    }
    if (!fs::equivalent(path.parent_path(), default_folder(), error)) expect_to_open(path);
    boost::dll::shared_library opened = open_library(path);
    if (!opened.has(CAIRN_STRINGIFY(CAIRN_PLUGIN_ENTRY))) {
      throw plugin_error(
          fmt::format("{}: not a plugin of cairn: it has no entry point {}; build it with "
                      "cairn_add_plugin()",
                      library.string(), CAIRN_STRINGIFY(CAIRN_PLUGIN_ENTRY)));
    }
    it = libraries.emplace(path, std::move(opened)).first;
  }
  const PluginManifest* manifest =
      it->second.get<PluginEntry>(CAIRN_STRINGIFY(CAIRN_PLUGIN_ENTRY))();
  if (std::string_view(manifest->fingerprint) != core_fingerprint()) {
    throw plugin_error(library.string() + ": " + difference(manifest->fingerprint));
  }
  expect_layers(library, *manifest);
  return *manifest;
}

}  // namespace cairn
