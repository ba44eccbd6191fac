// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/option_fields.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "cairn/geometry/pose_chain.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

enum class Fruit { apple, pear, dried_plum };
constexpr auto enum_names(Fruit) {
  return std::to_array<EnumName<Fruit>>(
      {{Fruit::pear, "pear"}, {Fruit::apple, "apple"}, {Fruit::dried_plum, "prune"}});
}

struct Crate {
  static constexpr std::string_view kKind = "crate";
};

struct Shared {
  double tolerance = 1e-3;
  int iterations = 7;

  bool operator==(const Shared&) const = default;
  static auto fields() {
    return OptionFields<Shared>()
        .real("tolerance", &Shared::tolerance, 0.0, 1.0, "when it ends")
        .integer("iterations", &Shared::iterations, 1, 1e9, "at most");
  }
};

std::vector<double> numbers(const std::string& text) {
  if (text == "nonsense") throw Error(ErrorCode::usage, "basket: weights: no numbers");
  std::vector<double> result;
  for (std::size_t begin = 0; begin < text.size();) {
    std::size_t length = 0;
    result.push_back(std::stod(text.substr(begin), &length));
    begin += length;
  }
  return result;
}

std::string text_of(const std::vector<double>& numbers) {
  std::string text;
  for (const double number : numbers) text += (text.empty() ? "" : " ") + option_text(number);
  return text;
}

/// A field of every kind.
struct Basket {
  bool lid = true;
  int handles = 2;
  std::int64_t grams = 1500;
  std::uint64_t seed = 1;
  double price = 0.1;
  double limit = std::numeric_limits<double>::infinity();
  Fruit fruit = Fruit::pear;
  std::string label = "";
  std::string weave = "plain";
  std::string crate = "wooden";
  std::vector<double> weights{};
  Shared shared{.tolerance = 0.25};

  bool operator==(const Basket&) const = default;
  static auto fields() {
    using B = Basket;
    return OptionFields<B>()
        .boolean("lid", &B::lid, "whether it shuts")
        .integer("handles", &B::handles, -4, 4, "to carry it by")
        .integer("grams", &B::grams, 0, 1e15, "weight [g]")
        .integer("seed", &B::seed, 0, 1e15, "of the draw")
        .real("price", &B::price, 0.0, 1e6, "in full")
        .real("limit", &B::limit, 0.0, std::numeric_limits<double>::infinity(), "none by default")
        .choice("fruit", &B::fruit, "what lies in it")
        .text("label", &B::label, "what stands on it")
        .choice("weave", &B::weave, {"plain", "twill"}, "of the sides")
        .component<Crate>("crate", &B::crate, "where it goes")
        .text("weights", &B::weights, numbers, text_of, "of the pieces [g]")
        .part(&B::shared);
  }
};

/// Differs from the defaults in every field.
Basket another() {
  return {.lid = false,
          .handles = -3,
          .grams = 999'999'999'999'999,
          .seed = 123'456'789'012'345,
          .price = std::numbers::pi * 1e-7,
          .limit = 12.5,
          .fruit = Fruit::dried_plum,
          .label = "do not = drop: it",
          .weave = "twill",
          .crate = "iron:bars=3",
          .weights = {1.0 / 3.0, 2.0, -1e300},
          .shared = {.tolerance = 0.0, .iterations = 1'000'000'000}};
}

std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::usage);
    return error.what();
  }
  return "";
}

TEST(OptionFields, DefaultsAreThoseOfTheStruct) {
  const OptionTable table = Basket::fields().table();
  std::vector<std::string> defaults;
  for (const OptionSpec& spec : table.specs()) {
    defaults.push_back(spec.name + "=" + spec.default_value);
  }
  EXPECT_THAT(defaults, ElementsAre("lid=true", "handles=2", "grams=1500", "seed=1", "price=0.1",
                                    "limit=inf", "fruit=pear", "label=", "weave=plain",
                                    "crate=wooden", "weights=", "tolerance=0.25", "iterations=7"));
  EXPECT_EQ(from_values<Basket>({}, "basket"), Basket{});
}

TEST(OptionFields, TheTableIsThatWrittenByHand) {
  OptionTable by_hand;
  by_hand.boolean("lid", true, "whether it shuts")
      .integer("handles", 2, -4, 4, "to carry it by")
      .integer("grams", 1500, 0, 1e15, "weight [g]")
      .integer("seed", 1, 0, 1e15, "of the draw")
      .real("price", 0.1, 0.0, 1e6, "in full")
      .real("limit", std::numeric_limits<double>::infinity(), 0.0,
            std::numeric_limits<double>::infinity(), "none by default")
      .choice("fruit", "pear", {"pear", "apple", "prune"}, "what lies in it")
      .text("label", "", "what stands on it")
      .choice("weave", "plain", {"plain", "twill"}, "of the sides")
      .component("crate", "crate", "wooden", "where it goes")
      .text("weights", "", "of the pieces [g]")
      .real("tolerance", 0.25, 0.0, 1.0, "when it ends")
      .integer("iterations", 7, 1, 1e9, "at most");
  const OptionTable table = Basket::fields().table();
  EXPECT_EQ(table.help(), by_hand.help());
  ASSERT_EQ(table.specs().size(), by_hand.specs().size());
  for (std::size_t k = 0; k < table.specs().size(); ++k) {
    EXPECT_EQ(table.specs()[k].type, by_hand.specs()[k].type) << table.specs()[k].name;
  }
}

TEST(OptionFields, AStructComesBackFromItsText) {
  for (const Basket& basket : {Basket{}, another()}) {
    const ComponentSpec spec = to_spec("basket", basket);
    EXPECT_EQ(spec.values.size(), 13U);
    EXPECT_EQ(from_values<Basket>(spec.values, "basket"), basket);
    const ComponentSpec parsed = parse_component(to_text("basket", basket));
    EXPECT_EQ(parsed.name, "basket");
    EXPECT_EQ(from_values<Basket>(parsed.values, "basket"), basket);
  }
}

TEST(OptionFields, TextHoldsWhatDiffersFromTheDefaults) {
  EXPECT_EQ(to_text("basket", Basket{}), "basket");
  EXPECT_EQ(to_text("basket", Basket{.handles = 1, .shared = {.tolerance = 0.25, .iterations = 3}}),
            "basket:handles=1,iterations=3");
  // The part has another default here than by itself.
  EXPECT_EQ(to_text("basket", Basket{.shared = {}}), "basket:tolerance=0.001");
}

TEST(OptionFields, AComponentWithTwoOptionsFitsASpecButNotItsText) {
  const Basket basket{.crate = to_text("basket", Basket{.handles = 1, .grams = 3})};
  EXPECT_EQ(from_values<Basket>(to_spec("outer", basket).values, "outer"), basket);
  EXPECT_EQ(
      refusal([&] { to_text("outer", basket); }),
      "outer: option 'crate' is 'basket:grams=3,handles=1'; the form name:key=value,key=value "
      "cannot hold a value with a comma");
  EXPECT_THAT(refusal([] { to_text("a:b", Basket{}); }), HasSubstr("'a:b' is not a name"));
}

TEST(OptionFields, WhatIsWrongIsRefusedAsByATable) {
  const auto refused = [](const OptionValues& values) {
    return refusal([&] { from_values<Basket>(values, "basket"); });
  };
  EXPECT_EQ(refused({{"handles", "5"}}),
            "basket: option 'handles' is '5', expected an integer, -4 to 4");
  EXPECT_EQ(refused({{"tolerance", "-1"}}),
            "basket: option 'tolerance' is '-1', expected a number, 0 to 1");
  EXPECT_EQ(refused({{"lid", "perhaps"}}),
            "basket: option 'lid' is 'perhaps', expected true or false");
  EXPECT_EQ(refused({{"fruit", "prunes"}}),
            "basket: option 'fruit' cannot be 'prunes'; did you mean 'prune'? (on offer: pear, "
            "apple, prune)");
  EXPECT_THAT(refused({{"weave", "linen"}}), HasSubstr("option 'weave' cannot be 'linen'"));
  EXPECT_THAT(refused({{"handels", "1"}}),
              HasSubstr("basket has no option 'handels'; did you mean 'handles'?"));
  EXPECT_EQ(refused({{"weights", "nonsense"}}), "basket: weights: no numbers");
  // A struct can hold what its ranges do not allow; the options made of it are checked like others.
  EXPECT_EQ(refused(to_spec("basket", Basket{.handles = 9}).values),
            "basket: option 'handles' is '9', expected an integer, -4 to 4");
}

TEST(OptionFields, DeclarationsThatCannotBeRightAreProgrammingErrors) {
  struct Small {
    int number = 0;
    std::uint64_t seed = 0;
  };
  EXPECT_THROW(OptionFields<Small>().integer("number", &Small::number, 0, 1e12, ""),
               std::logic_error);
  EXPECT_THROW(OptionFields<Small>().integer("seed", &Small::seed, -1, 1, ""), std::logic_error);
  EXPECT_THROW(OptionFields<Small>()
                   .integer("number", &Small::number, 0, 1, "")
                   .integer("number", &Small::seed, 0, 1, "")
                   .table(),
               std::logic_error);
}

/// What commands declare besides: lists, what may be left out, and how it stands in a line of
/// words.
struct Delivery {
  std::vector<std::string> baskets;
  std::vector<std::string> carriers{"horse"};
  std::string route;
  std::string weather;
  std::string stops = "inn";
  std::optional<double> toll;
  std::optional<std::int64_t> day;
  int most = 0;

  static auto fields() {
    using D = Delivery;
    return OptionFields<D>()
        .text("baskets", &D::baskets, "what is sent")
        .positional()
        .required()
        .components("carrier", &D::carriers, {"animal", "cart"}, "who brings it")
        .separated_by(';')
        .text("route", &D::route, "by which way")
        .suggest({"hill", "ford"})
        .choice("weather", &D::weather, {"fair", "foul"}, "if it must be so")
        .optional()
        .components("stops", &D::stops, {"house"}, "on the way")
        .real("toll", &D::toll, 0.0, 10.0, "in silver")
        .integer("day", &D::day, 1, 31, "of the month")
        .letter('d')
        .placeholder("DAY")
        .integer("most", &D::most, 5, 9, "baskets a journey")
        .or_zero();
  }
};

TEST(OptionFields, WhatIsLeftOutIsAbsent) {
  const Delivery none = from_values<Delivery>({}, "delivery");
  EXPECT_THAT(none.baskets, ElementsAre());
  EXPECT_THAT(none.carriers, ElementsAre("horse"));
  EXPECT_EQ(none.toll, std::nullopt);
  EXPECT_EQ(none.day, std::nullopt);
  EXPECT_EQ(none.weather, "");
  EXPECT_EQ(none.most, 0);

  const Delivery given = from_values<Delivery>({{"baskets", list_text({"a b", "c,d"})},
                                                {"carrier", ""},
                                                {"route", "any"},
                                                {"weather", "foul"},
                                                {"toll", "2.5"},
                                                {"day", "31"},
                                                {"most", "9"}},
                                               "delivery");
  EXPECT_THAT(given.baskets, ElementsAre("a b", "c,d"));
  EXPECT_THAT(given.carriers, ElementsAre());
  EXPECT_EQ(given.route, "any");
  EXPECT_EQ(given.weather, "foul");
  EXPECT_EQ(given.toll, 2.5);
  EXPECT_EQ(given.day, 31);
  EXPECT_EQ(given.most, 9);
  const OptionValues values = Delivery::fields().values(given);
  const Delivery again = from_values<Delivery>(values, "delivery");
  EXPECT_EQ(Delivery::fields().values(again), values);
}

TEST(OptionFields, WhatIsGivenIsChecked) {
  const auto refused = [](const char* name, const char* value) {
    return refusal([&] { from_values<Delivery>({{name, value}}, "delivery"); });
  };
  EXPECT_EQ(refused("toll", "11"), "delivery: option 'toll' is '11', expected a number, 0 to 10");
  EXPECT_EQ(refused("day", "0"), "delivery: option 'day' is '0', expected an integer, 1 to 31");
  EXPECT_EQ(refused("most", "4"),
            "delivery: option 'most' is '4', expected an integer, 5 to 9, or 0");
  EXPECT_THAT(refused("weather", "fould"), HasSubstr("did you mean 'foul'?"));
}

TEST(OptionFields, SayHowTheyStandOnACommandLine) {
  const OptionTable table = Delivery::fields().table();
  const OptionSpec& baskets = *table.find("baskets");
  EXPECT_TRUE(baskets.list && baskets.form.positional && !baskets.form.named);
  EXPECT_TRUE(baskets.form.required);
  const OptionSpec& carrier = *table.find("carrier");
  EXPECT_TRUE(carrier.list && carrier.components && carrier.form.named);
  EXPECT_THAT(carrier.choices, ElementsAre("animal", "cart"));
  EXPECT_EQ(carrier.form.separator, ';');
  EXPECT_EQ(carrier.default_value, "horse");
  EXPECT_THAT(table.find("route")->choices, ElementsAre("hill", "ford"));
  EXPECT_TRUE(table.find("stops")->components && !table.find("stops")->list);
  EXPECT_EQ(table.find("day")->form.letter, 'd');
  EXPECT_EQ(table.find("day")->form.placeholder, "DAY");
  EXPECT_EQ(table.find("day")->default_value, "");
}

TEST(OptionFields, AListIsOneText) {
  for (const std::vector<std::string>& items :
       {std::vector<std::string>{}, {"a"}, {"a", "b c"}, {"a,b", ":", "\n"}})
    EXPECT_EQ(split_list(list_text(items)), items);
}

TEST(EnumNames, LeadBothWays) {
  EXPECT_EQ(to_string(Fruit::dried_plum), "prune");
  EXPECT_THAT(names_of_enum<Fruit>(), ElementsAre("pear", "apple", "prune"));
  for (const auto& [value, name] : enum_names(Fruit{})) {
    EXPECT_EQ(find_enum<Fruit>(name), value);
    EXPECT_EQ(parse_enum<Fruit>(name, "the fruit"), value);
  }
  EXPECT_EQ(find_enum<Fruit>("dried_plum"), std::nullopt);
  EXPECT_EQ(refusal([] { parse_enum<Fruit>("aple", "the fruit"); }),
            "the fruit cannot be 'aple'; did you mean 'apple'? (on offer: pear, apple, prune)");
  EXPECT_THROW(to_string(static_cast<Fruit>(9)), std::logic_error);
}

TEST(EnumNames, RecoveriesAreNamedAsInThePaper) {
  EXPECT_THAT(names_of_enum<Recovery>(), ElementsAre("v0", "v1", "v2", "likely"));
  EXPECT_EQ(parse_enum<Recovery>("v1", "the recovery"), Recovery::interpolate);
}

}  // namespace
}  // namespace cairn
