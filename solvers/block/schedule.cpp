// SPDX-License-Identifier: BSD-3-Clause
#include "block/schedule.hpp"

#include <algorithm>
#include <map>

namespace cairn::block {
namespace {

/// Subtrees are cut until none holds more than this part of all work …
constexpr double kLargestTask = 1.0 / 16.0;
/// … or until they are too little to be worth a task.
constexpr double kSmallestTask = 1e5;

/// Rough work on a supernode: arithmetic, and a constant for what every supernode costs.
double work_of(const Supernode& node) {
  const double columns = node.columns, below = node.m - node.columns;
  return 4000.0 + columns * columns * node.m + 1.5 * below * below * columns;
}

/// Assigns places in one array to update matrices that live from their supernode to its parent:
/// first fit.
class Places {
 public:
  std::int64_t take(std::int64_t size) {
    for (auto it = free_.begin(); it != free_.end(); ++it) {
      if (it->second < size) continue;
      const std::int64_t begin = it->first, left = it->second - size;
      free_.erase(it);
      if (left > 0) free_.emplace(begin + size, left);
      return begin;
    }
    // A free stretch at the end may grow.
    std::int64_t begin = end_;
    if (!free_.empty()) {
      const auto last = std::prev(free_.end());
      if (last->first + last->second == end_) {
        begin = last->first;
        free_.erase(last);
      }
    }
    end_ = begin + size;
    return begin;
  }
  void give_back(std::int64_t begin, std::int64_t size) {
    if (size == 0) return;
    auto [it, added] = free_.emplace(begin, size);
    const auto next = std::next(it);
    if (next != free_.end() && it->first + it->second == next->first) {
      it->second += next->second;
      free_.erase(next);
    }
    if (it != free_.begin()) {
      const auto before = std::prev(it);
      if (before->first + before->second == it->first) {
        before->second += it->second;
        free_.erase(it);
      }
    }
  }
  std::int64_t end() const { return end_; }

 private:
  std::map<std::int64_t, std::int64_t> free_;
  std::int64_t end_ = 0;
};

/// Doubles of an update matrix, up to a cache line.
std::int64_t room(const Supernode& node) { return (node.update_size() + 7) / 8 * 8; }

}  // namespace

Schedule::Schedule(const Symbolic& symbolic, int threads) {
  cut(symbolic);
  lanes = std::max(1, std::min(threads, static_cast<int>(tasks.size())));
  place.assign(symbolic.supernodes().size(), 0);
  in_lane.assign(symbolic.supernodes().size(), false);
  if (lanes == 1) {
    place_as_stack(symbolic);
  } else {
    place_in_lanes(symbolic);
  }
  size += 8;  // `extend_add` may read beyond an update matrix
}

void Schedule::cut(const Symbolic& symbolic) {
  const auto nodes = symbolic.supernodes();
  const std::int32_t count = static_cast<std::int32_t>(nodes.size());
  std::vector<double> work(count, 0.0);
  std::vector<std::int32_t> first(count);  // first supernode of the subtree below each
  double total = 0.0;
  for (std::int32_t s = 0; s < count; ++s) first[s] = s;
  for (std::int32_t s = 0; s < count; ++s) {
    const double own = work_of(nodes[s]);
    total += own;
    work[s] += own;
    if (nodes[s].parent >= 0) {
      work[nodes[s].parent] += work[s];
      first[nodes[s].parent] = std::min(first[nodes[s].parent], first[s]);
    }
  }
  const double limit = std::max(kSmallestTask, total * kLargestTask);
  std::vector<std::int32_t> level(count, 0);
  for (std::int32_t s = 0; s < count; ++s) {
    const bool small = work[s] <= limit;
    const std::int32_t parent = nodes[s].parent;
    if (!small) {
      if (level[s] >= static_cast<std::int32_t>(levels.size())) levels.emplace_back();
      levels[level[s]].push_back(s);
      if (parent >= 0) level[parent] = std::max(level[parent], level[s] + 1);
    }
    if (!small || (parent >= 0 && work[parent] <= limit)) continue;
    // Neighbouring small subtrees share a task.
    if (!tasks.empty() && tasks.back().end == first[s] && tasks.back().work + work[s] <= limit) {
      tasks.back().end = s + 1;
      tasks.back().work += work[s];
    } else {
      tasks.push_back({first[s], s + 1, work[s]});
    }
  }
  std::ranges::stable_sort(tasks, std::greater{}, &Task::work);
  task_of.assign(count, -1);
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    std::fill(task_of.begin() + tasks[t].begin, task_of.begin() + tasks[t].end,
              static_cast<std::int32_t>(t));
  }
}

void Schedule::place_as_stack(const Symbolic& symbolic) {
  const auto nodes = symbolic.supernodes();
  Places places;
  for (std::size_t s = 0; s < nodes.size(); ++s) {
    place[s] = places.take(room(nodes[s]));
    for (const std::int32_t c : symbolic.children(static_cast<int>(s)))
      places.give_back(place[c], room(nodes[c]));
  }
  size = places.end();
}

void Schedule::place_in_lanes(const Symbolic& symbolic) {
  const auto nodes = symbolic.supernodes();
  for (const Task& task : tasks) {
    Places places;
    for (std::int32_t s = task.begin; s < task.end; ++s) {
      in_lane[s] = nodes[s].parent >= 0 && nodes[s].parent < task.end;
      if (in_lane[s]) place[s] = places.take(room(nodes[s]));
      for (const std::int32_t c : symbolic.children(s)) places.give_back(place[c], room(nodes[c]));
    }
    lane_size = std::max(lane_size, places.end());
  }
  // What leaves a task is kept until its parent, above, is done.
  const std::int64_t begin = lane_size * lanes;
  Places places;
  for (const Task& task : tasks) {
    for (std::int32_t s = task.begin; s < task.end; ++s) {
      if (!in_lane[s]) place[s] = begin + places.take(room(nodes[s]));
    }
  }
  for (const std::vector<std::int32_t>& level : levels) {
    for (const std::int32_t s : level) place[s] = begin + places.take(room(nodes[s]));
    for (const std::int32_t s : level) {
      for (const std::int32_t c : symbolic.children(s))
        places.give_back(place[c] - begin, room(nodes[c]));
    }
  }
  size = begin + places.end();
}

}  // namespace cairn::block
