// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/other_input.hpp"

#include <filesystem>

#include "cairn/io/format_by_ending.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/graph_files.hpp"

namespace cairn::app {

std::unique_ptr<OtherInput> other_input(const std::string& name, Session& session) {
  Registry& registry = session.registry();
  const bool generated = name.starts_with('@');
  const std::string kind = generated ? name.substr(1) : "";
  // Graphs first: what else there may be need not be loaded for one.
  if (generated ? registry.has(Generator::kKind, kind.substr(0, kind.find(':')))
                : has_graph_ending(name, registry))
    return nullptr;
  for (const std::string& other : registry.names(OtherInput::kKind)) {
    auto input = registry.make<OtherInput>(other);
    if (generated ? input->generates(kind, session) : input->names_file(name, session))
      return input;
  }
  return nullptr;
}

Error no_graph(const std::string& file, const Error& refusal, Session& session) {
  try {
    if (!std::filesystem::is_regular_file(parse_named_file(file).file)) return refusal;
    for (const std::string& other : session.registry().names(OtherInput::kKind)) {
      Error said = session.registry().make<OtherInput>(other)->no_graph(file, refusal, session);
      if (std::string_view(said.what()) != refusal.what()) return said;
    }
  } catch (const Error&) {  // of a plugin that is broken
  }
  return refusal;
}

}  // namespace cairn::app
