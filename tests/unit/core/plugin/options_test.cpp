// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/options.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

OptionTable table() {
  OptionTable t;
  t.boolean("verbose", false, "say more")
      .integer("iterations", 100, 1, 1000, "maximum number of iterations")
      .real("lambda", 1e-3, 0.0, std::numeric_limits<double>::infinity(), "first damping")
      .choice("ordering", "amd", {"amd", "natural"}, "fill-reducing ordering")
      .component("linear_solver", "linear_solver", "block_cholesky", "solver of the step");
  return t;
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

TEST(Options, FillInDefaults) {
  const Options options(table(), {}, "gauss_newton");
  EXPECT_FALSE(options.boolean("verbose"));
  EXPECT_EQ(options.integer("iterations"), 100);
  EXPECT_EQ(options.real("lambda"), 1e-3);
  EXPECT_EQ(options.text("ordering"), "amd");
  EXPECT_EQ(options.text("linear_solver"), "block_cholesky");
  EXPECT_FALSE(options.given("lambda"));
}

TEST(Options, TakeValuesAsWritten) {
  const Options options(table(), {{"lambda", "2.5e-1"}, {"verbose", "yes"}, {"iterations", "+7"}},
                        "gauss_newton");
  EXPECT_EQ(options.real("lambda"), 0.25);
  EXPECT_TRUE(options.boolean("verbose"));
  EXPECT_EQ(options.integer("iterations"), 7);
  EXPECT_TRUE(options.given("lambda"));
}

TEST(Options, RefuseAnUnknownNameWithTheNearest) {
  EXPECT_EQ(refusal([] {
              Options(table(), {{"lamda", "1"}}, "dogleg");
            }),
            "dogleg has no option 'lamda'; did you mean 'lambda'? (on offer: verbose, iterations, "
            "lambda, ordering, linear_solver)");
  EXPECT_EQ(refusal([] {
              Options(OptionTable{}, {{"x", "1"}}, "as_given");
            }),
            "as_given takes no options, but 'x' was given");
}

TEST(Options, RefuseWhatIsNotOfTheTypeOrOutOfRange) {
  for (const auto& entry :
       std::vector<std::pair<std::string, std::string>>{{"iterations", "0"},
                                                        {"iterations", "3.5"},
                                                        {"iterations", ""},
                                                        {"iterations", "99999999999999999999"},
                                                        {"lambda", "-1"},
                                                        {"lambda", "nan"},
                                                        {"lambda", "1e"},
                                                        {"verbose", "maybe"},
                                                        {"ordering", "metis"}}) {
    const std::string message = refusal([&] { Options(table(), {entry}, "lm"); });
    EXPECT_THAT(message, HasSubstr("option '" + entry.first + "'")) << entry.second;
    EXPECT_THAT(message, HasSubstr("'" + entry.second + "'"));
  }
  EXPECT_THAT(refusal([] {
                Options(table(), {{"iterations", "0"}}, "lm");
              }),
              HasSubstr("an integer, 1 to 1000"));
}

TEST(Options, AskingForWhatWasNotDeclaredIsAProgrammingError) {
  const Options options(table(), {}, "lm");
  EXPECT_THROW(options.real("no_such"), std::logic_error);
  EXPECT_THROW(options.real("iterations"), std::logic_error);
}

TEST(ComponentSpec, SplitsNameAndValues) {
  const ComponentSpec spec = parse_component("cholmod:ordering=metis,mode=auto");
  EXPECT_EQ(spec.name, "cholmod");
  EXPECT_EQ(spec.values.at("ordering"), "metis");
  EXPECT_EQ(spec.values.at("mode"), "auto");
  EXPECT_TRUE(parse_component("eigen").values.empty());
}

TEST(ComponentSpec, RefusesWhatIsMalformed) {
  for (const char* text : {"", ":a=1", "x:", "x:a", "x:=1", "x:a=1,", "x:a=1,,b=2", "x:a=1,a=2"}) {
    EXPECT_THAT(refusal([&] { parse_component(text); }),
                HasSubstr("the form is name or name:key=value,key=value"))
        << text;
  }
}

TEST(ComponentSpec, AListKeepsOptionsWithTheirComponent) {
  EXPECT_THAT(split_components("a,b:x=1,y=2,c"), ElementsAre("a", "b:x=1,y=2", "c"));
  EXPECT_THAT(split_components("b:x=1,c:z=3"), ElementsAre("b:x=1", "c:z=3"));
  EXPECT_THAT(split_components("a"), ElementsAre("a"));
}

TEST(OptionTable, HelpNamesEveryOptionAndItsRange) {
  const std::string help = table().help();
  EXPECT_THAT(help,
              HasSubstr("iterations=100  maximum number of iterations (an integer, 1 to 1000)"));
  EXPECT_THAT(help, HasSubstr("ordering=amd  fill-reducing ordering (one of amd, natural)"));
}

}  // namespace
}  // namespace cairn
