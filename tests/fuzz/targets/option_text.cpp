// SPDX-License-Identifier: BSD-3-Clause
// Components as they are named on a command line: what is parsed is written as a text that parses
// as the same, and every component that can be made of such a text is made, or refused with what
// would work.
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "cairn/graph/graph.hpp"
#include "cairn/io/format.hpp"
#include "cairn/plugin/plugin_search.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/types/loss.hpp"
#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {
namespace {

/// Kinds whose components are made: none of these has an option that names a file or that allots
/// memory by its size.
constexpr std::array<std::string_view, 5> kMade = {Optimizer::kKind, Estimator::kKind, Loss::kKind,
                                                   InitialGuess::kKind, LinearSolver::kKind};

void expect_bad_call(const Error& error) {
  expect((error.code() == ErrorCode::usage || error.code() == ErrorCode::plugin) &&
             *error.what() != '\0',
         [&] { return fmt::format("refused by: {}", error.what()); });
}

std::optional<ComponentSpec> parsed(std::string_view text) {
  try {
    return parse_component(text);
  } catch (const Error& error) {
    expect_bad_call(error);
    return std::nullopt;
  }
}

void expect_same_text(const ComponentSpec& spec) {
  std::string text;
  try {
    text = to_text(spec);
  } catch (const Error& error) {
    throw Finding(fmt::format("parsed, but cannot be written: {}", error.what()));
  }
  const std::optional<ComponentSpec> again = parsed(text);
  expect(again && again->name == spec.name && again->values == spec.values,
         [&] { return "written as what is not the same: " + text; });
}

/// The values are within what the table declares.
void expect_in_range(const OptionTable& table, const Options& options) {
  for (const OptionSpec& spec : table.specs()) {
    if (options.absent(spec.name)) {
      expect(spec.optional, [&] { return spec.name + " is absent"; });
      continue;
    }
    const auto is_allowed = [&](double value) {
      return (value >= spec.minimum && value <= spec.maximum) || (spec.or_zero && value == 0.0);
    };
    switch (spec.type) {
      case OptionType::boolean:
        options.boolean(spec.name);
        break;
      case OptionType::integer: {
        const auto value = static_cast<double>(options.integer(spec.name));
        expect(is_allowed(value), [&] { return fmt::format("{} is {}", spec.name, value); });
        break;
      }
      case OptionType::real: {
        const double value = options.real(spec.name);
        expect(is_allowed(value), [&] { return fmt::format("{} is {}", spec.name, value); });
        break;
      }
      case OptionType::choice:
        expect(std::ranges::count(spec.choices, options.text(spec.name)) == 1,
               [&] { return fmt::format("{} is '{}'", spec.name, options.text(spec.name)); });
        break;
      default:
        options.text(spec.name);
    }
  }
}

/// Null where there is no such name, or its plugin was not built.
const OptionTable* options_of(std::string_view kind, std::string_view name) {
  if (!registry().has(kind, name)) return nullptr;
  try {
    return &registry().options(kind, name);
  } catch (const Error& error) {
    expect(error.code() == ErrorCode::plugin,
           [&] { return fmt::format("refused by: {}", error.what()); });
    return nullptr;
  }
}

void check_options(std::string_view kind, const ComponentSpec& spec) {
  const OptionTable* table = options_of(kind, spec.name);
  if (!table) return;
  try {
    expect_in_range(*table, Options(*table, spec.values, spec.name));
  } catch (const Error& error) {
    expect(error.code() == ErrorCode::usage,
           [&] { return fmt::format("refused by: {}", error.what()); });
  }
}

void make(std::string_view kind, const ComponentSpec& spec) {
  try {
    if (kind == Optimizer::kKind) registry().make<Optimizer>(spec);
    if (kind == Estimator::kKind) registry().make<Estimator>(spec);
    if (kind == Loss::kKind) registry().make<Loss>(spec);
    if (kind == InitialGuess::kKind) registry().make<InitialGuess>(spec);
    if (kind == LinearSolver::kKind) registry().make<LinearSolver>(spec);
  } catch (const Error& error) {
    expect_bad_call(error);
  }
}

/// Every kind that is on offer.
const std::vector<std::string>& kinds() {
  static const std::vector<std::string> all = [] {
    std::vector<std::string> found;
    for (const Offer& offer : registry().offers()) {
      if (found.empty() || found.back() != offer.kind) found.push_back(offer.kind);
    }
    return found;
  }();
  return all;
}

void run(Bytes bytes) {
  const std::string_view text = text_of(bytes);
  const std::vector<std::string> parts = split_components(text);
  for (const std::string& part : parts) {
    const std::optional<ComponentSpec> spec = parsed(part);
    if (!spec) continue;
    expect_same_text(*spec);
    for (const std::string& kind : kinds()) check_options(kind, *spec);
    for (const std::string_view kind : kMade) {
      if (registry().has(kind, spec->name)) make(kind, *spec);
    }
  }
  // A name that is not there is refused with what is.
  if (text.size() < 32) make(Optimizer::kKind, {.name = std::string(text), .values = {}});
}

std::vector<std::string> seeds() {
  std::vector<std::string> all = {"a",  "a:b=c", "a:b=c,d=e,f", "a:b=c,",    ":",
                                  "a:", "a:=b",  "a:b=c,b=d",   "x:y=z:u=v", "a,b:c=d,e=f,g"};
  for (const std::string& kind : kinds()) {
    for (const std::string& name : registry().names(kind)) {
      const OptionTable* table = options_of(kind, name);
      if (!table) continue;
      std::string text = name;
      char before = ':';
      for (const OptionSpec& option : table->specs()) {
        text += fmt::format("{}{}={}", before, option.name, option.default_value);
        before = ',';
      }
      all.push_back(text);
    }
  }
  return all;
}

std::vector<std::string> words() {
  std::vector<std::string> all = {":",   ",",   "=",   "true", "false",
                                  "yes", "nan", "inf", "-inf", "1e9",
                                  "1e-", "0x1", "+",   "-",    "9223372036854775807"};
  for (const std::string& kind : kinds()) {
    for (const std::string& name : registry().names(kind)) {
      const OptionTable* table = options_of(kind, name);
      if (!table) continue;
      all.push_back(name + ":");
      for (const OptionSpec& option : table->specs()) {
        all.push_back(option.name + "=");
        for (const std::string& choice : option.choices) all.push_back(choice);
      }
    }
  }
  std::ranges::sort(all);
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

}  // namespace

Target option_text() { return {"option_text", &run, &seeds, &words, {}, 256}; }

}  // namespace cairn::fuzz
