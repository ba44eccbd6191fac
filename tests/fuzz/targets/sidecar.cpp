// SPDX-License-Identifier: BSD-3-Clause
// The JSON file beside a plugin: a folder holds the input as a manifest, and no shared object.
// Whatever it contains, the registry lists it or reports a problem, names nothing outside the
// folder, and refuses what is asked for with an error of the plugin.
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>

#include "cairn/plugin/plugin_search.hpp"
#include "cairn/runtime/error.hpp"
#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {
namespace {

constexpr std::size_t kMostAsked = 4;

/// Made once, and named to every registry from then on.
const std::filesystem::path& folder() {
  static const std::filesystem::path made = [] {
    std::filesystem::path path = scratch_folder() + "/plugins";
    std::filesystem::create_directory(path);
    ::chmod(path.c_str(), 0700);
    return std::filesystem::canonical(path);
  }();
  return made;
}

/// Of that folder alone. The variable is read by the constructor, and by no other thread.
Registry registry_of_folder() {
  ::setenv("CAIRN_PLUGIN_PATH", folder().c_str(), 1);
  struct Restore {
    ~Restore() { ::unsetenv("CAIRN_PLUGIN_PATH"); }
  } const restore;
  return Registry(PluginSearch{
      .files = {}, .environment = true, .user_folder = false, .default_folder = false});
}

void expect_refused(Registry& plugins, const Offer& offer) {
  try {
    plugins.options(offer.kind, offer.name);
  } catch (const Error& error) {
    expect(error.code() == ErrorCode::plugin,
           [&] { return fmt::format("not an error of the plugin: {}", error.what()); });
    return;
  }
  throw Finding(
      fmt::format("{} '{}' of a plugin that is not there was given out", offer.kind, offer.name));
}

void run(Bytes bytes) {
  const std::string_view text = text_of(bytes);
  std::ofstream(folder() / "input.json", std::ios::binary | std::ios::trunc) << text;
  Registry plugins = registry_of_folder();
  const std::vector<Offer> offers = plugins.offers();
  expect(offers.empty() || text.find("offers") != std::string_view::npos ||
             text.find('\\') != std::string_view::npos,
         [] { return "offers of a manifest that has none"; });
  std::size_t asked = 0;
  for (const Offer& offer : offers) {
    expect(offer.file.parent_path() == folder() && offer.file.has_filename() &&
               offer.file.filename() != "." && offer.file.filename() != ".." &&
               offer.file.native().find('\0') == std::string::npos,
           [&] { return "a plugin outside its folder: " + offer.file.string(); });
    if (asked++ < kMostAsked) expect_refused(plugins, offer);
  }
  for (const PluginProblem& problem : plugins.problems())
    expect(!problem.message.empty(), [] { return "a problem without a message"; });
}

std::vector<std::string> seeds() {
  const std::string head = R"({"name":"a","version":"1","licence":"b","description":"c",)";
  const std::string offer = R"({"kind":"optimizer","name":"x","summary":"y"})";
  return {head + R"("file":"a.so","offers":[)" + offer + "]}",
          head + R"("file":"a.so","offers":[]})",
          head + R"("file":"a.so","offers":[)" + offer + "," + offer + "]}",
          head + R"("file":"../a.so","offers":[)" + offer + "]}",
          head + R"("file":"..","offers":[)" + offer + "]}",
          head + R"("file":"","offers":[)" + offer + "]}",
          head + R"("file":"a.so","offers":[{"kind":1}]})",
          head + R"("file":"a\u0000.so","offers":[)" + offer + "]}",
          R"({"name":"a","offers":{}})",
          "[]",
          "{",
          ""};
}

std::vector<std::string> words() {
  return {R"("name":)",
          R"("version":)",
          R"("licence":)",
          R"("description":)",
          R"("file":)",
          R"("offers":)",
          R"("kind":)",
          R"("summary":)",
          "variable",
          "factor",
          "types",
          "optimizer",
          "..",
          "/",
          "\\u0000",
          "input.json",
          "null",
          "1e308"};
}

}  // namespace

Target sidecar() { return {"sidecar", &run, &seeds, &words, {}, 1024}; }

}  // namespace cairn::fuzz
