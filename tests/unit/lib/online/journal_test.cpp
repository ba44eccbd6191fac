// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/journal.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

class JournalTest : public ::testing::Test {
 protected:
  JournalTest()
      : file_(std::filesystem::temp_directory_path() /
              ("cairn_journal_" + std::to_string(::getpid()))) {}
  ~JournalTest() override { std::filesystem::remove(file_); }

  std::vector<std::string> records(std::string* note = nullptr) const {
    Journal journal(file_, "robot", Journal::Sync::batch);
    std::vector<std::string> all;
    for (const Journal::Record& record : journal.take_records())
      all.push_back(std::to_string(record.number) + ":" + record.text);
    if (note) *note = journal.note();
    return all;
  }
  std::string bytes() const {
    std::ifstream in(file_, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void write(const std::string& text) const {
    std::ofstream(file_, std::ios::binary | std::ios::trunc) << text;
  }
  void fill() const {
    Journal journal(file_, "robot", Journal::Sync::every);
    journal.append(1, "first");
    journal.append(5, "second, with  blanks ");
    journal.append(6, "");
  }
  static std::string refusal(const std::function<void()>& call, ErrorCode code) {
    try {
      call();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code);
      return error.what();
    }
    return "";
  }
  std::filesystem::path file_;
};

const std::vector<std::string> kAll = {"1:first", "5:second, with  blanks ", "6:"};

TEST_F(JournalTest, HasWhatWasCommitted) {
  fill();
  std::string note;
  EXPECT_EQ(records(&note), kAll);
  EXPECT_EQ(note, "");
  EXPECT_EQ(records(), kAll);  // reading changes nothing
}

TEST_F(JournalTest, WhatWasOnlyAppendedIsNotWritten) {
  Journal journal(file_, "robot", Journal::Sync::batch);
  const std::string before = bytes();
  journal.append(1, "a");
  EXPECT_EQ(bytes(), before);
  journal.commit();
  EXPECT_THAT(bytes(), HasSubstr(" 1 a\n"));
}

TEST_F(JournalTest, CutsOffATornEndWhereverItTore) {
  fill();
  const std::string whole = bytes();
  for (std::size_t size = 0; size <= whole.size(); ++size) {
    write(whole.substr(0, size));
    std::string note;
    const std::vector<std::string> left = records(&note);
    ASSERT_LE(left.size(), kAll.size());
    EXPECT_TRUE(std::equal(left.begin(), left.end(), kAll.begin())) << size;
    // It goes on from there.
    {
      Journal journal(file_, "robot", Journal::Sync::none);
      journal.append(9, "more");
    }
    EXPECT_EQ(records().back(), "9:more") << size;
    EXPECT_EQ(records().size(), left.size() + 1);
  }
}

TEST_F(JournalTest, RefusesDamageInTheMiddle) {
  fill();
  std::string damaged = bytes();
  damaged[damaged.find("first")] = 'F';
  write(damaged);
  EXPECT_THAT(refusal([&] { records(); }, ErrorCode::input),
              HasSubstr(":2: the record is damaged"));
  EXPECT_EQ(bytes(), damaged);
}

TEST_F(JournalTest, RefusesWhatBelongsToAnother) {
  fill();
  EXPECT_THAT(refusal([&] { Journal(file_, "ship", Journal::Sync::batch); }, ErrorCode::usage),
              HasSubstr("belongs to 'robot', and this is 'ship'"));
  write("VERTEX_SE2 0 0 0 0\n");
  EXPECT_THAT(refusal([&] { records(); }, ErrorCode::input), HasSubstr("no journal"));
  write("VERTEX");
  EXPECT_THAT(refusal([&] { records(); }, ErrorCode::input), HasSubstr("no journal"));
}

TEST_F(JournalTest, IsForOneAtATime) {
  const Journal journal(file_, "robot", Journal::Sync::batch);
  EXPECT_THAT(refusal([&] { records(); }, ErrorCode::usage), HasSubstr("in use"));
}

TEST_F(JournalTest, SaysWhereItCannotBe) {
  EXPECT_THAT(
      refusal([&] { Journal("/nowhere/at/all", "robot", Journal::Sync::batch); }, ErrorCode::input),
      HasSubstr("/nowhere/at/all: the journal cannot be opened"));
}

}  // namespace
}  // namespace cairn
