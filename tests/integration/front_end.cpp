// SPDX-License-Identifier: BSD-3-Clause
#include "integration/front_end.hpp"

#include <algorithm>
#include <sstream>

#include "cairn/plugin/registry.hpp"

namespace cairn::test {
namespace {

bool ends_answer(const std::string& line) {
  return line.starts_with("OK ") || line.starts_with("ERROR ");
}

/// The key of two poses, either way round.
std::pair<long, long> pair(long a, long b) { return std::minmax(a, b); }

}  // namespace

Arguments online(const std::string& policy, Arguments more) {
  Arguments arguments{"online", "--policy", policy, "--quiet"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

std::string joined(const Lines& lines, std::size_t from) {
  std::string text;
  for (std::size_t k = from; k < lines.size(); ++k) text += lines[k] + "\n";
  return text;
}

Lines words(const std::string& line) {
  std::istringstream stream(line);
  Lines all;
  for (std::string word; stream >> word;) all.push_back(word);
  return all;
}

Lines square() {
  Lines told{"NEW VERTEX_SE2 0"};
  for (int k = 1; k <= 4; ++k) {
    told.push_back("NEW VERTEX_SE2 " + std::to_string(k));
    told.push_back("EDGE_SE2 " + std::to_string(k - 1) + " " + std::to_string(k) + kStep);
  }
  return told;
}

Recording::Recording(const std::string& file) {
  for (const std::string& line : lines(read_text(file))) {
    const Lines fields = words(line);
    if (line.starts_with("VERTEX")) poses_[std::stol(fields[1])] = line;
    if (line.starts_with("EDGE"))
      measured_[pair(std::stol(fields[1]), std::stol(fields[2]))].push_back(line);
    if (line.starts_with("FIX")) fixed_.insert(std::stol(fields[1]));
  }
}

Lines Recording::match(long a, long b) const {
  const auto there = measured_.find(pair(a, b));
  return there == measured_.end() ? Lines() : there->second;
}

std::int64_t Dialogue::count(const std::string& first_word) const {
  return std::ranges::count_if(
      heard, [&](const std::string& line) { return words(line)[0] == first_word; });
}

std::set<long> Dialogue::kept() const {
  std::set<long> poses;
  for (const std::string& line : heard) {
    if (line.starts_with("KEPT ")) poses.insert(std::stol(words(line)[1]));
  }
  return poses;
}

Dialogue FrontEnd::drive() {
  long before = -1;
  for (const auto& [pose, line] : recording_.poses()) {
    tell(line);
    if (recording_.fixed(pose)) tell("FIX " + std::to_string(pose));
    for (const std::string& motion : recording_.match(before, pose)) tell(motion);
    while (match_one()) {
    }
    if (more_) {
      for (const std::string& question : more_(pose)) ask(question);
    }
    const Lines answer = ask("DONE");
    if (answer.empty() || !answer.back().starts_with("OK ")) break;
    before = pose;
  }
  ask("QUIT");
  return std::move(dialogue_);
}

void FrontEnd::tell(const std::string& line) {
  dialogue_.told.push_back(line);
  partner_.tell(line);
}

Lines FrontEnd::ask(const std::string& line) {
  tell(line);
  Lines answer;
  while (answer.empty() || !ends_answer(answer.back())) {
    const std::optional<std::string> heard = partner_.hear();
    if (!heard) {
      ADD_FAILURE() << "no answer to " << line;
      break;
    }
    answer.push_back(*heard);
  }
  dialogue_.heard.insert(dialogue_.heard.end(), answer.begin(), answer.end());
  return answer;
}

bool FrontEnd::match_one() {
  const Lines answer = ask("NEXT");
  if (answer.size() < 2) return false;
  const Lines match = words(answer[answer.size() - 2]);
  if (match[0] != "MATCH" || match[1] == "NONE") return false;
  const Lines measured = recording_.match(std::stol(match[1]), std::stol(match[2]));
  for (const std::string& line : measured) tell(line);
  if (measured.empty()) tell("NOMATCH " + match[1] + " " + match[2]);
  return true;
}

void OnlinePolicy::SetUp() {
  const Registry registry;
  if (!registry.has("pose_policy", "compact_pose") || !registry.has("registration", "recorded") ||
      !registry.has("estimator", "incremental_cholesky") || !registry.has("types", "slam2d") ||
      !registry.has("stream_format", "g2o") || !registry.has("generator", "manhattan") ||
      !registry.has("linear_solver", "block_cholesky"))
    GTEST_SKIP() << "compact_pose, or what it needs, is missing";
}

std::string OnlinePolicy::generate(const std::string& kind) {
  std::string file = folder_.file("graph.g2o");
  const Outcome made = cairn({"generate", kind, "-o", file, "--seed", "3", "--quiet"});
  EXPECT_EQ(made.exit_code, 0) << made.err;
  return file;
}

Dialogue OnlinePolicy::drive(const std::string& graph, const Arguments& arguments,
                             FrontEnd::More more) {
  Partner partner(arguments);
  Dialogue dialogue = FrontEnd(Recording(graph), partner, std::move(more)).drive();
  const Outcome end = partner.end();
  EXPECT_EQ(end.exit_code, 0) << end.err;
  EXPECT_EQ(end.out, "");
  return dialogue;
}

}  // namespace cairn::test
