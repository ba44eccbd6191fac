// SPDX-License-Identifier: BSD-3-Clause
#include "support/components.hpp"

#include <cctype>

#include "cairn/linear/jacobian.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/optimizer.hpp"

namespace cairn::test {
namespace {

bool can_be_made(Registry& registry, std::string_view kind, const std::string& spec) {
  try {
    if (kind == Optimizer::kKind) return registry.make<Optimizer>(spec) != nullptr;
    return registry.make<LinearSolver>(spec) != nullptr;
  } catch (const Error& error) {
    return error.code() != ErrorCode::usage;  // a broken plugin is for the tests to find
  }
}

/// Whether the build has the parts that a component takes by default.
bool has_its_parts(Registry& registry, std::string_view kind, const std::string& name) {
  for (const OptionSpec& option : registry.options(kind, name).specs()) {
    if (option.type != OptionType::component || option.default_value.empty()) continue;
    if (!registry.has(option.choices[0], parse_component(option.default_value).name)) return false;
  }
  return true;
}

/// A linear solver that leaves work to another: once with each other that is there and takes H (one
/// that works on the Jacobian cannot solve a part of the system).
void add_inner_solvers(Registry& registry, const std::string& name, const OptionSpec& option,
                       std::vector<std::string>& specs) {
  for (const std::string& inner : registry.names(option.choices[0])) {
    if (inner == name || inner == option.default_value) continue;
    if (!has_its_parts(registry, LinearSolver::kKind, inner)) continue;
    if (!can_be_made(registry, LinearSolver::kKind, inner)) continue;
    if (query<JacobianSolver>(*registry.make<LinearSolver>(inner))) continue;
    specs.push_back(name + ":" + option.name + "=" + inner);
  }
}

}  // namespace

std::vector<std::string> every_component(std::string_view kind) {
  Registry registry;
  std::vector<std::string> specs;
  for (const std::string& name : registry.names(kind)) {
    const bool by_itself = has_its_parts(registry, kind, name);
    if (by_itself) specs.push_back(name);
    for (const OptionSpec& option : registry.options(kind, name).specs()) {
      if (kind == LinearSolver::kKind && option.type == OptionType::component)
        add_inner_solvers(registry, name, option, specs);
      if (option.type != OptionType::choice || !by_itself) continue;
      for (const std::string& choice : option.choices) {
        if (choice == option.default_value || option.name == "loss") continue;
        std::string spec = name + ":" + option.name + "=" + choice;
        if (can_be_made(registry, kind, spec)) specs.push_back(std::move(spec));
      }
    }
  }
  return specs;
}

std::string with_some_linear_solver(const std::string& optimizer) {
  Registry registry;
  const OptionSpec* option =
      registry.options(Optimizer::kKind, parse_component(optimizer).name).find("linear_solver");
  if (!option || option->type != OptionType::component) return optimizer;
  if (registry.has(LinearSolver::kKind, option->default_value)) return optimizer;
  const std::vector<std::string> others = registry.names(LinearSolver::kKind);
  if (others.empty()) return {};
  const char separator = optimizer.find(':') == std::string::npos ? ':' : ',';
  return optimizer + separator + "linear_solver=" + others.front();
}

std::string test_name(const testing::TestParamInfo<std::string>& info) {
  std::string name = info.param;
  for (char& c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  }
  return name;
}

}  // namespace cairn::test
