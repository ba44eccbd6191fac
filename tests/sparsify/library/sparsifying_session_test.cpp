// SPDX-License-Identifier: BSD-3-Clause
// SPARSIFY in the line protocol: the subject online with the sparsifier of estimators.
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/io/format.hpp"
#include "cairn/online/conversation.hpp"
#include "cairn/online/online_session.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/sparsification/map_sparsifier.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

std::string edge(int a, int b, double x, double turn) {
  std::ostringstream line;
  line << "EDGE_SE2 " << a << ' ' << b << ' ' << x << " 0.01 " << turn << " 100 0 0 100 0 400";
  return line.str();
}

/// Poses around a square of four metres, twice and on; each knows the one that was there before if
/// it is 16 poses old.
std::vector<std::string> drive(int begin, int end) {
  std::vector<std::string> lines;
  for (int k = begin; k < end; ++k) {
    if (k == 0) {
      lines.insert(lines.end(), {"VERTEX_SE2 0 0 0 0", "FIX 0"});
      continue;
    }
    lines.push_back("NEW VERTEX_SE2 " + std::to_string(k));
    lines.push_back(edge(k - 1, k, 1.0 + 0.01 * (k % 5), k % 4 == 0 ? 1.57 : 0.01));
    if (k >= 16 && k % 3 != 0) lines.push_back(edge(k - 16, k, 0.02 * (k % 3), 0.0));
  }
  return lines;
}

class SparsifyingSession : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    CAIRN_NEEDS("types", "slam2d");
    CAIRN_NEEDS("stream_format", "g2o");
    begin({});
  }
  void begin(OnlineSettings settings) {
    number_ = 0;
    if (settings.output == "last") settings.output = "none";
    settings.remover = &remover_;
    format_ = registry_.make<StreamFormat>("g2o");
    estimator_ = registry_.make<Estimator>(GetParam());
    session_ = std::make_unique<OnlineSession>(*estimator_, *format_, registry_, settings);
  }
  LineSession::Reply take(const std::string& line) { return session_->take(line, ++number_); }
  std::string take_all(const std::vector<std::string>& lines) {
    std::string text;
    for (const std::string& line : lines) text += take(line).text;
    return text;
  }
  /// A file of this test and process.
  static std::filesystem::path file(const std::string& ending) {
    return std::filesystem::temp_directory_path() /
           ("cairn_sparsifying_" + std::to_string(::getpid()) + ending);
  }
  static std::string text_of(const std::filesystem::path& file) {
    std::ifstream stream(file);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  /// Everything about the map, to the last bit of every number.
  std::string map() {
    const std::filesystem::path at = file(".g2o");
    const std::string text = take("ESTIMATE ALL").text + take("SAVE " + at.string()).text;
    const std::string saved = text_of(at);
    std::filesystem::remove(at);
    return text.substr(0, text.find("OK")) + saved;
  }
  Registry registry_;
  MapSparsifier remover_{registry_};
  std::unique_ptr<StreamFormat> format_;
  std::unique_ptr<Estimator> estimator_;
  std::unique_ptr<OnlineSession> session_;
  std::int64_t number_ = 0;
};

TEST_P(SparsifyingSession, RemovesPosesAndNamesTheFactorsThatReplaceThem) {
  take_all(drive(0, 6));  // factors 0 … 4
  const LineSession::Reply reply = take("SPARSIFY 2 3");
  EXPECT_TRUE(reply.changes);
  EXPECT_TRUE(reply.solved);
  EXPECT_THAT(reply.text, StartsWith("REMOVED 2\nREMOVED 3\nFACTOR 5 1 4\nKLD "));
  EXPECT_THAT(reply.text, HasSubstr("\nOK 13 variables 4 factors 3 owed 0\n"));
  // It is a factor like any other.
  EXPECT_FALSE(take("CHANGE 5 3.1 0 0").refused);
  EXPECT_FALSE(take("REMOVE FACTOR 5").refused);
  EXPECT_THAT(take("ESTIMATE 2").text, HasSubstr("there is no variable 2"));
  EXPECT_THAT(take(edge(2, 5, 1.0, 0.0)).text, HasSubstr("there is no variable 2"));
}

TEST_P(SparsifyingSession, TheMapCanBeWrittenAfterwards) {
  take_all(drive(0, 30));
  take("SPARSIFY 4 9 14");
  const std::string saved = map();
  EXPECT_THAT(saved, AllOf(HasSubstr("VERTEX_SE2 3 "), Not(HasSubstr("VERTEX_SE2 4 ")),
                           HasSubstr("EDGE_SE2 "), Not(HasSubstr("EDGE_SE2 3 4 "))));
}

TEST_P(SparsifyingSession, RefusesWhatItCannotDoAndChangesNothing) {
  std::vector<std::string> lines = drive(0, 8);
  lines.insert(lines.end(), {"VERTEX_XY 50 1 1", "EDGE_BEARING_RANGE_SE2_XY 3 50 0.5 1.5 9 0 9",
                             "EDGE_PRIOR_XY 50 1 1 9 0 9", "NEW VERTEX_SE2 60"});
  take_all(lines);
  const std::string before = map();
  const std::vector<std::pair<std::string, std::string>> refused = {
      {"SPARSIFY", "expected 'SPARSIFY id …' or 'SPARSIFY KEEP n'"},
      {"SPARSIFY x", "'x' is not a valid id"},
      {"SPARSIFY 2 99", "there is no variable 99 to be removed"},
      {"SPARSIFY 60", "there is no variable 60 to be removed"},  // no measurement yet
      {"SPARSIFY 2 2", "variable 2 is to leave twice"},
      {"SPARSIFY 0", "marginalising it would leave a linear prior on them instead"},
      {"SPARSIFY 50", "no factor of the graph measures a whole pose in the world"},
      {"SPARSIFY KEEP", "expected 'SPARSIFY KEEP n' or 'SPARSIFY KEEP ALL'"},
      {"SPARSIFY KEEP 1", "expected a number of poses from 2"},
      {"SPARSIFY KEEP many", "'many' is not a valid number of poses"},
  };
  for (const auto& [line, reason] : refused) {
    const LineSession::Reply reply = take(line);
    EXPECT_TRUE(reply.refused) << line;
    EXPECT_FALSE(reply.changes) << line;
    EXPECT_THAT(reply.text, HasSubstr(reason)) << line;
  }
  EXPECT_EQ(map(), before);
}

TEST_P(SparsifyingSession, KeepsANumberOfPoses) {
  take_all(drive(0, 20));
  const std::string reduced = take("SPARSIFY KEEP 12").text;
  EXPECT_THAT(reduced,
              AllOf(HasSubstr("REMOVED "), HasSubstr("KLD "), HasSubstr(" variables 12 factors ")));
  EXPECT_FALSE(estimator_->has(19) && !estimator_->has(0));
  for (int k = 20; k < 60; ++k) {
    for (const std::string& line : drive(k, k + 1)) {
      const std::string text = take(line).text;
      // A loop closure to a pose that has left is refused; the stream goes on.
      if (text.starts_with("ERROR")) {
        EXPECT_THAT(text, HasSubstr("there is no variable"));
      }
      ASSERT_LE(estimator_->variable_count(), 12) << line;
    }
    ASSERT_TRUE(estimator_->has(k));
    ASSERT_TRUE(estimator_->has(k - 1));  // the newest, when this one came
  }
  EXPECT_TRUE(estimator_->has(0));
  EXPECT_THAT(take("SPARSIFY KEEP ALL").text, StartsWith("OK "));
  take_all(drive(60, 64));
  EXPECT_EQ(estimator_->variable_count(), 16);
}

TEST_P(SparsifyingSession, WhereSolvingIsExplicitPosesLeaveWhenItIsAskedFor) {
  begin({.read = {}, .automatic = false, .keep = 10});
  EXPECT_THAT(take_all(drive(0, 20)), IsEmpty());
  EXPECT_EQ(estimator_->variable_count(), 20);
  const LineSession::Reply reply = take("SOLVE");
  EXPECT_THAT(reply.text, AllOf(HasSubstr("REMOVED "), HasSubstr(" variables 10 factors ")));
  EXPECT_EQ(estimator_->variable_count(), 10);
  take_all(drive(20, 22));
  EXPECT_THAT(take("SPARSIFY 21").text, StartsWith("REMOVED 21\nKLD 0\nOK "));
  EXPECT_THAT(take("FULL").text, HasSubstr(" variables 10 factors "));
}

TEST_P(SparsifyingSession, SaysOnceWhyMorePosesStay) {
  std::vector<std::string> lines;
  for (int k = 0; k < 10; ++k) {
    const std::string id = std::to_string(k);
    lines.insert(lines.end(), {"VERTEX_SE2 " + id + " " + id + " 0 0", "FIX " + id});
    if (k > 0) lines.push_back(edge(k - 1, k, 1.0, 0.0));
  }
  take_all(lines);
  EXPECT_THAT(take("SPARSIFY KEEP 5").text, StartsWith("NOTE more poses stay than are to be kept"));
  EXPECT_EQ(estimator_->variable_count(), 10);
  EXPECT_THAT(take_all(drive(10, 11)), Not(HasSubstr("NOTE more poses")));
  EXPECT_EQ(estimator_->variable_count(), 11);
  // The two that are not fixed: one may leave when the next comes.
  EXPECT_THAT(take_all(drive(11, 13)), HasSubstr("REMOVED 10\n"));
}

TEST_P(SparsifyingSession, ALineThatIsRefusedRemovesNoPose) {
  begin({.read = {}, .keep = 10});
  take_all(drive(0, 10));
  take("NEW VERTEX_SE2 10");
  const std::string before = map();
  EXPECT_TRUE(take("EDGE_SE2 9 10 1 0 0 100 0 0 100 0 -100").refused);
  EXPECT_EQ(map(), before);
  EXPECT_THAT(take(edge(9, 10, 1.0, 0.0)).text, StartsWith("REMOVED "));
}

TEST_P(SparsifyingSession, ARestoredSessionHasTheSameMapToTheLastBit) {
  std::vector<std::string> lines = drive(0, 25);
  lines.insert(lines.end(), {"SPARSIFY 3 8", "SPARSIFY 0", "SPARSIFY KEEP 14"});
  const std::vector<std::string> rest = drive(25, 60);
  lines.insert(lines.end(), rest.begin(), rest.end());
  lines.insert(lines.end(), {"SPARSIFY 59", "FULL"});
  const std::filesystem::path log = file(".journal");
  std::filesystem::remove(log);
  std::string before;
  {
    Journal journal(log, "test", Journal::Sync::none);
    Conversation conversation(*session_, &journal);
    conversation.restore();
    for (const std::string& line : lines) {
      conversation.take(line);
      conversation.take("ESTIMATE ALL");  // questions change nothing
    }
    conversation.finish();
    before = map();
  }
  begin({});
  Journal journal(log, "test", Journal::Sync::none);
  Conversation conversation(*session_, &journal);
  EXPECT_THAT(conversation.restore(), HasSubstr(" variables 13 factors "));
  EXPECT_EQ(map(), before);
  std::filesystem::remove(log);
}

TEST_P(SparsifyingSession, WithoutASparsifierItIsRefused) {
  session_ = std::make_unique<OnlineSession>(*estimator_, *format_, registry_, OnlineSettings{});
  EXPECT_THAT(take("SPARSIFY 1").text, HasSubstr("this session has no sparsifier"));
}

INSTANTIATE_TEST_SUITE_P(EveryEstimator, SparsifyingSession,
                         testing::ValuesIn(Registry().names(Estimator::kKind)), test_name);
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(SparsifyingSession);

}  // namespace
}  // namespace cairn::test
