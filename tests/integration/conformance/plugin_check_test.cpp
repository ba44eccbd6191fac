// SPDX-License-Identifier: BSD-3-Clause
// cairn plugins --check: cairn's own plugins hold, and each fault of a wrong one is named.
#include <filesystem>
#include <iostream>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/json/value.hpp>

#include "integration/process.hpp"

namespace cairn::test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::IsSupersetOf;
using ::testing::Not;

constexpr int kFindings = 5, kUsage = 2;

std::string wrong(const std::string& name) {
  return fs::path(CAIRN_WRONG_PLUGINS) / (name + ".so");
}

/// One finding as a line: "EDGE_SE2 / Jacobians / law / problem / input".
using Findings = std::vector<std::string>;

struct Checked {
  Findings findings;
  std::set<std::string> groups;  ///< "EDGE_SE2 / Jacobians", of which there is a result
  int exit_code = 0;

  /// The laws that the name breaks.
  std::set<std::string> laws_of(const std::string& name) const {
    std::set<std::string> laws;
    for (const std::string& finding : findings) {
      if (!finding.starts_with(name + " / ")) continue;
      const std::size_t group = finding.find(" / ") + 3, law = finding.find(" / ", group) + 3;
      laws.insert(finding.substr(law, finding.find(" / ", law) - law));
    }
    return laws;
  }
};

std::string text_of(const boost::json::value& value) {
  return value.is_string() ? std::string(value.as_string()) : "";
}

Checked check(const std::string& file, const Arguments& more = {}) {
  Arguments arguments{"plugins", "--check", file, "--json", "-"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const Outcome outcome = cairn(arguments);
  Checked checked{{}, {}, outcome.exit_code};
  const auto report = parse_json(outcome.out);
  EXPECT_EQ(report.at("ok").as_bool(), outcome.exit_code == 0);
  for (const auto& result : report.at("checked").as_array().at(0).at("results").as_array()) {
    const std::string group = text_of(result.at("name")) + " / " + text_of(result.at("group"));
    checked.groups.insert(group);
    for (const auto& finding : result.at("findings").as_array()) {
      // A build without that plugin skips the test, by this message.
      if (const std::string problem = text_of(finding.at("problem"));
          problem.find("there is no ") != std::string::npos)
        std::cout << problem << "\n";
      checked.findings.push_back(group + " / " + text_of(finding.at("law")) + " / " +
                                 text_of(finding.at("problem")) + " / " +
                                 text_of(finding.at("input")));
    }
  }
  return checked;
}

std::vector<std::string> own_plugins() {
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(CAIRN_OWN_PLUGINS)) {
    if (entry.path().extension() == ".so") names.push_back(entry.path().stem());
  }
  return names;
}

class OwnPlugin : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(All, OwnPlugin, testing::ValuesIn(own_plugins()),
                         [](const auto& test) { return test.param; });

TEST_P(OwnPlugin, Conforms) {
  const Checked checked =
      check(fs::path(CAIRN_OWN_PLUGINS) / (GetParam() + ".so"), {"--seconds", "200"});
  EXPECT_THAT(checked.findings, IsEmpty());
  EXPECT_EQ(checked.exit_code, 0);
  EXPECT_GE(checked.groups.size(), 2U);
}

TEST(SpatialTypes, ConformInEveryMetric) {
  const fs::path plugin = fs::path(CAIRN_OWN_PLUGINS) / "slam3d.so";
  if (!fs::exists(plugin)) GTEST_SKIP() << "there are no types slam3d";
  for (const std::string metric : {"logarithm", "g2o"})
    EXPECT_THAT(check(plugin, {"--types", "slam3d:metric=" + metric}).findings, IsEmpty());
}

/// What the checks say of the wrong factors, computed once.
const Checked& wrong_factors() {
  static const Checked checked = check(wrong("wrong_factors"), {"--seconds", "20"});
  return checked;
}

TEST(WrongFactor, WithAWrongJacobianIsNamedWithTheEntry) {
  EXPECT_THAT(wrong_factors().findings,
              Contains(AllOf(HasSubstr("EDGE_WRONG_JACOBIAN / Jacobians / "),
                             HasSubstr("derivatives of the residual"),
                             HasSubstr("variable 0, entry (0, 1)"), HasSubstr("x0 = ("))));
  EXPECT_EQ(wrong_factors().laws_of("EDGE_WRONG_JACOBIAN").size(), 1U);
}

TEST(WrongFactor, WhoseResidualIsNoNumberIsNamed) {
  EXPECT_THAT(wrong_factors().laws_of("EDGE_NAN"), ElementsAre("the residual is finite"));
}

TEST(WrongFactor, ThatThrowsIsNamedWithTheCallAndWhatItThrew) {
  EXPECT_THAT(wrong_factors().laws_of("EDGE_THROWS"),
              ElementsAre("evaluate throws nothing", "linearize throws nothing"));
  EXPECT_THAT(wrong_factors().findings,
              Contains(AllOf(HasSubstr("EDGE_THROWS"), HasSubstr("too far to the right"))));
}

TEST(WrongFactor, ThatWritesBeyondItsOutputIsNamed) {
  EXPECT_THAT(wrong_factors().findings,
              Contains(AllOf(HasSubstr("EDGE_BEYOND / residual / evaluate writes to its output "),
                             HasSubstr("beyond the end of 'residual', which has 2 numbers"))));
}

TEST(WrongFactor, ThatCrashesIsNamedAndTheOthersAreCheckedAllTheSame) {
  EXPECT_THAT(wrong_factors().findings,
              Contains(AllOf(HasSubstr("EDGE_ABORTS / residual / evaluate returns / it crashed"),
                             HasSubstr("x0 = ("))));
  // Its own other groups too.
  EXPECT_THAT(wrong_factors().groups,
              IsSupersetOf({"EDGE_ABORTS / pool", "EDGE_RIGHT / Jacobians", "EDGE_RIGHT / pool"}));
}

TEST(WrongFactor, ThatEndsTheProcessIsNamed) {
  EXPECT_THAT(wrong_factors().findings,
              Contains(AllOf(HasSubstr("EDGE_EXITS / measurement / normalize returns"),
                             HasSubstr("ended the process with exit code"))));
}

TEST(WrongFactor, ThatNeverReturnsIsNamedOnce) {
  EXPECT_THAT(wrong_factors().laws_of("EDGE_LOOPS"), ElementsAre("propagate returns"));
  EXPECT_THAT(wrong_factors().findings,
              Contains(AllOf(HasSubstr("EDGE_LOOPS"), HasSubstr("did not return within 20 s"))));
}

TEST(WrongFactor, ThatDependsOnEarlierCallsIsNamed) {
  EXPECT_THAT(wrong_factors().laws_of("EDGE_REMEMBERS"),
              Contains("the same input gives the same bits when it is repeated"));
}

TEST(WrongFactor, WhoseAngleIsNotWrappedIsNamedWithTheJump) {
  EXPECT_THAT(wrong_factors().laws_of("EDGE_UNWRAPPED"),
              ElementsAre("a residual that is an angle is wrapped to ±π"));
  EXPECT_THAT(
      wrong_factors().findings,
      Contains(AllOf(HasSubstr("EDGE_UNWRAPPED / wrapping / "), HasSubstr("row 0 jumps from "),
                     HasSubstr("wrap_angle"), HasSubstr("x0 = ("))));
  EXPECT_THAT(wrong_factors().laws_of("EDGE_WRAPPED"), IsEmpty());
}

TEST(WrongFactor, OneOfWhoseVariablesHasNoInfluenceIsNamed) {
  EXPECT_THAT(wrong_factors().laws_of("EDGE_BYSTANDER"),
              ElementsAre("every variable has an influence on the residual"));
}

TEST(WrongFactor, DoesNotSpoilTheRightOneBesideIt) {
  EXPECT_THAT(wrong_factors().laws_of("EDGE_RIGHT"), IsEmpty());
  EXPECT_EQ(wrong_factors().exit_code, kFindings);
}

TEST(WrongVariable, IsNamedWithTheLawThatItBreaks) {
  const Checked checked = check(wrong("wrong_variables"));
  EXPECT_THAT(checked.laws_of("VERTEX_WRONG_ADJOINT"),
              ElementsAre("x · exp(δ) · x⁻¹ = exp(adjoint(x) δ)"));
  EXPECT_THAT(checked.laws_of("VERTEX_WRONG_LOCAL"), Contains("local(x, retract(x, δ)) = δ"));
  EXPECT_THAT(checked.laws_of("VERTEX_DRIFTS"),
              ElementsAre("normalize changes nothing when it is repeated",
                          "normalize leaves the state where it is"));
  EXPECT_EQ(checked.exit_code, kFindings);
}

TEST(WrongLinearSolver, IsNamedWithWhatItReturned) {
  const Checked checked = check(wrong("wrong_solvers"));
  EXPECT_THAT(checked.laws_of("diagonal_alone"), Contains("H x = g, as dense algebra solves it"));
  EXPECT_THAT(checked.laws_of("careless"),
              ElementsAre("factorize reports a singular system",
                          "factorize reports a system that is indefinite",
                          "factorize reports a system that is not finite"));
  EXPECT_THAT(checked.findings,
              Contains(AllOf(HasSubstr("careless"), HasSubstr("solve gave (nan)"))));
}

TEST(WrongLoss, IsNamed) {
  const Checked checked = check(wrong("wrong_losses"));
  EXPECT_THAT(checked.laws_of("wrong_weight"), Contains("ρ′ is the derivative of ρ"));
  // What it has overwritten may crash it later on.
  EXPECT_THAT(checked.laws_of("overrun"), Contains("evaluate writes to its output alone"));
  EXPECT_THAT(checked.laws_of("misnamed"), Contains("the default is one of the choices"));
  EXPECT_THAT(checked.findings,
              Contains(AllOf(HasSubstr("unmakeable"), HasSubstr("no licence was found"))));
  EXPECT_THAT(checked.findings,
              Contains(AllOf(HasSubstr("wrong_choice / derivatives / ρ′ is the derivative of ρ"),
                             HasSubstr("wrong_choice:weight=wrong, s = "))));
}

TEST(WrongComponent, ThatThrowsIsNamedWithTheCall) {
  const Checked checked = check(wrong("wrong_calls"));
  EXPECT_THAT(checked.laws_of("VERTEX_THROWS"), Contains("local throws nothing"));
  EXPECT_THAT(
      checked.laws_of("throws"),
      IsSupersetOf({"analyze throws nothing", "optimize throws nothing", "compute throws nothing",
                    "read throws nothing", "generate throws nothing", "evaluate throws nothing"}));
  EXPECT_THAT(checked.findings, Contains(HasSubstr("it threw: in generate")));
}

TEST(WrongOptimizer, IsNamed) {
  const Checked checked = check(wrong("wrong_optimizers"));
  EXPECT_THAT(checked.laws_of("stops_short"), Contains("what has converged is at a minimum"));
  EXPECT_THAT(checked.laws_of("ignores_interrupts"), ElementsAre("an interrupt ends it"));
  EXPECT_THAT(checked.laws_of("leaves_nan"), Contains("the states are finite"));
  EXPECT_THAT(checked.laws_of("moves_fixed"), Contains("a fixed variable stays"));
  EXPECT_THAT(checked.laws_of("remembers"),
              ElementsAre("memory does not grow with the calls of one object"));
}

TEST(WrongEstimator, IsNamed) {
  const Checked checked = check(wrong("wrong_estimators"));
  EXPECT_THAT(checked.laws_of("stale_covariances"),
              ElementsAre("covariance is the block of H⁻¹ at the minimum"));
  EXPECT_THAT(checked.laws_of("half_refuses"), ElementsAre("a refused update changes nothing",
                                                           "an update that fails changes nothing"));
  EXPECT_THAT(checked.laws_of("keeps_halves"), ElementsAre("an update that fails changes nothing"));
  EXPECT_THAT(checked.laws_of("shares_copies"),
              Contains("a change of the copy is none of the original"));
  EXPECT_THAT(
      checked.laws_of("keeps_what_leaves"),
      IsSupersetOf({"a change is carried out", "update refuses what is wrong with an Error"}));
  EXPECT_THAT(checked.laws_of("removes_no_factor"),
              IsSupersetOf({"factors that are removed are gone, and no others",
                            "after a change, chi2 is near the minimum"}));
  EXPECT_THAT(checked.laws_of("solves_seldom"),
              Contains("an update that is said to be solved leaves chi2 near the minimum"));
}

TEST(WrongFormat, IsNamed) {
  const Checked checked = check(wrong("wrong_formats"));
  EXPECT_THAT(checked.laws_of("loses_the_last"),
              Contains("read finds as many factors as were written"));
  EXPECT_THAT(
      checked.laws_of("accepts_anything"),
      ElementsAre("read refuses a record that it does not know, or reports that it skips it",
                  "read refuses what is no graph with an Error (input)"));
  EXPECT_THAT(checked.laws_of("crashes_on_half"), ElementsAre("read returns"));
  EXPECT_THAT(checked.laws_of("loses_fix"), ElementsAre("read finds which variables are fixed"));
  EXPECT_THAT(checked.laws_of("nine_digits"),
              Contains("read finds the states that were written, to their last digits"));
  EXPECT_THAT(checked.laws_of("skips_silently"),
              Contains("read refuses a record that it does not know, or reports that it skips it"));
}

TEST(WrongPolicy, IsNamed) {
  if (!std::filesystem::exists(wrong("wrong_policies"))) GTEST_SKIP() << "built without policies";
  const Checked checked = check(wrong("wrong_policies"), {"--seconds", "20"});
  EXPECT_THAT(checked.laws_of("never_satisfied"), Contains("next_match comes to an end"));
  EXPECT_THAT(checked.laws_of("boasts"), ElementsAre("kept is what the reports say that is kept"));
  EXPECT_THAT(checked.laws_of("forgets_steps"), ElementsAre("all poses can be recovered"));
  EXPECT_THAT(checked.laws_of("accepts_any_offer"),
              ElementsAre("what is wrong is refused with an Error"));
  EXPECT_THAT(checked.laws_of("boasts_twice"),
              Contains("the estimate has the poses that are kept, and no others"));
  EXPECT_THAT(checked.laws_of("never_finishes"), Contains("finish keeps the newest pose"));
  EXPECT_THAT(checked.laws_of("remembers_what_it_refuses"),
              ElementsAre("a refused call changes nothing of what follows"));
}

TEST(WrongUseOfResources, IsNamed) {
  const Checked checked = check(wrong("wrong_resources"));
  EXPECT_THAT(checked.laws_of("leaks"),
              ElementsAre("memory does not grow with new objects",
                          "memory does not grow with the calls of one object"));
  EXPECT_THAT(checked.laws_of("opens_files"), ElementsAre("open files are closed"));
  EXPECT_THAT(checked.laws_of("leaves_threads"), Contains("threads are ended"));
  EXPECT_THAT(checked.laws_of("crashes_at_its_end"), ElementsAre("the destructor returns"));
  EXPECT_THAT(checked.laws_of("is_made_slowly"), ElementsAre("it is made quickly"));
  EXPECT_THAT(checked.laws_of("races"),
              ElementsAre("uses at the same time on several threads give the same bits"));
}

TEST(PluginCheck, NamesAPluginThatWritesToWhatItHasNotOpened) {
  const Checked checked = check(wrong("wrong_writes"));
  EXPECT_THAT(checked.findings,
              Contains(AllOf(HasSubstr("evaluate writes to its own files alone"),
                             HasSubstr("it wrote to a descriptor that it has not opened"))));
  EXPECT_EQ(checked.exit_code, kFindings);
}

TEST(PluginCheck, NamesTheLibraryThatAPluginIsNotLinkedWith) {
  const Checked checked = check(wrong("wrong_unlinked"));
  EXPECT_THAT(checked.findings,
              ElementsAre(AllOf(HasSubstr("it is linked with every library that it uses"),
                                HasSubstr("libcairn_slam.so"), HasSubstr("implausible_estimate"),
                                HasSubstr("LIBRARIES cairn::slam"))));
  EXPECT_EQ(checked.exit_code, kFindings);
}

TEST(PluginCheck, NamesAPluginThatIsLoadedSlowly) {
  const Checked checked = check(wrong("wrong_slow_start"));
  EXPECT_THAT(checked.findings, ElementsAre(AllOf(HasSubstr("registration / it is loaded quickly"),
                                                  HasSubstr("that takes 2."))));
}

TEST(PluginCheck, NamesAPluginThatCrashesWhenTheProcessEnds) {
  const Checked checked = check(wrong("wrong_at_exit"));
  EXPECT_THAT(checked.findings,
              ElementsAre(AllOf(HasSubstr("end / exit returns"), HasSubstr("crashed (Aborted)"))));
  EXPECT_EQ(checked.exit_code, kFindings);
}

TEST(PluginCheck, NamesAPluginThatCrashesWhenItIsLoaded) {
  const Checked checked = check(wrong("wrong_from_the_start"));
  EXPECT_THAT(checked.findings,
              ElementsAre(AllOf(HasSubstr("registration / the plugin can be loaded"),
                                HasSubstr("a static constructor crashed (Aborted)"))));
  EXPECT_EQ(checked.exit_code, kFindings);
}

TEST(PluginCheck, NamesWhatKeepsAFileFromBeingLoaded) {
  const Checked foreign = check(fs::path(CAIRN_BAD_PLUGINS) / "foreign" / "foreign.so");
  EXPECT_THAT(foreign.findings, ElementsAre(HasSubstr("so its objects cannot be passed around")));
  const Checked missing = check("there-is-none.so");
  EXPECT_THAT(missing.findings, ElementsAre(HasSubstr("No such file")));
  EXPECT_EQ(missing.exit_code, kFindings);
}

TEST(PluginCheck, PrintsALineForEachGroupAndBelowItWhatDoesNotHold) {
  const std::string text =
      cairn({"plugins", "--check", wrong("wrong_variables"), wrong("wrong_solvers")}).out;
  EXPECT_THAT(text, HasSubstr("  variable 'VERTEX_DRIFTS', several at once: "));
  EXPECT_THAT(text, HasSubstr("    does not hold: normalize leaves the state where it is"));
  EXPECT_THAT(text, HasSubstr("  linear solver 'careless', solutions: "));
  EXPECT_THAT(text, HasSubstr("\n    variable 'VERTEX_DRIFTS': normalize"));
  EXPECT_THAT(text, Not(HasSubstr("\x1b")));
}

TEST(PluginCheck, OtherInputsComeFromAnotherSeed) {
  const auto inputs = [](const std::string& seed) {
    return check(wrong("wrong_variables"), {"--seed", seed}).findings;
  };
  EXPECT_EQ(inputs("3"), inputs("3"));
  EXPECT_NE(inputs("3"), inputs("4"));
}

TEST(PluginCheck, IsNotAskedBesideAName) {
  const Outcome outcome = cairn({"plugins", "eigen", "--check", wrong("wrong_solvers")});
  EXPECT_EQ(outcome.exit_code, kUsage);
  EXPECT_THAT(outcome.err, HasSubstr("'eigen' and --check"));
}

}  // namespace
}  // namespace cairn::test
