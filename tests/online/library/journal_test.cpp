// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/journal.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

class JournalTest : public ::testing::Test {
 protected:
  JournalTest()
      : file_(std::filesystem::temp_directory_path() /
              ("cairn_journal_" + std::to_string(::getpid()))) {}
  ~JournalTest() override {
    std::filesystem::remove(file_);
    std::filesystem::remove(cut());
  }
  std::filesystem::path cut() const { return file_.string() + ".cut"; }

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
              HasSubstr(":2: the record does not fit"));
  EXPECT_EQ(bytes(), damaged);
}

/// The journal's lines; the first is its header.
std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

TEST_F(JournalTest, RefusesRecordsThatAreMissingDoubledOrMoved) {
  fill();
  const std::vector<std::string> good = lines_of(bytes());
  ASSERT_EQ(good.size(), 4U);
  const std::vector<std::vector<std::size_t>> orders{{0, 2, 3},       {0, 1, 3},    {0, 1, 1, 2, 3},
                                                     {0, 1, 2, 3, 3}, {0, 2, 1, 3}, {0, 1, 3, 2}};
  for (const auto& order : orders) {
    std::string text;
    for (const std::size_t k : order) text += good[k] + "\n";
    write(text);
    EXPECT_THAT(refusal([&] { records(); }, ErrorCode::input), HasSubstr("does not fit"));
    EXPECT_EQ(bytes(), text);
  }
}

TEST_F(JournalTest, RefusesALastLineThatIsWholeAndDamaged) {
  fill();
  std::string text = bytes();
  text[text.size() - 2] ^= 1;
  write(text);
  EXPECT_THAT(refusal([&] { records(); }, ErrorCode::input), HasSubstr(":4: "));
  EXPECT_EQ(bytes(), text);
}

TEST_F(JournalTest, KeepsWhatItCutsOff) {
  fill();
  write(bytes() + "1234 half a");
  std::string note;
  EXPECT_EQ(records(&note), kAll);
  EXPECT_THAT(note, HasSubstr("11 bytes were cut off, and kept in " + cut().string()));
  std::ifstream in(cut());
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), "1234 half a\n");
}

TEST_F(JournalTest, CutsNothingThatItCannotKeep) {
  fill();
  const std::string torn = bytes() + "1234 half a";
  write(torn);
  std::filesystem::create_symlink("/dev/null", cut());
  EXPECT_THAT(refusal([&] { records(); }, ErrorCode::input), HasSubstr("cannot be kept in"));
  EXPECT_EQ(bytes(), torn);
}

TEST_F(JournalTest, GoesOnWithAFileOfFormatOne) {
  // As format 1 had it: each line's checksum is its own.
  write("cairn-journal 1 d82b7ee4 robot\nc0876de4 1 first\n");
  EXPECT_EQ(records(), (std::vector<std::string>{"1:first"}));
  {
    Journal journal(file_, "robot", Journal::Sync::none);
    journal.append(2, "second");
  }
  EXPECT_EQ(records(), (std::vector<std::string>{"1:first", "2:second"}));
  write("cairn-journal 1 d82b7ee4 robot\nc0876de4 1 first\nc0876de4 1 first\n");
  EXPECT_THAT(refusal([&] { records(); }, ErrorCode::input), HasSubstr(":3: "));
}

TEST_F(JournalTest, IsARegularFile) {
  ASSERT_EQ(::mkfifo(file_.c_str(), 0600), 0);
  EXPECT_THAT(refusal([&] { records(); }, ErrorCode::input), HasSubstr("regular file"));
  for (const char* device : {"/dev/zero", "/dev/full"}) {
    EXPECT_THAT(refusal([&] { Journal(device, "robot", Journal::Sync::batch); }, ErrorCode::input),
                HasSubstr("regular file"));
  }
}

TEST_F(JournalTest, NoticesThatItsFileIsGone) {
  Journal journal(file_, "robot", Journal::Sync::none);
  journal.append(1, "a");
  journal.commit();
  write("");
  journal.append(2, "b");
  EXPECT_THAT(refusal([&] { journal.commit(); }, ErrorCode::input), HasSubstr("changed"));
  std::filesystem::remove(file_);
  journal.append(3, "c");
  EXPECT_THAT(refusal([&] { journal.commit(); }, ErrorCode::input), HasSubstr("removed"));
}

TEST_F(JournalTest, RefusesWhatBelongsToAnother) {
  fill();
  EXPECT_THAT(refusal([&] { Journal(file_, "ship", Journal::Sync::batch); }, ErrorCode::usage),
              HasSubstr("belongs to 'robot', and this is 'ship'"));
  write("VERTEX_SE2 0 0 0 0\n");
  EXPECT_THAT(refusal([&] { records(); }, ErrorCode::input), HasSubstr("not a journal"));
  write("VERTEX");
  EXPECT_THAT(refusal([&] { records(); }, ErrorCode::input), HasSubstr("not a journal"));
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
