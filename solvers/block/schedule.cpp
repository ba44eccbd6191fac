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

/// The steps of one large front. Each phase waits for the one before.
class FrontSteps {
 public:
  FrontSteps(const Symbolic& symbolic, std::int32_t node, std::int32_t level, Step::Wait children,
             std::int32_t& gates)
      : symbolic_(symbolic),
        node_(symbolic.supernodes()[node]),
        which_(node),
        level_(level),
        gates_(gates) {
    zero();
    assemble(children);
    add_children(Step::Kind::add_to_panel);
    factor();
    if (node_.m > node_.columns) {
      update();
      add_children(Step::Kind::add_to_update);
    }
  }

  /// By phase.
  const std::vector<std::vector<Step>>& phases() const { return phases_; }
  /// For the last phase.
  Step::Wait done() const { return before_; }

 private:
  Step step(Step::Kind kind, std::int64_t begin = 0, std::int64_t end = 0) const {
    Step result;
    result.kind = kind;
    result.which = which_;
    result.begin = begin;
    result.end = end;
    result.waits[0] = before_;
    return result;
  }
  /// Steps that may run at the same time; what follows waits for all of them.
  void phase(std::vector<Step> steps) {
    const std::int32_t gate = gates_++;
    for (Step& each : steps) each.signals[0] = gate;
    before_ = {gate, static_cast<std::int32_t>(steps.size())};
    phases_.push_back(std::move(steps));
  }

  void zero() {
    const std::int64_t size = std::int64_t{node_.stride} * node_.columns;
    std::vector<Step> steps;
    for (std::int64_t begin = 0; begin < size; begin += kTileZeroed)
      steps.push_back(step(Step::Kind::zero, begin, std::min(size, begin + kTileZeroed)));
    phase(std::move(steps));
  }
  void assemble(Step::Wait children) {
    Step all = step(Step::Kind::assemble);
    all.waits[1] = children;
    phase({all});
  }
  /// One child after the other, since they may add to the same places; small ones together.
  void add_children(Step::Kind kind) {
    const auto children = symbolic_.children(which_);
    const auto count = static_cast<std::int32_t>(children.size());
    for (std::int32_t c = 0; c < count;) {
      const Supernode& child = symbolic_.supernodes()[children[c]];
      const bool to_panel = kind == Step::Kind::add_to_panel;
      const std::int32_t from = to_panel ? 0 : child.panel_rows;
      const std::int32_t to = to_panel ? child.panel_rows : child.m - child.columns;
      std::int32_t end = c + 1;
      std::vector<Step> steps;
      if (is_large(child.m)) {
        for (std::int32_t begin = from; begin < to; begin += kTileAdded)
          steps.push_back(step(kind, begin, std::min(to, begin + kTileAdded)));
      } else {
        while (end < count && !is_large(symbolic_.supernodes()[children[end]].m)) ++end;
        steps.push_back(step(kind));
      }
      for (Step& each : steps) {
        each.child = c;
        each.child_end = end;
      }
      if (!steps.empty()) phase(std::move(steps));
      c = end;
    }
  }
  /// Strip by strip. The first tile below a strip holds the pivots of the next, which its thread
  /// factors right away, while others work on the remaining tiles.
  void factor() {
    std::int32_t pivots = gates_++;
    Step first = step(Step::Kind::pivots);
    first.last = std::min(node_.columns, kStripColumns);
    first.signals[0] = pivots;
    phases_.push_back({first});
    before_ = {pivots, 1};
    for (std::int32_t begin = 0; begin < node_.columns; begin += kStripColumns) {
      const std::int32_t last = std::min(node_.columns, begin + kStripColumns);
      const std::int32_t below = std::min(node_.stride, (last + 7) / 8 * 8);
      std::vector<Step> steps;
      for (std::int32_t row = below; row < node_.stride; row += kTileRows) {
        Step tile = step(Step::Kind::rows, row, std::min(node_.stride, row + kTileRows));
        tile.waits[1] = {pivots, 1};
        tile.first = begin;
        tile.last = last;
        steps.push_back(tile);
      }
      if (last < node_.columns) {
        pivots = gates_++;
        steps.front().pivots_follow = true;
        steps.front().signals[1] = pivots;
      }
      if (!steps.empty()) phase(std::move(steps));
    }
  }
  void update() {
    const int begin = node_.columns / 8 * 8;
    const int tiles = (node_.stride - begin + kTileRows - 1) / kTileRows;
    std::vector<Step> steps;
    for (int tile = tiles - 1; tile >= 0; --tile) {  // the last have the longest rows
      const int row = begin + tile * kTileRows;
      steps.push_back(step(Step::Kind::update, row, std::min(node_.stride, row + kTileRows)));
      steps.back().levels = level_;
    }
    phase(std::move(steps));
  }

  const Symbolic& symbolic_;
  const Supernode& node_;
  std::int32_t which_, level_;
  std::int32_t& gates_;
  std::vector<std::vector<Step>> phases_;
  Step::Wait before_;
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
    list_steps(symbolic);
  }
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

void Schedule::list_steps(const Symbolic& symbolic) {
  const auto nodes = symbolic.supernodes();
  ready.assign(nodes.size(), -1);
  for (const std::vector<std::int32_t>& level : levels) {
    for (const std::int32_t s : level) ready[s] = gates++;
  }
  for (std::size_t l = 0; l < levels.size(); ++l) level_gates.push_back(gates++);
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    Step step;
    step.kind = Step::Kind::task;
    step.which = static_cast<std::int32_t>(t);
    steps.push_back(step);
  }
  for (std::size_t l = 0; l < levels.size(); ++l) {
    const auto level = static_cast<std::int32_t>(l);
    std::vector<std::vector<Step>> phases;  // of all fronts of the level, side by side
    std::vector<Step> last;
    for (const std::int32_t s : levels[l]) {
      const Step::Wait children{ready[s], static_cast<std::int32_t>(symbolic.children(s).size())};
      Step end;
      end.which = s;
      end.signals[0] = level_gates[l];
      if (nodes[s].parent >= 0) end.signals[1] = ready[nodes[s].parent];
      if (!is_large(nodes[s].m)) {
        end.kind = Step::Kind::front;
        end.waits[0] = children;
        end.levels = level;
        if (phases.empty()) phases.emplace_back();
        phases.front().push_back(end);
        continue;
      }
      const FrontSteps front(symbolic, s, level, children, gates);
      if (phases.size() < front.phases().size()) phases.resize(front.phases().size());
      for (std::size_t p = 0; p < front.phases().size(); ++p)
        phases[p].insert(phases[p].end(), front.phases()[p].begin(), front.phases()[p].end());
      end.waits[0] = front.done();
      last.push_back(end);
    }
    for (const std::vector<Step>& phase : phases)
      steps.insert(steps.end(), phase.begin(), phase.end());
    steps.insert(steps.end(), last.begin(), last.end());
  }
}

}  // namespace cairn::block
