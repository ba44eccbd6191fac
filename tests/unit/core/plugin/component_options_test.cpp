// SPDX-License-Identifier: BSD-3-Clause
// The options of every component on offer, plugins of third parties included.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <set>
#include <string>

#include "cairn/plugin/plugin_search.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

/// Calls back with each component that has options, and its table.
void for_each_component(const std::function<void(const Offer&, const OptionTable&)>& call) {
  Registry registry;
  for (const Offer& offer : registry.offers()) {
    if (offer.kind == "variable" || offer.kind == "factor") continue;  // their plugin has them
    SCOPED_TRACE(offer.kind + " " + offer.name);
    call(offer, registry.options(offer.kind, offer.name));
  }
}

TEST(ComponentOptions, DefaultsParseBackToThemselves) {
  int seen = 0;
  for_each_component([&](const Offer& offer, const OptionTable& table) {
    const Options defaults(table, {}, offer.name);
    OptionValues written;
    for (const OptionSpec& spec : table.specs()) written[spec.name] = spec.default_value;
    const Options read(table, written, offer.name);
    for (const OptionSpec& spec : table.specs()) {
      SCOPED_TRACE(spec.name);
      ++seen;
      switch (spec.type) {
        case OptionType::boolean:
          EXPECT_EQ(option_text(defaults.boolean(spec.name)), spec.default_value);
          break;
        case OptionType::integer:
          EXPECT_EQ(defaults.absent(spec.name), spec.default_value.empty());
          if (defaults.absent(spec.name)) break;
          EXPECT_EQ(option_text(defaults.integer(spec.name)), spec.default_value);
          break;
        case OptionType::real:
          EXPECT_EQ(defaults.absent(spec.name), spec.default_value.empty());
          if (defaults.absent(spec.name)) break;
          EXPECT_EQ(option_text(defaults.real(spec.name)), spec.default_value);
          break;
        case OptionType::component:
          for (const std::string& name : split_components(spec.default_value)) {
            if (name.empty()) continue;  // none is chosen
            const ComponentSpec chosen = parse_component(name);
            EXPECT_EQ(parse_component(to_text(chosen)).values, chosen.values);
          }
          [[fallthrough]];
        case OptionType::choice:
        case OptionType::text:
          EXPECT_EQ(defaults.text(spec.name), spec.default_value);
          EXPECT_EQ(read.text(spec.name), spec.default_value);
          break;
      }
      EXPECT_FALSE(defaults.given(spec.name));
      EXPECT_TRUE(read.given(spec.name));
    }
  });
  EXPECT_GT(seen, 100);
}

TEST(ComponentOptions, HaveANameAndALineOfHelpEach) {
  for_each_component([](const Offer&, const OptionTable& table) {
    std::set<std::string> names;
    for (const OptionSpec& spec : table.specs()) {
      EXPECT_TRUE(names.insert(spec.name).second) << spec.name;
      EXPECT_FALSE(spec.help.empty()) << spec.name;
      EXPECT_EQ(spec.help.find('\n'), std::string::npos) << spec.name;
      EXPECT_LT(spec.minimum, spec.maximum) << spec.name;
    }
  });
}

}  // namespace
}  // namespace cairn
