// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "cairn/plugin/plugin_search.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/types/loss.hpp"
#include "support/components.hpp"
#include "support/planar_graph.hpp"

namespace cairn {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// ρ(s) = weight · s: enough to see which options it was made with.
class Scaled final : public Loss {
 public:
  explicit Scaled(double weight) : weight_(weight) {}
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    for (std::size_t k = 0; k < rho.size(); ++k) rho[k] = weight_ * s[k];
    std::ranges::fill(weight, weight_);
  }
  double second_derivative(double) const override { return 0.0; }

 private:
  double weight_;
};

void add_scaled(Registry& registry, const std::string& name) {
  registry.add<Loss>(
      name, OptionTable{}.real("weight", 2.0, 0.0, 10.0, "factor of the square"),
      [](const Options& options, Registry&) {
        return std::make_unique<Scaled>(options.real("weight"));
      },
      "the square, scaled");
}

double rho_of_one(const Loss& loss) {
  const double s = 1.0;
  double rho = 0.0;
  loss.evaluate({&s, 1}, {&rho, 1}, {});
  return rho;
}

/// Finds no plugin at all.
const PluginSearch kNowhere{.files = {}, .environment = false, .default_folder = false};

std::string refusal(ErrorCode code, const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  return {};
}

TEST(Registry, NamesWhatIsOnOffer) {
  CAIRN_NEEDS("types", "slam2d");
  Registry registry;
  EXPECT_THAT(registry.names("types"), Contains("slam2d"));
  EXPECT_TRUE(registry.has("variable", "VERTEX_SE2"));
  EXPECT_FALSE(registry.has("variable", "VERTEX_SE9"));
  EXPECT_THAT(registry.offers(),
              Contains(AllOf(Field(&Offer::kind, "factor"), Field(&Offer::name, "EDGE_SE2"),
                             Field(&Offer::plugin, "slam2d"))));
  EXPECT_THAT(refusal(ErrorCode::plugin, [&] { registry.variable_type("VERTEX_SE"); }),
              HasSubstr("there is no variable 'VERTEX_SE'; did you mean 'VERTEX_SE2'?"));
}

TEST(Registry, HandsOutOneObjectForATag) {
  Registry registry;
  EXPECT_EQ(registry.variable_type("VERTEX_SE2"), registry.variable_type("VERTEX_SE2"));
  EXPECT_EQ(registry.factor_type("EDGE_SE2"), registry.factor_type("EDGE_SE2"));
}

TEST(Registry, MakesComponentsThatTheProgramAdds) {
  Registry registry(kNowhere);
  EXPECT_THAT(registry.offers(), IsEmpty());
  add_scaled(registry, "scaled");
  EXPECT_DOUBLE_EQ(rho_of_one(*registry.make<Loss>("scaled")), 2.0);
  EXPECT_DOUBLE_EQ(rho_of_one(*registry.make<Loss>("scaled:weight=5")), 5.0);
  EXPECT_THAT(refusal(ErrorCode::usage, [&] { registry.make<Loss>("scaled:wieght=5"); }),
              HasSubstr("did you mean 'weight'?"));
  ASSERT_NE(registry.options("loss", "scaled").find("weight"), nullptr);
}

TEST(Registry, ListsWhatTheProgramAdds) {
  Registry registry(kNowhere);
  add_scaled(registry, "scaled");
  registry.add(test::PlanarTypes().relative_pose, "relative pose of a test");
  const std::vector<Offer> offers = registry.offers();
  ASSERT_EQ(offers.size(), 2U);
  EXPECT_EQ(offers[0].kind, "factor");
  EXPECT_EQ(offers[0].name, "EDGE_SE2");
  EXPECT_EQ(offers[0].summary, "relative pose of a test");
  EXPECT_EQ(offers[1].name, "scaled");
  EXPECT_EQ(offers[1].plugin, "this program");
  EXPECT_TRUE(offers[1].file.empty());
  EXPECT_THAT(registry.names("loss"), ElementsAre("scaled"));
  EXPECT_THAT(registry.problems(), IsEmpty());
  registry.load_all();  // there is nothing to load
}

TEST(Registry, AFactoryMayMakeOtherComponents) {
  Registry registry(kNowhere);
  add_scaled(registry, "scaled");
  registry.add<Loss>("wrapped", {}, [](const Options&, Registry& others) {
    return others.make<Loss>("scaled:weight=3");
  });
  EXPECT_DOUBLE_EQ(rho_of_one(*registry.make<Loss>("wrapped")), 3.0);
}

TEST(Registry, SaysThatAFactoryOfTheProgramMadeNothing) {
  Registry registry(kNowhere);
  registry.add<Loss>("nothing", {},
                     [](const Options&, Registry&) { return std::unique_ptr<Loss>(); });
  EXPECT_THAT(refusal(ErrorCode::plugin, [&] { registry.make<Loss>("nothing"); }),
              HasSubstr("this program: the plugin made nothing for loss 'nothing'"));
}

TEST(Registry, TakesTypesOfTheProgramOneByOne) {
  Registry registry(kNowhere);
  const auto pose = test::PlanarTypes().pose;
  const auto relative = test::PlanarTypes().relative_pose;
  registry.add(pose);
  registry.add(relative);
  EXPECT_EQ(registry.variable_type("VERTEX_SE2"), pose);
  EXPECT_EQ(registry.factor_type("EDGE_SE2"), relative);
  EXPECT_THAT(refusal(ErrorCode::usage, [&] { registry.add(std::shared_ptr<const FactorType>()); }),
              HasSubstr("it is null"));
}

TEST(Registry, TakesASetOfTypesWithOptions) {
  Registry registry(kNowhere);
  registry.add_types("planar", OptionTable{}.boolean("points", true, "landmarks too"),
                     [](const Options& options) {
                       TypeSet set{{test::PlanarTypes().pose}, {}};
                       if (options.boolean("points"))
                         set.factors.push_back(test::PlanarTypes().point_seen);
                       return set;
                     });
  EXPECT_TRUE(registry.has("types", "planar"));
  EXPECT_TRUE(registry.has("factor", "EDGE_SE2_XY"));
  registry.set_type_options({"planar", {{"points", "false"}}});
  EXPECT_NE(registry.variable_type("VERTEX_SE2"), nullptr);
  EXPECT_THAT(refusal(ErrorCode::plugin, [&] { registry.factor_type("EDGE_SE2_XY"); }),
              HasSubstr("offers factor 'EDGE_SE2_XY' but does not make it"));
}

TEST(Registry, RefusesANameThatTheProgramAddsTwice) {
  Registry registry(kNowhere);
  add_scaled(registry, "scaled");
  EXPECT_THAT(refusal(ErrorCode::usage, [&] { add_scaled(registry, "scaled"); }),
              HasSubstr("this program adds loss 'scaled' twice"));
  registry.add(test::PlanarTypes().relative_pose);
  EXPECT_THAT(refusal(ErrorCode::usage, [&] { registry.add(test::PlanarTypes().relative_pose); }),
              HasSubstr("this program adds factor 'EDGE_SE2' twice"));
  EXPECT_DOUBLE_EQ(rho_of_one(*registry.make<Loss>("scaled")), 2.0);
}

TEST(Registry, ANameOfAPluginAndOfTheProgramIsAnErrorForWhoeverAsks) {
  Registry registry;
  const auto before = registry.factor_type("EDGE_SE2");
  registry.add(test::PlanarTypes().relative_pose);
  add_scaled(registry, "huber");
  const auto names_both = AllOf(HasSubstr("slam2d.so and by this program"),
                                HasSubstr("factor 'EDGE_SE2' is offered by"));
  EXPECT_THAT(refusal(ErrorCode::plugin, [&] { registry.factor_type("EDGE_SE2"); }), names_both);
  EXPECT_THAT(refusal(ErrorCode::plugin, [&] { registry.make<Loss>("huber"); }),
              HasSubstr("losses.so and by this program"));
  EXPECT_EQ(registry.problems().size(), 2U);
  // Nobody else is hurt.
  EXPECT_NE(registry.factor_type("EDGE_SE2_XY"), nullptr);
  EXPECT_NE(registry.make<Loss>("cauchy"), nullptr);
  EXPECT_THAT(refusal(ErrorCode::plugin, [&] { registry.factor_type("EDGE_SE2"); }), names_both);
}

TEST(Registry, MayBeUsedByManyThreads) {
  Registry registry;
  // What the threads ask for: an exception in one of them would end all tests.
  Registry().factor_type("EDGE_SE2");
  Registry().make<Optimizer>("levenberg_marquardt");
  std::vector<std::jthread> threads;
  std::vector<std::shared_ptr<const FactorType>> types(8);
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([&registry, &types, t] {
      add_scaled(registry, "scaled" + std::to_string(t));
      types[t] = registry.factor_type("EDGE_SE2");
      EXPECT_NE(registry.make<Optimizer>("levenberg_marquardt"), nullptr);
      EXPECT_NE(registry.make<Loss>("scaled" + std::to_string(t)), nullptr);
      EXPECT_FALSE(registry.offers().empty());
    });
  }
  threads.clear();  // joins
  for (const auto& type : types) EXPECT_EQ(type, types[0]);
}

TEST(DefaultRegistry, IsOneForTheProcess) {
  CAIRN_NEEDS("types", "slam2d");
  Registry *first = nullptr, *second = nullptr;
  {
    std::jthread a([&] { first = &default_registry(); }), b([&] { second = &default_registry(); });
  }
  EXPECT_EQ(first, second);
  EXPECT_TRUE(default_registry().has("types", "slam2d"));
}

}  // namespace
}  // namespace cairn
