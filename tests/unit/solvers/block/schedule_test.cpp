// SPDX-License-Identifier: BSD-3-Clause
#include "block/schedule.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
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
    for (std::int32_t k = step.freed_begin; k < step.freed_end; ++k) {
      if (signalled_[schedule_.freed[k]] < 1) ++waiting_;
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

/// What each step waits for, directly or because others do: `before[k][j]` says that step k begins
/// only after step j has ended.
std::vector<std::vector<bool>> order_of(const Symbolic& symbolic, const Schedule& schedule) {
  const std::size_t count = schedule.steps.size();
  std::vector<std::vector<std::size_t>> signal(schedule.gates);
  for (std::size_t k = 0; k < count; ++k) {
    const Step& step = schedule.steps[k];
    for (const std::int32_t gate : step.signals) {
      if (gate >= 0) signal[gate].push_back(k);
    }
    if (step.kind != Step::Kind::task) continue;
    const Schedule::Task& task = schedule.tasks[step.which];
    for (std::int32_t s = task.begin; s < task.end; ++s) {
      const std::int32_t parent = symbolic.supernodes()[s].parent;
      if (parent >= task.end) signal[schedule.ready[parent]].push_back(k);
    }
  }
  std::vector<std::vector<bool>> before(count, std::vector<bool>(count, false));
  for (std::size_t k = 0; k < count; ++k) {
    const Step& step = schedule.steps[k];
    const auto wait_for = [&](std::int32_t gate) {
      for (const std::size_t j : signal[gate]) {
        before[k][j] = true;
        for (std::size_t i = 0; i < j; ++i) before[k][i] = before[k][i] || before[j][i];
      }
    };
    for (const Step::Wait& wait : step.waits) {
      if (wait.gate < 0) continue;
      EXPECT_EQ(wait.count, std::ssize(signal[wait.gate]));
      wait_for(wait.gate);
    }
    for (std::int32_t f = step.freed_begin; f < step.freed_end; ++f) wait_for(schedule.freed[f]);
  }
  return before;
}

/// However long the steps take: what writes an update matrix begins only after the supernode that
/// uses up whatever else is in that room. Returns how many pairs share some.
int expect_room_is_free(const Symbolic& symbolic, const Schedule& schedule) {
  const auto nodes = symbolic.supernodes();
  const auto before = order_of(symbolic, schedule);
  // Of what leaves a task or is above: the steps that write it, and the last that reads it.
  std::vector<std::vector<std::size_t>> writes(nodes.size());
  std::vector<std::size_t> end(nodes.size(), 0);
  for (std::size_t k = 0; k < schedule.steps.size(); ++k) {
    const Step& step = schedule.steps[k];
    if (step.kind == Step::Kind::task) {
      const Schedule::Task& task = schedule.tasks[step.which];
      for (std::int32_t s = task.begin; s < task.end; ++s) {
        if (!schedule.placement.in_lane[s] && nodes[s].update_size() > 0) writes[s].push_back(k);
      }
    }
    if ((step.kind == Step::Kind::front || step.kind == Step::Kind::update) &&
        nodes[step.which].update_size() > 0)
      writes[step.which].push_back(k);
    if (step.kind == Step::Kind::front || step.kind == Step::Kind::finish) {
      for (const std::int32_t c : symbolic.children(step.which)) end[c] = k;
    }
  }
  std::vector<std::size_t> all;
  for (std::size_t s = 0; s < nodes.size(); ++s) {
    EXPECT_LE(schedule.placement.place[s] + nodes[s].update_size(), schedule.placement.size);
    if (!writes[s].empty()) all.push_back(s);
  }
  int pairs = 0;
  for (const std::size_t a : all) {
    for (const std::size_t b : all) {
      if (b >= a) break;
      const std::int64_t at_a = schedule.placement.place[a], at_b = schedule.placement.place[b];
      if (at_a + nodes[a].update_size() <= at_b || at_b + nodes[b].update_size() <= at_a) continue;
      ++pairs;
      const auto after = [&](std::size_t later, std::size_t sooner) {
        return std::ranges::all_of(writes[later],
                                   [&](std::size_t k) { return bool{before[k][end[sooner]]}; });
      };
      EXPECT_TRUE(after(a, b) || after(b, a)) << a << ' ' << b;
    }
  }
  return pairs;
}

TEST(Schedule, UsesRoomAgainOnlyAfterItIsFree) {
  for (const char* ordering : {"amd", "natural"}) {
    for (const int lanes : {2, 3, 8}) {
      const BlockStructure structure = test::solid_grid(11, 6);
      const Symbolic symbolic(structure, order(structure, ordering));
      const Schedule schedule(symbolic, lanes);
      const int pairs = expect_room_is_free(symbolic, schedule);
      // A tree that is a path has nothing to choose.
      const std::int64_t of_levels = schedule.by_levels(symbolic).size;
      EXPECT_LE(schedule.placement.size, of_levels);
      if (std::string(ordering) == "amd" && lanes < 8) {
        EXPECT_GT(pairs, 0);
        EXPECT_LT(schedule.placement.size, of_levels / 5 * 4);
      }
    }
  }
}

// A path of supernodes with a little subtree at each: other lanes run far ahead of it, so that
// thousands of update matrices exist at the same time.
TEST(Schedule, UsesRoomAgainWhereThousandsOfMatricesWait) {
  constexpr int kNodes = 6000, kBand = 8, kLeaf = 6;
  std::vector<std::int32_t> sizes, spine;
  std::vector<std::pair<std::int32_t, std::int32_t>> entries;
  for (int k = 0; k < kNodes; ++k) {
    for (int leaf = 0; leaf < kLeaf; ++leaf) {
      const auto block = static_cast<std::int32_t>(sizes.size());
      entries.emplace_back(block + 1, block);
      sizes.push_back(3);
    }
    const auto block = static_cast<std::int32_t>(sizes.size());
    for (int back = 1; back <= std::min(k, kBand); ++back)
      entries.emplace_back(block, spine[k - back]);
    spine.push_back(block);
    sizes.push_back(6);
  }
  const BlockStructure structure(std::move(sizes), std::move(entries));
  const Symbolic symbolic(structure, order(structure, "natural"));
  for (const int lanes : {2, 8}) {
    const Schedule schedule(symbolic, lanes);
    EXPECT_GT(schedule.tasks.size(), 1000);
    EXPECT_GT(expect_room_is_free(symbolic, schedule), 0);
  }
}

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
  int fronts = 0, blocks = 0;
  for (const std::vector<std::int32_t>& level : schedule.levels) {
    for (const std::int32_t s : level) {
      const Supernode& node = symbolic.supernodes()[s];
      if (!is_large(node.m)) continue;
      ++fronts;
      std::vector<std::pair<std::int64_t, std::int64_t>> zeroed, updated;
      std::vector<std::vector<std::pair<std::int64_t, std::int64_t>>> rows(
          (node.columns + kStripColumns - 1) / kStripColumns),
          subtracted((node.columns + kBlockColumns - 1) / kBlockColumns);
      for (const Step& step : schedule.steps) {
        if (step.which != s) continue;
        if (step.kind == Step::Kind::zero) zeroed.emplace_back(step.begin, step.end);
        if (step.kind == Step::Kind::update) updated.emplace_back(step.begin, step.end);
        if (step.kind == Step::Kind::rows)
          rows[step.first / kStripColumns].emplace_back(step.begin, step.end);
        if (step.kind == Step::Kind::subtract)
          subtracted[step.first / kBlockColumns].emplace_back(step.begin, step.end);
      }
      expect_cover(zeroed, 0, std::int64_t{node.stride} * node.columns);
      if (node.m > node.columns) expect_cover(updated, node.columns / 8 * 8, node.stride);
      for (std::size_t strip = 0; strip < rows.size(); ++strip) {
        const auto last = std::min<std::int64_t>(
            node.columns, static_cast<std::int64_t>(strip + 1) * kStripColumns);
        expect_cover(rows[strip], std::min<std::int64_t>(node.stride, (last + 7) / 8 * 8),
                     node.stride);
      }
      for (std::size_t block = 1; block < subtracted.size(); ++block) {
        ++blocks;
        expect_cover(subtracted[block], static_cast<std::int64_t>(block) * kBlockColumns,
                     node.stride);
      }
    }
  }
  EXPECT_GT(fronts, 3);
  EXPECT_GT(blocks, 1);
}

}  // namespace
}  // namespace cairn::block
