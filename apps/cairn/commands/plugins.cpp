// SPDX-License-Identifier: BSD-3-Clause
// cairn plugins [NAME]: what is on offer. The list opens no plugin; one name's options load that
// plugin. With --check FILE: plugin_check.cpp.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/core.h>

#include "cairn/io/format.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/linear/iterative_solver.hpp"
#include "cairn/linear/jacobian.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/linear/marginals.hpp"
#include "cairn/plugin/plugin_search.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/text/spelling.hpp"
#include "cairn/types/loss.hpp"
#include "plugin_check.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

// List
// ---------------------------------------------------------------------------------------------

std::string kind_in_words(std::string kind) {
  std::replace(kind.begin(), kind.end(), '_', ' ');
  return kind;
}

/// The kinds, and below each what is on offer.
std::string list_text(const std::vector<Offer>& offers, bool colour) {
  Table table({{"kind and name", Table::Align::left},
               {"", Table::Align::left},
               {"plugin", Table::Align::left, 2},
               {"licence", Table::Align::left, 1}});
  std::string last_kind;
  for (const Offer& offer : offers) {
    if (offer.kind != last_kind) table.add({kind_in_words(offer.kind)});
    table.add({"  " + offer.name, offer.summary, offer.file.filename().string(), offer.licence});
    last_kind = offer.kind;
  }
  return table.text(colour);
}

std::string problems_text(const Registry& registry, bool colour) {
  if (registry.problems().empty()) return "";
  std::string text = "\n" + bold("problems", colour) + "\n";
  for (const PluginProblem& problem : registry.problems()) {
    // Most messages begin with the file themselves.
    const std::string where = problem.where.string();
    const bool named = problem.message.find(where) != std::string::npos;
    text += fmt::format("  {}\n",
                        printable(named ? problem.message : where + ": " + problem.message, true));
  }
  return text;
}

json::object offer_json(const Offer& offer) {
  return {{"kind", offer.kind},      {"name", offer.name},          {"summary", offer.summary},
          {"plugin", offer.plugin},  {"file", offer.file.string()}, {"licence", offer.licence},
          {"version", offer.version}};
}

json::array problems_json(const Registry& registry) {
  json::array all;
  for (const PluginProblem& problem : registry.problems()) {
    all.push_back({{"where", problem.where.string()}, {"message", problem.message}});
  }
  return all;
}

/// Those of a kind, as `cairn plugins` or options name it: "linear solver", "linear_solver".
std::vector<Offer> offers_of_kind(const Registry& registry, const std::string& kind) {
  std::vector<Offer> offers = registry.offers();
  std::erase_if(offers, [&](const Offer& offer) {
    return kind_in_words(offer.kind) != kind && offer.kind != kind;
  });
  return offers;
}

int list(const std::vector<Offer>& offers, Session& session) {
  const Registry& registry = session.registry();
  json::object report = begin_report("plugins");
  json::array& all = report["offers"].emplace_array();
  for (const Offer& offer : offers) all.push_back(offer_json(offer));
  report["problems"] = problems_json(registry);
  session.write_json(report);
  session.print(list_text(offers, session.colour()) + problems_text(registry, session.colour()));
  return 0;
}

// One name
// -------------------------------------------------------------------------------------------

/// "an optimizer", "a linear solver"
std::string with_article(const std::string& noun) {
  const bool vowel = std::string_view("aeiou").find(noun.front()) != std::string_view::npos;
  return (vowel ? "an " : "a ") + noun;
}

/// "a generator or a floor plan"; of no kind in particular, "any component".
std::string kinds_text(const std::vector<std::string>& kinds) {
  std::vector<std::string> words;
  for (const std::string& kind : kinds) words.push_back(with_article(kind_in_words(kind)));
  return words.empty() ? "any component" : joined(words, " or ");
}

std::string type_text(const OptionSpec& spec) {
  switch (spec.type) {
    case OptionType::boolean:
      return "boolean";
    case OptionType::integer:
      return "integer";
    case OptionType::real:
      return "real";
    case OptionType::text:
      return "text";
    case OptionType::choice:
      return "choice";
    case OptionType::component:
      return "name of " + kinds_text(spec.choices);
  }
  return "";
}

std::string range_text(const OptionSpec& spec) {
  if (spec.type == OptionType::choice) return joined(spec.choices, " | ");
  const bool low = std::isfinite(spec.minimum), high = std::isfinite(spec.maximum);
  if (low && high) return fmt::format("{:g} … {:g}", spec.minimum, spec.maximum);
  if (low) return fmt::format("from {:g}", spec.minimum);
  return high ? fmt::format("up to {:g}", spec.maximum) : "";
}

/// "real, 0 … 1", "auto | portable", "name of a linear solver"
std::string value_text(const OptionSpec& spec) {
  const std::string range = range_text(spec);
  if (spec.type == OptionType::choice) return range;
  return range.empty() ? type_text(spec) : fmt::format("{}, {}", type_text(spec), range);
}

json::array options_json(const OptionTable& table) {
  json::array all;
  for (const OptionSpec& spec : table.specs()) {
    all.push_back({{"name", spec.name},
                   {"type", type_text(spec)},
                   {"default", spec.default_value},
                   {"minimum", number_json(spec.minimum)},
                   {"maximum", number_json(spec.maximum)},
                   {"choices", strings_json(spec.choices)},
                   {"help", spec.help}});
  }
  return all;
}

template <class Interface>
std::unique_ptr<Component> made(Registry& registry, const std::string& name) {
  return registry.make<Interface>(name);
}

/// A component with its default options; null for kinds that are no components.
std::unique_ptr<Component> make_component(Registry& registry, const Offer& offer) {
  if (offer.kind == LinearSolver::kKind) return made<LinearSolver>(registry, offer.name);
  if (offer.kind == Optimizer::kKind) return made<Optimizer>(registry, offer.name);
  if (offer.kind == InitialGuess::kKind) return made<InitialGuess>(registry, offer.name);
  if (offer.kind == Loss::kKind) return made<Loss>(registry, offer.name);
  if (offer.kind == Format::kKind) return made<Format>(registry, offer.name);
  if (offer.kind == Generator::kKind) return made<Generator>(registry, offer.name);
  return nullptr;
}

std::vector<std::string> format_abilities(const Format& format) {
  std::vector<std::string> all;
  if (format.can_read()) all.push_back("reads");
  if (format.can_write()) all.push_back("writes");
  for (const std::string& ending : format.extensions()) all.push_back("." + ending);
  return all;
}

std::vector<std::string> variable_abilities(const VariableType& type) {
  std::vector<std::string> all{fmt::format("{} degrees of freedom", type.tangent_size()),
                               fmt::format("{} numbers", type.ambient_size())};
  if (type.lie_group()) all.push_back("Lie group");
  if (const Placement* place = type.placement()) {
    all.push_back(
        fmt::format("{} in {}D", place->has_orientation() ? "pose" : "point", place->dimension()));
  }
  return all;
}

std::vector<std::string> factor_abilities(const FactorType& type) {
  const std::span<const std::string_view> tags = type.variable_tags();
  const std::vector<std::string> variables(tags.begin(), tags.end());
  std::vector<std::string> all{fmt::format("on {}", joined(variables, " ")),
                               fmt::format("measurement of {} numbers", type.measurement_size()),
                               fmt::format("{} residuals", type.residual_size())};
  if (type.is_relative()) all.push_back("relative pose");
  if (!type.metric().empty()) all.push_back(fmt::format("metric {}", type.metric()));
  return all;
}

/// What it can do besides what its kind promises.
std::vector<std::string> abilities(Registry& registry, const Offer& offer) {
  if (offer.kind == "variable") return variable_abilities(*registry.variable_type(offer.name));
  if (offer.kind == "factor") return factor_abilities(*registry.factor_type(offer.name));
  std::vector<std::string> all;
  const std::unique_ptr<Component> component = make_component(registry, offer);
  if (!component) return all;
  if (offer.kind == Format::kKind) all = format_abilities(static_cast<const Format&>(*component));
  for (const std::string_view ability :
       {LogDeterminant::kAbility, ManyRightHandSides::kAbility, EliminationOrder::kAbility,
        JacobianSolver::kAbility, Marginals::kAbility, IterativeSolver::kAbility}) {
    if (component->ability(ability)) all.emplace_back(ability);
  }
  return all;
}

/// Of a plugin that is loaded.
bool is_optimized(const Registry& registry, const Offer& offer) {
  const std::vector<std::string> slow = registry.unoptimized();
  return std::ranges::find(slow, offer.plugin) == slow.end();
}

std::string details_text(const Offer& offer, bool optimized, const OptionTable& options,
                         const std::vector<std::string>& abilities, bool colour) {
  const std::string title =
      fmt::format("{} ({}): {}", bold(offer.name, colour), printable(kind_in_words(offer.kind)),
                  printable(offer.summary));
  std::string text = joined(folded(title, output_width() - 2), "\n  ") + "\n";
  Table facts({{"", Table::Align::left}, {"", Table::Align::left}}, "  ");
  facts.add({"plugin", fmt::format("{} {}, {}", offer.plugin, offer.version, offer.file.string())});
  facts.add({"licence", offer.licence});
  if (!optimized) facts.add({"build", "unoptimised"});
  if (!abilities.empty()) facts.add({"abilities", joined(abilities, ", ")});
  if (options.specs().empty()) facts.add({"options", "none"});
  text += facts.text(false);
  if (options.specs().empty()) return text;
  Table table({{"option", Table::Align::left},
               {"default", Table::Align::left},
               {"value", Table::Align::left},
               {"meaning", Table::Align::left}},
              "  ");
  for (const OptionSpec& spec : options.specs()) {
    table.add({spec.name, spec.default_value, value_text(spec), spec.help});
  }
  return text + table.text(colour);
}

/// Everything of that name, whatever its kind, commands last; a plugin's name stands for all that
/// it offers.
std::vector<Offer> offers_named(const Registry& registry, const std::string& name) {
  const std::vector<Offer> all = registry.offers();
  std::vector<Offer> found, of_plugin, commands;
  std::vector<std::string> names;
  for (const Offer& offer : all) {
    if (offer.name == name) (offer.kind == Command::kKind ? commands : found).push_back(offer);
    if (offer.plugin == name) of_plugin.push_back(offer);
    names.push_back(offer.name);
    names.push_back(offer.plugin);
  }
  if (found.empty()) found = of_plugin;
  std::ranges::copy(commands, std::back_inserter(found));
  if (!found.empty()) return found;
  const std::string nearest = nearest_spelling(name, names);
  throw Error(ErrorCode::plugin, fmt::format("nothing of the name '{}' is on offer; {}", name,
                                             nearest.empty() ? "cairn plugins lists all"
                                                             : "did you mean '" + nearest + "'?"));
}

int show(const std::string& name, Session& session) {
  Registry& registry = session.registry();
  const std::vector<Offer> everything = registry.offers();
  const bool named = std::ranges::any_of(
      everything, [&](const Offer& offer) { return offer.name == name || offer.plugin == name; });
  if (const std::vector<Offer> kind = offers_of_kind(registry, name); !named && !kind.empty())
    return list(kind, session);
  json::object report = begin_report("plugins");
  json::array& all = report["offers"].emplace_array();
  std::string text;
  for (const Offer& offer : offers_named(registry, name)) {
    const OptionTable& options = registry.options(offer.kind, offer.name);
    const std::vector<std::string> can = abilities(registry, offer);
    json::object entry = offer_json(offer);
    const bool optimized = is_optimized(registry, offer);
    entry["optimized"] = optimized;
    entry["abilities"] = strings_json(can);
    entry["options"] = options_json(options);
    all.push_back(std::move(entry));
    text +=
        (text.empty() ? "" : "\n") + details_text(offer, optimized, options, can, session.colour());
  }
  report["problems"] = problems_json(registry);
  session.write_json(report);
  session.print(text);
  return 0;
}

struct PluginsOptions {
  std::string name;
  PluginCheckOptions check;

  static auto fields() {
    using O = PluginsOptions;
    using Check = PluginCheckOptions;
    return OptionFields<O>()
        .component("name", &O::name, {},
                   "a solver, type, format …: its options, abilities and limits; a kind: what it "
                   "has")
        .positional()
        .part(&O::check,
              OptionFields<Check>()
                  .text("check", &Check::files,
                        "run the conformance suite over these plugins, in child processes")
                  .placeholder("FILE...")
                  .takes_words()
                  .real("seconds", &Check::seconds, 0.1, 1e9,
                        "with --check, how long a group of checks may take")
                  .placeholder("S")
                  .integer("seed", &Check::seed, 0, kMostSeed,
                           "with --check, the seed of the random inputs"));
  }
};

int run(const PluginsOptions& options, Session& session) {
  if (!options.check.files.empty()) {
    if (!options.name.empty()) {
      throw Error(
          ErrorCode::usage,
          fmt::format("'{}' and --check are two questions; ask one at a time", options.name));
    }
    return check_plugins(options.check, session);
  }
  return options.name.empty() ? list(session.registry().offers(), session)
                              : show(options.name, session);
}

}  // namespace

void add_plugins(Registrar& registrar) {
  add_command<PluginsOptions>(
      registrar, "plugins",
      "Plugins are found by --plugin, CAIRN_PLUGIN_PATH, in the user's folder (cairn/plugins "
      "below\n"
      "XDG_DATA_HOME or ~/.local/share), and in the folder cairn beside the core library. A "
      "checked\n"
      "plugin, a file, finds others by --plugin and in the last alone. Exit code: 0; 5 if a check "
      "does\n"
      "not hold, or nothing was found.\n\n"
      "Example:\n"
      "  cairn plugins cholmod\n"
      "  cairn plugins --check build/range.so",
      run);
}

}  // namespace cairn::app
