// SPDX-License-Identifier: BSD-3-Clause
// What holds of every component: its table of options is complete, and it can be made with each
// choice.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "cairn/conformance/checker.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"
#include "own_checks.hpp"

namespace cairn::conformance {
namespace {

bool plain_name(std::string_view name) {
  return !name.empty() && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
  });
}

/// What an option's value reads as, whatever its type.
std::string read_back(const Options& options, const OptionSpec& spec) {
  if (options.absent(spec.name)) return {};
  switch (spec.type) {
    case OptionType::boolean:
      return option_text(options.boolean(spec.name));
    case OptionType::integer:
      return option_text(options.integer(spec.name));
    case OptionType::real:
      return option_text(options.real(spec.name));
    case OptionType::text:
    case OptionType::choice:
    case OptionType::component:
      return options.text(spec.name);
  }
  return {};
}

void check_spec(const OptionSpec& spec, const OptionTable& table, const Subject& subject,
                Checker& check) {
  const std::string name = spec.name;
  check.describe(fmt::format("option '{}'", name));
  check.expect(plain_name(name), "names of options are of a-z, 0-9 and _",
               [&] { return fmt::format("'{}'", name); });
  check.expect(!spec.help.empty() && spec.help.find('\n') == std::string::npos,
               "every option has a line of help", [&] { return fmt::format("'{}'", spec.help); });
  if (spec.type == OptionType::choice) {
    const bool is_absent = spec.optional && spec.default_value.empty();
    check.expect(
        is_absent || std::ranges::find(spec.choices, spec.default_value) != spec.choices.end(),
        "the default is one of the choices",
        [&] { return fmt::format("it is '{}'", spec.default_value); });
  }
  if (spec.type == OptionType::component) {
    check.expect(std::ranges::all_of(spec.choices, plain_name),
                 "the kinds of an option for a component are of a-z, 0-9 and _",
                 [&] { return spec.choices.empty() ? "none" : spec.choices.front(); });
  }
  // The default, written down, is the default.
  const auto values_with = [&](const std::string& value) {
    return Options(table, {{name, value}}, subject.name);
  };
  check.call("Options", [&] {
    const std::string implied = read_back(Options(table, {}, subject.name), spec),
                      given = read_back(values_with(spec.default_value), spec),
                      again = read_back(values_with(given), spec);
    check.expect(implied == given && given == again, "values of options round-trip as text",
                 [&] { return fmt::format("'{}', '{}', '{}'", implied, given, again); });
    for (const double bound : {spec.minimum, spec.maximum}) {
      if (!std::isfinite(bound)) continue;
      if (spec.type == OptionType::real) static_cast<void>(values_with(option_text(bound)));
    }
  });
}

/// Seconds that making a component may take: far more than any of cairn's own needs, and little
/// enough for a user not to notice.
constexpr double kMakingSeconds = 0.5;

/// The least of several times, so that a busy machine is no finding; one quick time is enough.
void check_time(std::string_view kind, const Subject& subject, Checker& check) {
  check.sample("no options", [&] {
    double least = std::numeric_limits<double>::infinity();
    check.call("the factory", [&] {
      for (int k = 0; k < 3 && least > kMakingSeconds; ++k) {
        const auto begin = std::chrono::steady_clock::now();
        try {
          static_cast<void>(subject.registry.make_any(kind, {subject.name, {}}));
        } catch (const Error&) {  // a finding of its own
        }
        least = std::min(least, seconds_since(begin));
      }
    });
    check.expect(least <= kMakingSeconds, "it is made quickly", [&] {
      return fmt::format("it takes {:.2g} s, and every run that uses it waits for that", least);
    });
  });
}

}  // namespace

void check_options(const Subject& subject, std::string_view kind, Checker& check) {
  const OptionTable& table = subject.registry.options(kind, subject.name);
  for (const OptionSpec& spec : table.specs()) {
    check.sample("", [&] { check_spec(spec, table, subject, check); });
  }
  if (kind == "types") return;
  const auto make = [&](const OptionValues& values, std::string_view law) {
    check.expect(true, law, [] { return std::string(); });
    try {
      std::unique_ptr<Component> component =
          subject.registry.make_any(kind, {subject.name, values});
      check.announce("the destructor");
      component.reset();
    } catch (const Error& error) {
      // A choice may be one that this build or machine refuses, as long as it says so.
      if (values.empty() || error.code() == ErrorCode::plugin) check.fail(law, error.what());
    }
  };
  check.sample("no options", [&] {
    check.call("the factory", [&] { make({}, "it can be made with its defaults"); });
  });
  check_time(kind, subject, check);
  for (const OptionSpec& spec : table.specs()) {
    std::vector<std::string> values{spec.default_value};
    if (spec.type == OptionType::choice) values = spec.choices;
    if (spec.type == OptionType::boolean) values = {"true", "false"};
    for (const std::string& value : values) {
      if (spec.type == OptionType::component || value.find(',') != std::string::npos) continue;
      check.sample(fmt::format("{}:{}={}", subject.name, spec.name, value), [&] {
        check.call("the factory", [&] {
          make({{spec.name, value}}, "it can be made with every choice of its options");
        });
      });
    }
  }
}

}  // namespace cairn::conformance
