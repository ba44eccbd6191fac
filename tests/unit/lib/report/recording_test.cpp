// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/recording.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>
#include <filesystem>
#include <fstream>

#include "cairn/io/format.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "support/spaced_json.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;

class Recorded : public ::testing::Test {
 protected:
  Recorded() {
    graph_ = registry_.make<Generator>("manhattan:poses=100")->generate(registry_, 5).graph;
    start_ = graph_.values();
  }
  ~Recorded() override { std::filesystem::remove(file_); }

  Summary record(const Stop& stop = {}) {
    RecordingWriter writer(file_, "levenberg_marquardt", "city <b>.g2o");
    const auto optimizer = registry_.make<Optimizer>("levenberg_marquardt");
    Summary summary = optimizer->optimize(graph_, stop, writer);
    writer.finish(graph_, summary);
    return summary;
  }

  Registry registry_;
  Graph graph_;
  Values start_;
  std::string file_ = std::filesystem::temp_directory_path() /
                      ("cairn_recording_test_" + std::to_string(::getpid()) + ".jsonl");
};

TEST_F(Recorded, HasTheStartEveryAcceptedIterationAndTheEnd) {
  const Summary summary = record();
  const Scene scene = read_recording(read_file(file_), "run.jsonl");
  ASSERT_EQ(scene.recordings.size(), 1U);
  const std::vector<Frame>& frames = scene.recordings[0].frames;
  std::size_t accepted = 0;
  for (const Iteration& it : summary.iterations) accepted += it.accepted;
  ASSERT_EQ(frames.size(), accepted + 1);
  const auto expect_at = [&](const Frame& frame, const Values& values) {
    std::vector<float> positions;
    copy_positions(graph_, values, 2, scene.origin, positions);
    EXPECT_EQ(frame.positions, positions);
  };
  expect_at(frames.front(), start_);
  expect_at(frames.back(), graph_.values());
  EXPECT_DOUBLE_EQ(frames.front().chi2, summary.initial_chi2);
  EXPECT_DOUBLE_EQ(frames.back().chi2, summary.final_chi2);
}

TEST_F(Recorded, HasTheRunAsItWasReported) {
  const Summary summary = record();
  const Scene scene = read_recording(read_file(file_), "run.jsonl");
  ASSERT_EQ(scene.runs.size(), 1U);
  const Summary& back = scene.runs[0].summary;
  EXPECT_EQ(back.linear_solver, "block_cholesky");
  EXPECT_EQ(back.status, summary.status);
  EXPECT_DOUBLE_EQ(back.final_chi2, summary.final_chi2);
  EXPECT_DOUBLE_EQ(back.seconds.total, summary.seconds.total);
  ASSERT_EQ(back.iterations.size(), summary.iterations.size());
  for (std::size_t k = 0; k < back.iterations.size(); ++k) {
    EXPECT_DOUBLE_EQ(back.iterations[k].chi2, summary.iterations[k].chi2);
    EXPECT_EQ(back.iterations[k].accepted, summary.iterations[k].accepted);
  }
}

/// Any JSON library writes it with blanks, and some sort the members.
TEST_F(Recorded, IsReadWhateverItsBlanksAndTheOrderOfItsMembers) {
  record();
  const std::string text = read_file(file_);
  const std::string first = R"("format":"cairn-recording",)";
  ASSERT_EQ(text.find(first), 1U);
  std::string sorted = text;
  sorted.erase(1, first.size()).insert(sorted.find("}\n"), R"(,"format":"cairn-recording")");
  const Scene expected = read_recording(text, "run.jsonl");
  for (const std::string& other : {spaced_json(text), sorted, spaced_json(sorted)}) {
    ASSERT_TRUE(is_recording(other)) << other.substr(0, 100);
    const Scene scene = read_recording(other, "run.jsonl");
    ASSERT_EQ(scene.recordings.size(), 1U);
    const std::vector<Frame>& frames = scene.recordings[0].frames;
    ASSERT_EQ(frames.size(), expected.recordings[0].frames.size());
    for (std::size_t k = 0; k < frames.size(); ++k)
      EXPECT_EQ(frames[k].positions, expected.recordings[0].frames[k].positions);
  }
  for (const char* none : {"", "{", "{}\n", R"({"format":"cairn-report"})", "[1]", "VERTEX_SE2 0"})
    EXPECT_FALSE(is_recording(none)) << none;
}

TEST_F(Recorded, OfARunThatWasKilledIsReadAsFarAsItGot) {
  record();
  std::string text = read_file(file_);
  text.resize(text.rfind("{\"summary\"") - 10);  // within the last iteration's line
  const Scene whole = read_recording(read_file(file_), "run.jsonl");
  const Scene cut = read_recording(text, "run.jsonl");
  EXPECT_EQ(cut.recordings[0].frames.size(), whole.recordings[0].frames.size() - 1);
}

TEST_F(Recorded, ThatIsDamagedIsRefusedWithItsLine) {
  record();
  std::string text = read_file(file_);
  const std::size_t second = text.find('\n') + 1;
  text.replace(text.find("\"base64\":\"", second) + 10, 4, "####");
  try {
    read_recording(text, "run.jsonl");
    FAIL() << "was read";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input);
    EXPECT_THAT(error.what(), HasSubstr("run.jsonl:2"));
  }
  EXPECT_THROW(read_recording("{}", "x"), Error);
  EXPECT_THROW(read_recording(R"({"format":"cairn-recording","version":2})", "x"), Error);
}

TEST_F(Recorded, IsNoReasonToFailAnOptimisationUntilItsEnd) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  RecordingWriter writer("/dev/full", "x", "y");
  const Summary summary =
      registry_.make<Optimizer>("levenberg_marquardt")->optimize(graph_, {}, writer);
  EXPECT_EQ(summary.status, Status::converged);
  EXPECT_THROW(writer.finish(graph_, summary), Error);
}

}  // namespace
}  // namespace cairn::test
