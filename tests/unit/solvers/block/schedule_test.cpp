// SPDX-License-Identifier: BSD-3-Clause
#include "block/schedule.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <vector>

#include "block/ordering.hpp"
#include "support/block_systems.hpp"

namespace cairn::block {
namespace {

/// Takes all steps one after the other, as one thread alone would, and checks that none has to
/// wait.
class OneAfterTheOther {
 public:
  OneAfterTheOther(const Symbolic& symbolic, const Schedule& schedule)
      : symbolic_(symbolic), schedule_(schedule), signalled_(schedule.gates, 0) {
    for (const Step& step : schedule.steps) take(step);
  }
  const std::multiset<std::int32_t>& finished() const { return finished_; }
  int large() const { return large_; }
  int waiting() const { return waiting_; }

 private:
  void take(const Step& step) {
    for (const Step::Wait& wait : step.waits) {
      if (wait.gate >= 0 && signalled_[wait.gate] < wait.count) ++waiting_;
    }
    for (std::int32_t l = 0; l < step.levels; ++l) {
      if (signalled_[schedule_.level_gates[l]] < std::ssize(schedule_.levels[l])) ++waiting_;
    }
    const auto nodes = symbolic_.supernodes();
    if (step.kind == Step::Kind::task) {
      for (std::int32_t s = schedule_.tasks[step.which].begin; s < schedule_.tasks[step.which].end;
           ++s) {
        finished_.insert(s);
        if (nodes[s].parent >= schedule_.tasks[step.which].end)
          ++signalled_[schedule_.ready[nodes[s].parent]];
      }
    }
    if (step.kind == Step::Kind::front || step.kind == Step::Kind::finish) {
      finished_.insert(step.which);
      large_ += step.kind == Step::Kind::finish;
    }
    for (const std::int32_t gate : step.signals) {
      if (gate >= 0) ++signalled_[gate];
    }
  }

  const Symbolic& symbolic_;
  const Schedule& schedule_;
  std::vector<std::int32_t> signalled_;
  std::multiset<std::int32_t> finished_;
  int large_ = 0, waiting_ = 0;
};

// In a solid grid the upper separators make large fronts, several to a level.
TEST(Schedule, PutsEveryStepAfterAllThatItWaitsFor) {
  for (const char* ordering : {"amd", "natural"}) {
    for (const int side : {2, 6, 11}) {
      const BlockStructure structure = test::solid_grid(side, 6);
      const Symbolic symbolic(structure, order(structure, ordering));
      const Schedule schedule(symbolic, 3);
      if (schedule.lanes == 1) {
        EXPECT_TRUE(schedule.steps.empty());
        continue;
      }
      const OneAfterTheOther run(symbolic, schedule);
      EXPECT_EQ(run.waiting(), 0) << ordering << ' ' << side;
      if (side == 11) {
        EXPECT_GT(run.large(), 3) << ordering;
      }
      // Every supernode once.
      std::multiset<std::int32_t> all;
      for (std::int32_t s = 0; s < std::ssize(symbolic.supernodes()); ++s) all.insert(s);
      EXPECT_EQ(run.finished(), all) << ordering << ' ' << side;
    }
  }
}

/// What of a supernode's front the steps of one kind cover: sorted, without gap or overlap.
void expect_cover(std::vector<std::pair<std::int64_t, std::int64_t>> parts, std::int64_t begin,
                  std::int64_t end) {
  std::ranges::sort(parts);
  for (const auto& [from, to] : parts) {
    EXPECT_EQ(from, begin);
    begin = to;
  }
  EXPECT_EQ(begin, end);
}

TEST(Schedule, CutsALargeFrontWithoutGapOrOverlap) {
  const BlockStructure structure = test::solid_grid(11, 6);
  const Symbolic symbolic(structure, order(structure, "amd"));
  const Schedule schedule(symbolic, 2);
  int fronts = 0;
  for (const std::vector<std::int32_t>& level : schedule.levels) {
    for (const std::int32_t s : level) {
      const Supernode& node = symbolic.supernodes()[s];
      if (!is_large(node.m)) continue;
      ++fronts;
      std::vector<std::pair<std::int64_t, std::int64_t>> zeroed, updated;
      std::vector<std::vector<std::pair<std::int64_t, std::int64_t>>> rows(
          (node.columns + kStripColumns - 1) / kStripColumns);
      for (const Step& step : schedule.steps) {
        if (step.which != s) continue;
        if (step.kind == Step::Kind::zero) zeroed.emplace_back(step.begin, step.end);
        if (step.kind == Step::Kind::update) updated.emplace_back(step.begin, step.end);
        if (step.kind == Step::Kind::rows)
          rows[step.first / kStripColumns].emplace_back(step.begin, step.end);
      }
      expect_cover(zeroed, 0, std::int64_t{node.stride} * node.columns);
      if (node.m > node.columns) expect_cover(updated, node.columns / 8 * 8, node.stride);
      for (std::size_t strip = 0; strip < rows.size(); ++strip) {
        const auto last = std::min<std::int64_t>(
            node.columns, static_cast<std::int64_t>(strip + 1) * kStripColumns);
        expect_cover(rows[strip], std::min<std::int64_t>(node.stride, (last + 7) / 8 * 8),
                     node.stride);
      }
    }
  }
  EXPECT_GT(fronts, 3);
}

}  // namespace
}  // namespace cairn::block
