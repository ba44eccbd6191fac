// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/conversation.hpp"

#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

/// SET n changes, ASK answers, BOTH does both, BAD is refused, QUIT ends.
class Notebook final : public LineSession {
 public:
  std::vector<std::pair<std::int64_t, std::string>> set;
  bool finished = false;
  bool strict = false;  ///< refuses SET as well

  void finish() override { finished = true; }
  Estimator& estimator() override { throw std::logic_error("not asked for"); }
  std::int64_t variable_count() const override { return std::ssize(set); }
  std::int64_t factor_count() const override { return 0; }
  bool is_variable_type(std::string_view) const override { return false; }

 private:
  void perform(std::string_view text, const Words& words, Reply& reply) override {
    if (words[0] == "BAD" || strict) throw bad_line("bad");
    if (words[0] == "SET" || words[0] == "BOTH") {
      set.emplace_back(line(), text);
      reply.changes = true;
    }
    if (words[0] == "ASK" || words[0] == "BOTH") acknowledge(reply);
    if (words[0] == "BOTH") {
      reply.solved = true;
      reply.seconds = 0.5;
    }
    reply.quit = words[0] == "QUIT";
  }
};

class ConversationTest : public ::testing::Test {
 protected:
  ConversationTest() {
    folder_ = std::filesystem::temp_directory_path() /
              ("cairn_conversation_" +
               std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  ~ConversationTest() override { std::filesystem::remove_all(folder_); }
  Journal journal() const { return Journal(folder_ / "log", "test", Journal::Sync::batch); }
  std::string written() const {
    std::ifstream file(folder_ / "log");
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }
  std::filesystem::path folder_;
};

TEST_F(ConversationTest, NumbersAndCountsLines) {
  Notebook notebook;
  Conversation conversation(notebook);
  EXPECT_THAT(conversation.restore(), IsEmpty());
  conversation.take("SET 1");
  EXPECT_EQ(conversation.take("ASK").text, "OK 2 variables 1 factors 0 owed 0\n");
  EXPECT_EQ(conversation.take("BAD").text, "ERROR line 3: bad\n");
  conversation.take("BOTH");
  EXPECT_TRUE(conversation.take("QUIT").quit);
  conversation.finish();
  EXPECT_TRUE(notebook.finished);
  const Conversation::Counts& counts = conversation.counts();
  EXPECT_EQ(counts.lines, 5);
  EXPECT_EQ(counts.taken, 2);
  EXPECT_EQ(counts.refused, 1);
  EXPECT_EQ(counts.solves, 1);
  EXPECT_EQ(counts.restored, 0);
  EXPECT_EQ(counts.solve_seconds, 0.5);
  EXPECT_EQ(counts.longest, 0.5);
}

TEST_F(ConversationTest, WhatIsAcknowledgedIsInTheFile) {
  Notebook notebook;
  Journal log = journal();
  Conversation conversation(notebook, &log);
  EXPECT_EQ(conversation.restore(), "RESTORED 0 variables 0 factors 0\n");
  conversation.take("SET first");
  EXPECT_THAT(written(), Not(HasSubstr("SET first")));  // not acknowledged yet
  conversation.take("ASK");
  EXPECT_THAT(written(), HasSubstr("SET first"));
  EXPECT_THAT(written(), Not(HasSubstr("ASK")));
  conversation.take("BOTH second");
  EXPECT_THAT(written(), HasSubstr("BOTH second"));
  conversation.take("SET third");
  conversation.finish();
  EXPECT_THAT(written(), HasSubstr("SET third"));
}

TEST_F(ConversationTest, RefusesAJournalThatLeavesNoNumber) {
  {
    Journal log = journal();
    log.append(std::numeric_limits<std::int64_t>::max(), "SET last");
  }
  Notebook notebook;
  Journal log = journal();
  Conversation conversation(notebook, &log);
  EXPECT_THROW(conversation.restore(), Error);
}

TEST_F(ConversationTest, GoesOnWhereTheJournalEnds) {
  {
    Notebook notebook;
    Journal log = journal();
    Conversation conversation(notebook, &log);
    conversation.restore();
    for (const char* line : {"SET a", "ASK", "BAD", "SET b"}) conversation.take(line);
    conversation.finish();
  }
  Notebook notebook;
  Journal log = journal();
  Conversation conversation(notebook, &log);
  EXPECT_EQ(conversation.restore(), "RESTORED 4 variables 2 factors 0\n");
  EXPECT_THAT(notebook.set, ElementsAre(std::pair<std::int64_t, std::string>(1, "SET a"),
                                        std::pair<std::int64_t, std::string>(4, "SET b")));
  EXPECT_EQ(conversation.counts().restored, 2);
  EXPECT_EQ(conversation.counts().lines, 0);
  EXPECT_EQ(conversation.take("ASK").text, "OK 5 variables 2 factors 0 owed 0\n");
}

TEST_F(ConversationTest, SaysWhichLineOfTheJournalIsRefusedNow) {
  {
    Notebook notebook;
    Journal log = journal();
    Conversation conversation(notebook, &log);
    conversation.take("ASK");
    conversation.take("SET a");
    conversation.finish();
  }
  Notebook strict;
  strict.strict = true;
  Journal log = journal();
  Conversation conversation(strict, &log);
  try {
    conversation.restore();
    FAIL() << "nothing was refused";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("the journal's line 2 was taken before and is now refused"));
  }
}

}  // namespace
}  // namespace cairn
