// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/online_session.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/online/line_server.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/optimizer.hpp"
#include "support/components.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

const std::string kStep = " 1 0 0.1 100 0 0 100 0 100";  // measurement and information

class OnlineSessionTest : public ::testing::Test {
 protected:
  void begin(OnlineSettings settings) {
    number_ = 0;
    format_ = registry_.make<StreamFormat>("g2o");
    estimator_ = registry_.make<Estimator>("batch");
    session_ = std::make_unique<OnlineSession>(*estimator_, *format_, registry_, settings);
  }
  void SetUp() override {
    CAIRN_NEEDS("types", "slam2d");
    begin({.read = {}, .output = "none"});
  }
  LineSession::Reply take(const std::string& line) { return session_->take(line, ++number_); }
  /// The answers to all of these.
  std::string take_all(const std::vector<std::string>& lines) {
    std::string text;
    for (const std::string& line : lines) text += take(line).text;
    return text;
  }
  const std::vector<std::string> two_poses_ = {"VERTEX_SE2 0 0 0 0", "FIX 0", "NEW VERTEX_SE2 1",
                                               "EDGE_SE2 0 1" + kStep};
  Registry registry_;
  std::unique_ptr<StreamFormat> format_;
  std::unique_ptr<Estimator> estimator_;
  std::unique_ptr<OnlineSession> session_;
  std::int64_t number_ = 0;
};

TEST_F(OnlineSessionTest, LeavesOutFactorsOnVariablesThatNeverCameOnRequest) {
  const std::vector<std::string> lines = {"EDGE_SE2 0 7" + kStep, "EDGE_SE2 8 1" + kStep};
  take_all(two_poses_);
  const LineSession::Reply refused = take(lines[0]);
  EXPECT_TRUE(refused.refused);
  EXPECT_THAT(refused.text, HasSubstr("there is no variable 7"));
  begin({.read = {.skip_dangling = true}, .output = "none"});
  take_all(two_poses_);
  const LineSession::Reply one = take(lines[0]), two = take(lines[1]);
  EXPECT_EQ(one.text, "NOTE EDGE_SE2 0 7 is left out: there is no variable 7 (1 factor so far)\n");
  EXPECT_EQ(two.text, "NOTE EDGE_SE2 8 1 is left out: there is no variable 8 (2 factors so far)\n");
  EXPECT_FALSE(one.refused);
  EXPECT_FALSE(one.changes) << "a journal has no use for it";
  EXPECT_EQ(session_->factor_count(), 1);
  take("NEW VERTEX_SE2 2");
  EXPECT_THAT(take("EDGE_SE2 1 2" + kStep).text, Not(HasSubstr("left out")));
  EXPECT_EQ(session_->factor_count(), 2);
}

TEST_F(OnlineSessionTest, SuggestsTheCommandForAWordThatIsMisspelt) {
  for (const auto& [misspelt, meant] : {std::pair("SLOVE", "SOLVE"),
                                        {"solve", "SOLVE"},
                                        {"ESTIMAT 1", "ESTIMATE"},
                                        {"MARGINALISE 1", "MARGINALIZE"},
                                        {"EDGE_SE 0 1", "EDGE_SE2"},
                                        {"FIXX 0", "FIX"},
                                        {"REMOVE FACTER 1", "FACTOR"},
                                        {"REMOVE variable 1", "VARIABLE"}}) {
    const LineSession::Reply reply = take(misspelt);
    EXPECT_TRUE(reply.refused);
    EXPECT_FALSE(reply.changes);
    EXPECT_THAT(reply.text, HasSubstr(std::string("; did you mean '") + meant + "'?"));
    EXPECT_THAT(reply.text, Not(HasSubstr("on offer")));
  }
  EXPECT_THAT(take("REMOVE 7 1").text, HasSubstr("or 'REMOVE VARIABLE id …'\n"));
  EXPECT_THAT(take("REMOVE FACTOR").text, HasSubstr("or 'REMOVE VARIABLE id …'\n"));
  // Where nothing is near, a short line, since it may come for each of many lines: the commands,
  // and where the tags are listed.
  const std::string far = take("NOTHING_LIKE_THAT_IS_ON_OFFER 1").text;
  EXPECT_THAT(far, Not(HasSubstr("did you mean")));
  EXPECT_THAT(far, HasSubstr("; commands: NEW, REMOVE, CHANGE, "));
  EXPECT_THAT(far, HasSubstr("`cairn plugins factor`"));
  EXPECT_THAT(far, Not(HasSubstr("EDGE_")));
  EXPECT_LT(far.size(), 320U) << far;
  EXPECT_THAT(take("FOLOW").text, Not(HasSubstr("did you mean")));
  format_->add_other_words(LineServer::words());
  EXPECT_THAT(take("FOLOW").text, HasSubstr("; did you mean 'FOLLOW'?"));
  EXPECT_THAT(session_->ask("COVARIANC 0 0", 1).text, HasSubstr("did you mean 'COVARIANCE'?"));
}

TEST_F(OnlineSessionTest, TakesDataInSilenceAndAnswersWhenItHasSolved) {
  EXPECT_THAT(take("VERTEX_SE2 0 0 0 0").text, IsEmpty());
  EXPECT_EQ(session_->variable_count(), 0);  // no measurement has touched it
  EXPECT_TRUE(take("FIX 0").changes);
  EXPECT_THAT(take("NEW VERTEX_SE2 1").text, IsEmpty());
  const LineSession::Reply reply = take("EDGE_SE2 0 1" + kStep);
  EXPECT_EQ(reply.text, "OK 4 variables 2 factors 1 owed 0\n");
  EXPECT_TRUE(reply.changes);
  EXPECT_TRUE(reply.solved);
  EXPECT_FALSE(reply.refused);
  EXPECT_FALSE(reply.quit);
}

TEST_F(OnlineSessionTest, HelpListsTheCommands) {
  take_all(two_poses_);
  for (const bool other : {false, true}) {
    const LineSession::Reply reply = other ? session_->ask("HELP", 7) : take("HELP");
    EXPECT_THAT(reply.text, StartsWith("NOTE commands: NEW, REMOVE, CHANGE, MARGINALIZE, "));
    EXPECT_THAT(reply.text, HasSubstr(" CHI2, SAVE, HELP, QUIT; "));
    EXPECT_THAT(reply.text, HasSubstr("\nOK "));
    EXPECT_FALSE(reply.changes || reply.refused || reply.solved);
  }
  EXPECT_TRUE(take("HELP ME").refused);
}

TEST_F(OnlineSessionTest, QuestionsChangeNothing) {
  take_all(two_poses_);
  for (const auto& [question, answer] :
       {std::pair<std::string, std::string>{"ESTIMATE 1", "VERTEX_SE2 1 1 0 0.1\nOK "},
        {"ESTIMATE ALL", "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0.1\nOK "},
        {"COVARIANCE 1 1", "COVARIANCE 1 1 3 3 0.01"},
        {"CHI2", "CHI2 "}}) {
    const LineSession::Reply reply = take(question);
    EXPECT_THAT(reply.text, StartsWith(answer));
    EXPECT_FALSE(reply.changes) << question;
    EXPECT_FALSE(reply.refused) << question;
  }
}

TEST_F(OnlineSessionTest, ARefusedLineLeavesNothingBehind) {
  take_all(two_poses_);
  for (const std::string line :
       {"EDGE_SE2 0 1 1 0", "EDGE_SE2 0 9 1 0 0 1 0 0 1 0 1", "VERTEX_SE2 1 0 0 0", "FIX 0",
        "NEW VERTEX_SE9 4", "REMOVE FACTOR 7", "CHANGE 0 1", "COVARIANCE 0", "ESTIMATE 9", "SAVE -",
        "SOLVE now", "WHAT 1"}) {
    const LineSession::Reply reply = take(line);
    EXPECT_TRUE(reply.refused) << line;
    EXPECT_FALSE(reply.changes) << line;
    EXPECT_THAT(reply.text, StartsWith("ERROR line " + std::to_string(number_) + ": ")) << line;
    EXPECT_EQ(std::ranges::count(reply.text, '\n'), 1) << line;
  }
  EXPECT_EQ(session_->variable_count(), 2);
  EXPECT_EQ(session_->factor_count(), 1);
}

TEST_F(OnlineSessionTest, BlankLinesAndCommentsAreNoLines) {
  for (const std::string line : {"", "   \t", "# a comment"}) {
    const LineSession::Reply reply = take(line);
    EXPECT_THAT(reply.text, IsEmpty());
    EXPECT_FALSE(reply.changes);
  }
}

TEST_F(OnlineSessionTest, SolvesOnlyWhenAskedToWhereThatIsSo) {
  begin({.read = {}, .automatic = false, .output = "last"});
  for (const std::string& line : two_poses_) EXPECT_THAT(take(line).text, IsEmpty());
  EXPECT_THAT(take("SOLVE").text, HasSubstr("VERTEX_SE2 1 1 0 0.1\nOK 5 "));
}

TEST_F(OnlineSessionTest, WritesWhatChanged) {
  begin({.read = {}, .output = "changed"});
  take_all(two_poses_);
  const std::string next = take_all({"NEW VERTEX_SE2 2", "EDGE_SE2 1 2" + kStep});
  EXPECT_THAT(next, Not(HasSubstr("VERTEX_SE2 0 ")));
  EXPECT_THAT(next, HasSubstr("VERTEX_SE2 2 "));
}

TEST_F(OnlineSessionTest, ChangesRemovesAndMarginalizes) {
  take_all(two_poses_);
  take_all({"NEW VERTEX_SE2 2", "EDGE_SE2 1 2" + kStep});
  take("CHANGE 0 2 0 0 25 0 0 25 0 25");
  EXPECT_THAT(take("ESTIMATE 1").text, StartsWith("VERTEX_SE2 1 2 "));
  EXPECT_THAT(take("MARGINALIZE 0 1").text, HasSubstr("\nPRIOR 2\n"));
  EXPECT_EQ(session_->variable_count(), 1);
  EXPECT_THAT(take("ESTIMATE 0").text, HasSubstr("there is no variable 0"));
  take("REMOVE FACTOR 2");
  EXPECT_EQ(session_->factor_count(), 0);
}

TEST_F(OnlineSessionTest, AVariableThatWaitsWithoutAStateIsGivenOneByItsLine) {
  const std::string edge = "EDGE_SE2 0 1" + kStep;
  take_all({"NEW VERTEX_SE2 0", "NEW VERTEX_SE2 1"});
  EXPECT_THAT(take(edge).text, HasSubstr("VERTEX_SE2 0: has no state, and no factor of the update "
                                         "determines it; give it a state"));
  EXPECT_THAT(take("NEW VERTEX_SE2 0").text, HasSubstr("the id is already in use"));
  EXPECT_THAT(take("VERTEX_XY 0 2 3").text, HasSubstr("the id is already in use"));
  EXPECT_THAT(take("VERTEX_SE2 0 nan 0 0").text, StartsWith("ERROR"));
  const LineSession::Reply given = take("VERTEX_SE2 0 2 3 0");
  EXPECT_EQ(given.text, "");
  EXPECT_TRUE(given.changes);  // and so is in the journal
  EXPECT_THAT(take("VERTEX_SE2 0 4 3 0").text, HasSubstr("the id is already in use"));
  take("FIX 0");
  EXPECT_THAT(take(edge).text, HasSubstr("OK "));
  EXPECT_THAT(take("ESTIMATE 1").text, StartsWith("VERTEX_SE2 1 3 3 0.1\n"));
  EXPECT_THAT(take("VERTEX_SE2 0 2 3 0").text, HasSubstr("the id is already in use"));
}

TEST_F(OnlineSessionTest, AnswersOfTheWholeEstimateSayWhatIsNotInIt) {
  take_all(two_poses_);
  EXPECT_THAT(take_all({"CHI2", "FULL", "ESTIMATE ALL"}), Not(HasSubstr("NOTE")));
  take_all({"NEW VERTEX_SE2 7", "VERTEX_SE2 8 0 0 0", "VERTEX_SE2 9 0 0 0"});
  const std::string note =
      "NOTE 3 variables wait for a measurement, the first of them VERTEX_SE2 7: not in the "
      "estimate";
  for (const char* line : {"CHI2", "FULL", "ESTIMATE ALL"})
    EXPECT_THAT(take(line).text, StartsWith(note)) << line;
  EXPECT_THAT(take("ESTIMATE 8").text, HasSubstr("waits for a measurement"));
  EXPECT_THAT(take("ESTIMATE 1").text, Not(HasSubstr("NOTE")));
  // Measurements are not solved meanwhile.
  EXPECT_EQ(take("EDGE_SE2 1 8" + kStep).text, "");
  EXPECT_THAT(take("CHI2").text, HasSubstr("until each has one or is removed"));
  take("REMOVE VARIABLE 9");
  EXPECT_THAT(take("CHI2").text, StartsWith("NOTE VERTEX_SE2 7 waits for a measurement: "));
  EXPECT_EQ(session_->waiting(), "VERTEX_SE2 7 waits for a measurement");
  EXPECT_THAT(take("EDGE_SE2 1 7" + kStep).text, HasSubstr("OK "));
  EXPECT_THAT(take_all({"CHI2", "FULL", "ESTIMATE ALL"}), Not(HasSubstr("NOTE")));
  EXPECT_EQ(session_->waiting(), "");
}

TEST_F(OnlineSessionTest, TheFirstMarginalizeSaysWhatCannotBeWrittenAnyMore) {
  take_all(two_poses_);
  take_all(
      {"NEW VERTEX_SE2 2", "EDGE_SE2 1 2" + kStep, "NEW VERTEX_SE2 3", "EDGE_SE2 2 3" + kStep});
  const std::string first = take("MARGINALIZE 0").text;
  EXPECT_THAT(first, StartsWith("NOTE what MARGINALIZE leaves is in no format of graphs"));
  for (const char* word : {"SAVE and -o", "SPARSIFY", "REMOVE FACTOR 3", "\nPRIOR 3\n"})
    EXPECT_THAT(first, HasSubstr(word));
  EXPECT_THAT(take("MARGINALIZE 1").text, StartsWith("PRIOR "));
}

TEST_F(OnlineSessionTest, RestoredLinesGiveTheSameEstimateWithoutAnswers) {
  std::vector<std::string> lines = two_poses_;
  lines.insert(lines.end(), {"NEW VERTEX_SE2 2", "EDGE_SE2 1 2" + kStep,
                             "EDGE_SE2 0 2 1.9 0.2 0.3 50 0 0 50 0 50"});
  take_all(lines);
  const std::string estimate = take("ESTIMATE ALL").text;
  begin({.read = {}, .output = "all"});
  for (const std::string& line : lines) session_->restore(line, ++number_);
  EXPECT_EQ(take("ESTIMATE ALL").text, estimate);
  EXPECT_THROW(session_->restore("NONSENSE", 99), Error);
  EXPECT_THAT(take("CHI2").text, HasSubstr("\nOK "));  // answers are given again
}

TEST_F(OnlineSessionTest, ASaveThatIsRestoredWritesNothing) {
  const std::filesystem::path file = std::filesystem::temp_directory_path() /
                                     ("cairn_save_" + std::to_string(::getpid()) + ".g2o");
  std::filesystem::remove(file);
  for (const std::string& line : two_poses_) session_->restore(line, ++number_);
  session_->restore("SAVE " + file.string(), ++number_);
  EXPECT_FALSE(std::filesystem::exists(file));
  EXPECT_THAT(take("SAVE " + file.string()).text, StartsWith("OK 6 "));
  EXPECT_TRUE(std::filesystem::remove(file));
}

/// An optimizer that ends before it has converged.
class Tired final : public Optimizer {
 public:
  Summary optimize(Graph& graph, const Stop&, Observer&) override {
    Summary summary;
    summary.status = Status::max_iterations;
    summary.initial_chi2 = summary.final_chi2 = chi2(graph);
    return summary;
  }
};

TEST_F(OnlineSessionTest, FullSaysIfItHasNotConverged) {
  take_all(two_poses_);
  EXPECT_THAT(take("FULL").text, StartsWith("OK 5 "));
  registry_.add<Optimizer>("tired", OptionTable{},
                           [](const Options&, Registry&) { return std::make_unique<Tired>(); });
  estimator_ = registry_.make<Estimator>("batch:optimizer=tired");
  session_ = std::make_unique<OnlineSession>(*estimator_, *format_, registry_,
                                             OnlineSettings{.read = {}, .output = "none"});
  number_ = 0;
  take_all(two_poses_);
  EXPECT_EQ(take("SOLVE").text, "UNCONVERGED 5 variables 2 factors 1 owed 0\n") << "noted before";
  EXPECT_EQ(take("FULL").text,
            "NOTE not converged: max_iterations after 0 iterations\n"
            "UNCONVERGED 6 variables 2 factors 1 owed 0\n");
}

TEST_F(OnlineSessionTest, AChi2ThatIsNotFiniteIsAnError) {
  take_all(
      {"VERTEX_SE2 0 0 0 0", "FIX 0", "VERTEX_SE2 1 1e200 0 0", "FIX 1", "EDGE_SE2 0 1" + kStep});
  EXPECT_THAT(take("CHI2").text, StartsWith("ERROR line 6: chi2 is not finite"));
}

TEST_F(OnlineSessionTest, QuitEndsIt) {
  const LineSession::Reply reply = take("QUIT");
  EXPECT_TRUE(reply.quit);
  EXPECT_EQ(reply.text, "OK 1 variables 0 factors 0 owed 0\n");
}

}  // namespace
}  // namespace cairn
