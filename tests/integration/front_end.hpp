// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "integration/process.hpp"

namespace cairn::test {

using Lines = std::vector<std::string>;

inline const std::string kPolicy = "compact_pose:range=3,angle=0.8,reuse=false";
inline const std::string kStep = " 1 0 1.5 100 0 0 100 0 100";  // motion and information
inline const std::string kHere = " 0 0 0 900 0 0 900 0 900";

/// The arguments of cairn online with a policy.
Arguments online(const std::string& policy, Arguments more = {});
/// As text, from line `from` on.
std::string joined(const Lines& lines, std::size_t from = 0);
Lines words(const std::string& line);
/// Once round a square: pose 4 is where pose 0 was.
Lines square();

/// A recording, as a front end remembers what its sensors have seen.
class Recording {
 public:
  explicit Recording(const std::string& file);
  const std::map<long, std::string>& poses() const { return poses_; }
  bool fixed(long pose) const { return fixed_.contains(pose); }
  Lines match(long a, long b) const;

 private:
  std::map<long, std::string> poses_;
  std::map<std::pair<long, long>, Lines> measured_;
  std::set<long> fixed_;
};

/// What was said by one, and what was heard by the other.
struct Dialogue {
  Lines told;
  Lines heard;

  std::int64_t count(const std::string& first_word) const;
  std::set<long> kept() const;
};

/// Drives cairn through a recording; `at_each_pose` may have more to say before its end.
class FrontEnd {
 public:
  using More = std::function<Lines(long pose)>;

  FrontEnd(const Recording& recording, Partner& partner, More at_each_pose = {})
      : recording_(recording), partner_(partner), more_(std::move(at_each_pose)) {}

  Dialogue drive();

 private:
  void tell(const std::string& line);
  Lines ask(const std::string& line);
  bool match_one();

  const Recording& recording_;
  Partner& partner_;
  More more_;
  Dialogue dialogue_;
};

/// Skipped where the plugins for it are not there.
class OnlinePolicy : public testing::Test {
 protected:
  void SetUp() override;

  std::string generate(const std::string& kind);
  Dialogue drive(const std::string& graph, const Arguments& arguments, FrontEnd::More more = {});

  TemporaryFolder folder_;
};

}  // namespace cairn::test
