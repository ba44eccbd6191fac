// SPDX-License-Identifier: BSD-3-Clause
// The conformance suite as C++ callers reach it: on what a program adds to its registry.
#include "cairn/conformance/conformance.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/lie/point.hpp"
#include "cairn/lie/se3.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/define_factor.hpp"
#include "cairn/types/define_variable.hpp"
#include "cairn/types/loss.hpp"

namespace cairn::test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

PluginSearch nowhere() { return {{}, false, false, false}; }

struct Point : PointXY {
  static constexpr std::string_view kTag = "VERTEX_OWN";
};

/// r = |b − a| − z
struct Distance {
  static constexpr std::string_view kTag = "EDGE_OWN";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<Point, Point>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 2>& a, const Vector<S, 2>& b,
                               const Vector<double, 1>& z) {
    using std::sqrt;
    const S dx = b[0] - a[0], dy = b[1] - a[1];
    return Vector<S, 1>(sqrt(dx * dx + dy * dy) - z[0]);
  }
};

/// A pose whose δ is twice as long as it should be in `retract`.
struct Doubled : Se3 {
  static constexpr std::string_view kTag = "VERTEX_DOUBLED";
  template <class S>
  static Vector<S, 7> retract(const Vector<S, 7>& x, const Vector<S, 6>& delta) {
    return Se3::retract<S>(x, Vector<S, 6>(delta * 2.0));
  }
};

class Half final : public Loss {
 public:
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    for (std::size_t k = 0; k < rho.size(); ++k) rho[k] = 0.5 * s[k];
    std::ranges::fill(weight, 0.5);
  }
  double second_derivative(double) const override { return 0.0; }
};

std::vector<std::string> broken_laws(const std::vector<ConformanceResult>& results) {
  std::vector<std::string> laws;
  for (const ConformanceResult& result : results) {
    for (const ConformanceFinding& finding : result.findings) laws.push_back(finding.law);
  }
  return laws;
}

TEST(Conformance, OfRightTypesFindsNothing) {
  Registry registry(nowhere());
  registry.add(define_variable<Point>());
  registry.add(define_factor<Distance>());
  for (const ConformanceResult& result : check_conformance("this program", registry)) {
    EXPECT_TRUE(result.ok()) << to_text(result);
    if (result.checked.group != "time") {
      EXPECT_GT(result.checks, 0) << to_text(result);
    }
  }
}

TEST(Conformance, FindsTheLawThatAVariableBreaks) {
  Registry registry(nowhere());
  registry.add(define_variable<Doubled>());
  const auto laws = broken_laws(check_conformance("this program", registry));
  EXPECT_THAT(laws, Contains("local(x, retract(x, δ)) = δ"));
  EXPECT_THAT(laws, Contains("retract(x, δ) = x · exp(δ)"));
}

TEST(Conformance, FindsALossThatIsNoSquareNearZero) {
  Registry registry(nowhere());
  registry.add<Loss>("half", {},
                     [](const Options&, Registry&) { return std::make_unique<Half>(); });
  EXPECT_THAT(broken_laws(check_conformance("this program", registry)), Contains("ρ′(0) = 1"));
}

TEST(Conformance, MakesEveryNameAtLeast) {
  std::vector<Offer> offers(3);
  offers[0].kind = "picture";
  offers[0].name = "svg";
  offers[1].kind = "factor";
  offers[1].name = "EDGE_OWN";
  offers[2].kind = "a_kind_of_its_own";
  offers[2].name = "x";
  Registry registry;
  const auto cases = conformance_cases(offers, registry);
  std::set<std::string> names;
  for (const ConformanceCase& one : cases) names.insert(one.name);
  EXPECT_THAT(names, SizeIs(3));
  EXPECT_EQ(cases.front().group, "options");
}

class Calls final : public ConformanceObserver {
 public:
  void on_call(std::string_view callback, std::string_view input) override {
    functions.emplace(callback);
    if (!input.empty()) last_input = input;
  }
  std::set<std::string> functions;
  std::string last_input;
};

TEST(Conformance, IsObservedBeforeEachCall) {
  Registry registry(nowhere());
  registry.add(define_variable<Point>());
  registry.add(define_factor<Distance>());
  Calls calls;
  check_conformance({"factor", "EDGE_OWN", "pool"}, registry, {}, &calls);
  EXPECT_THAT(calls.functions, testing::IsSupersetOf({"evaluate", "linearize", "squared_norms"}));
  EXPECT_THAT(calls.last_input, HasSubstr("x1 = ("));
}

TEST(Conformance, IsTheSameForTheSameSeed) {
  Registry registry(nowhere());
  registry.add(define_variable<Doubled>());
  const auto text = [&](std::uint64_t seed) {
    return to_text(check_conformance({"variable", "VERTEX_DOUBLED", "retract and local"}, registry,
                                     {.seed = seed}));
  };
  EXPECT_EQ(text(1), text(1));
  EXPECT_NE(text(1), text(2));
  EXPECT_THAT(text(1), AllOf(HasSubstr("variable 'VERTEX_DOUBLED', retract and local: "),
                             HasSubstr("does not hold: local(x, retract(x, δ)) = δ"),
                             HasSubstr("with x = (")));
}

TEST(Conformance, RefusesAGroupOrAPluginThatDoesNotExist) {
  Registry registry(nowhere());
  registry.add(define_variable<Point>());
  EXPECT_THROW(check_conformance({"variable", "VERTEX_OWN", "flavour"}, registry), Error);
  EXPECT_THROW(check_conformance("another", registry), Error);
}

TEST(Conformance, OfWhatCannotBeMadeIsAFinding) {
  Registry registry(nowhere());
  const auto result = check_conformance({"loss", "none", "shape"}, registry);
  ASSERT_THAT(result.findings, SizeIs(1));
  EXPECT_THAT(result.findings[0].problem, HasSubstr("there is no loss 'none'"));
}

}  // namespace
}  // namespace cairn::test
