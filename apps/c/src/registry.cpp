// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <filesystem>

#include "cairn/plugin/plugin_search.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/runtime/version.hpp"
#include "calls.hpp"
#include "objects.hpp"

using namespace cairn::c;

namespace {

/// Elsewhere a folder that is missing matters to those alone who ask for its plugins; here it was
/// named.
void expect_folders(const cairn::Registry& registry,
                    const std::vector<std::filesystem::path>& folders) {
  for (const cairn::PluginProblem& problem : registry.problems()) {
    if (std::ranges::find(folders, problem.where) != folders.end())
      throw cairn::Error(cairn::ErrorCode::plugin, problem.message);
  }
}

}  // namespace

const char* cairn_version(void) { return CAIRN_VERSION; }

cairn_code cairn_set_threads(int count) {
  return guarded([&] { cairn::set_threads(count); });
}

cairn_code cairn_registry_new(const char* const* folders, size_t folder_count,
                              cairn_registry** registry) {
  return guarded([&] {
    given(registry, "registry");
    cairn::PluginSearch search;
    for (const char* folder : array(folders, folder_count, "folders"))
      search.folders.emplace_back(&given(folder, "a folder"));
    auto made = std::make_unique<cairn_registry>();
    made->registry = std::make_shared<cairn::Registry>(search);
    expect_folders(*made->registry, search.folders);
    hand_out(registry, std::move(made));
  });
}

void cairn_registry_free(cairn_registry* registry) { delete registry; }

cairn_code cairn_registry_names(cairn_registry* registry, const char* kind, const char** names) {
  return guarded([&] {
    cairn_registry& from = given(registry, "registry");
    given(names, "names");
    from.text = joined(from.registry->names(&given(kind, "kind")));
    *names = from.text.c_str();
  });
}

cairn_code cairn_registry_set_type_options(cairn_registry* registry, const char* spec) {
  return guarded([&] {
    given(registry, "registry")
        .registry->set_type_options(cairn::parse_component(&given(spec, "spec")));
  });
}
