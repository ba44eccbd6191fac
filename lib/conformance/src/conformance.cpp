// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/conformance/conformance.hpp"

#include <algorithm>
#include <exception>
#include <new>
#include <set>
#include <utility>

#include <fmt/core.h>

#include "cairn/conformance/checker.hpp"
#include "cairn/runtime/error.hpp"
#include "own_checks.hpp"

namespace cairn {
namespace {

using namespace conformance;

constexpr std::string_view kOptionsGroup = "options";

/// Of kinds that the core and this library know here, of others from the plugin that has them.
std::span<const Group> groups_of(std::string_view kind, Registry& registry) {
  if (kind == "variable") return variable_groups();
  if (kind == "factor") return factor_groups();
  if (kind == "loss") return loss_groups();
  if (kind == "linear_solver") return linear_solver_groups();
  if (kind == "optimizer") return optimizer_groups();
  if (kind == "estimator") return estimator_groups();
  if (kind == "initial_guess") return initial_guess_groups();
  if (kind == "format") return format_groups();
  if (kind == "generator") return generator_groups();
  if (!registry.has(KindChecks::kKind, kind)) return {};
  return registry.make<KindChecks>(kind)->groups();
}

/// A type has no options of its own: those are of its set (kind "types").
bool has_options(std::string_view kind) { return kind != "variable" && kind != "factor"; }

std::string plural(std::int64_t count, std::string_view noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

std::string in_words(std::string kind) {
  std::ranges::replace(kind, '_', ' ');
  return kind;
}

/// Every choice of its options but the defaults, one at a time: "dogleg:step=subspace". An option
/// called `loss` is left out: it is for another minimum.
std::vector<std::string> other_choices(const ConformanceCase& which, Registry& registry) {
  std::vector<std::string> specs;
  for (const OptionSpec& spec : registry.options(which.kind, which.name).specs()) {
    std::vector<std::string> values;
    if (spec.type == OptionType::choice) values = spec.choices;
    if (spec.type == OptionType::boolean) values = {"true", "false"};
    for (const std::string& value : values) {
      if (value != spec.default_value && spec.name != "loss")
        specs.push_back(fmt::format("{}:{}={}", which.name, spec.name, value));
    }
  }
  return specs;
}

/// The group for the component as each choice of its options makes it.
void run_with_choices(const ConformanceCase& which, const Group& group, Registry& registry,
                      Checker& check) {
  for (const std::string& spec : other_choices(which, registry)) {
    check.set_component(spec);
    check.describe("");
    try {
      group.run({registry, spec}, check);
    } catch (const Abandoned&) {  // before the first sample: the finding stands
    } catch (const Error& error) {
      // A choice may be one that this build or machine refuses, as long as it says so.
      if (error.code() == ErrorCode::plugin) check.fail("it can be made", error.what());
    }
  }
}

}  // namespace

ConformanceObserver::~ConformanceObserver() = default;

std::vector<ConformanceCase> conformance_cases(std::span<const Offer> offers, Registry& registry) {
  std::vector<ConformanceCase> cases;
  for (const Offer& offer : offers) {
    for (const Group& group : groups_of(offer.kind, registry))
      cases.push_back({offer.kind, offer.name, std::string(group.name)});
    if (has_options(offer.kind))
      cases.push_back({offer.kind, offer.name, std::string(kOptionsGroup)});
  }
  return cases;
}

ConformanceResult check_conformance(const ConformanceCase& which, Registry& registry,
                                    const ConformanceOptions& options,
                                    ConformanceObserver* observer) {
  ConformanceResult result{which, 0, {}, {}};
  Checker check(result, options, observer);
  const Subject subject{registry, which.name};
  const std::span<const Group> groups = groups_of(which.kind, registry);
  const auto group = std::ranges::find(groups, which.group, &Group::name);
  const bool of_options = which.group == kOptionsGroup && has_options(which.kind);
  if (group == groups.end() && !of_options) {
    throw Error(ErrorCode::usage,
                fmt::format("there is no group '{}' of checks of kind '{}'; conformance_cases "
                            "lists all",
                            which.group, which.kind));
  }
  try {
    if (observer) observer->on_call("the factory", "");
    if (of_options)
      check_options(subject, which.kind, check);
    else
      group->run(subject, check);
    if (!of_options && !group->of_defaults && has_options(which.kind))
      run_with_choices(which, *group, registry, check);
  } catch (const Abandoned&) {  // before the first sample: the finding stands
  } catch (const Error& error) {
    ++result.checks;
    check.fail("it can be made", error.what());
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    ++result.checks;
    check.fail("it throws nothing but Error", error.what());
  }
  return result;
}

std::vector<ConformanceResult> check_conformance(std::string_view plugin, Registry& registry,
                                                 const ConformanceOptions& options) {
  std::vector<Offer> own;
  std::set<std::string> plugins;
  for (Offer& offer : registry.offers()) {
    plugins.insert(offer.plugin);
    if (offer.plugin == plugin) own.push_back(std::move(offer));
  }
  if (own.empty()) {
    std::string others;
    for (const std::string& other : plugins) others += (others.empty() ? "" : ", ") + other;
    throw Error(ErrorCode::plugin, fmt::format("there is no plugin '{}'; found: {}", plugin,
                                               others.empty() ? "none" : others));
  }
  std::vector<ConformanceResult> results;
  for (const ConformanceCase& one : conformance_cases(own, registry))
    results.push_back(check_conformance(one, registry, options));
  return results;
}

std::string to_text(const ConformanceResult& result) {
  const auto& [kind, name, group] = result.checked;
  std::string text = fmt::format("{} '{}', {}: ", in_words(kind), name, group);
  if (result.checks == 0 && result.ok()) {  // nothing of it applies, or it measures a time
    for (std::size_t k = 0; k < result.notes.size(); ++k)
      text += (k == 0 ? "" : "; ") + result.notes[k];
    return text + (result.notes.empty() ? "no checks" : "");
  }
  text += plural(result.checks, "check");
  if (!result.ok()) text += fmt::format(", {}", plural(std::ssize(result.findings), "finding"));
  for (const ConformanceFinding& finding : result.findings) {
    text += fmt::format("\n  does not hold: {}{}\n    {}", finding.law,
                        finding.times > 1 ? fmt::format(" ({} times)", finding.times) : "",
                        finding.problem);
    if (!finding.input.empty()) text += "\n    with " + finding.input;
  }
  for (const std::string& note : result.notes) text += "\n  note: " + note;
  return text;
}

}  // namespace cairn
