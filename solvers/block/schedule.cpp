// SPDX-License-Identifier: BSD-3-Clause
#include "block/schedule.hpp"

#include <algorithm>
#include <functional>
#include <iterator>
#include <map>
#include <queue>
#include <span>
#include <utility>

#include "block/places.hpp"

namespace cairn::block {
namespace {

/// Subtrees are cut until none holds more than this part of all work …
constexpr double kLargestTask = 1.0 / 32.0;
/// … or until they are too little to be worth a task.
constexpr double kSmallestTask = 1e5;

/// Rough work on a supernode: arithmetic, and a constant for what every supernode costs.
double work_of(const Supernode& node) {
  const double columns = node.columns, below = node.m - node.columns;
  return 4000.0 + columns * columns * node.m + 1.5 * below * below * columns;
}

/// The steps of one large front. Each phase waits for the one before.
class FrontSteps {
 public:
  FrontSteps(const Symbolic& symbolic, std::int32_t node, Step::Wait children, std::int32_t& gates,
             std::vector<Step>& steps)
      : symbolic_(symbolic),
        node_(symbolic.supernodes()[node]),
        which_(node),
        gates_(gates),
        steps_(steps) {
    zero();
    assemble(children);
    add_children(Step::Kind::add_to_panel);
    factor();
    if (node_.m > node_.columns) {
      update();
      add_children(Step::Kind::add_to_update);
    }
  }

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
    steps_.insert(steps_.end(), steps.begin(), steps.end());
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
  /// factors right away, while others work on the remaining tiles. Where a block of strips begins,
  /// that tile is one from which the columns before are subtracted.
  void factor() {
    std::int32_t pivots = gates_++;
    Step first = step(Step::Kind::pivots);
    first.last = std::min(node_.columns, kStripColumns);
    first.signals[0] = pivots;
    steps_.push_back(first);
    before_ = {pivots, 1};
    for (std::int32_t begin = 0; begin < node_.columns; begin += kStripColumns) {
      const std::int32_t last = std::min(node_.columns, begin + kStripColumns);
      std::vector<Step> rows = tiles(Step::Kind::rows, begin, last, (last + 7) / 8 * 8);
      for (Step& tile : rows) tile.waits[1] = {pivots, 1};
      const bool ends_block = last % kBlockColumns == 0;
      if (last < node_.columns && !ends_block) pivots = let_pivots_follow(rows.front());
      if (!rows.empty()) phase(std::move(rows));
      if (last == node_.columns || !ends_block) continue;
      std::vector<Step> subtract =
          tiles(Step::Kind::subtract, last, std::min(node_.columns, last + kBlockColumns), last);
      pivots = let_pivots_follow(subtract.front());
      phase(std::move(subtract));
    }
  }
  /// Of columns [first, last), from a row on.
  std::vector<Step> tiles(Step::Kind kind, std::int32_t first, std::int32_t last,
                          std::int32_t row) const {
    std::vector<Step> steps;
    for (; row < node_.stride; row += kTileRows) {
      Step tile = step(kind, row, std::min(node_.stride, row + kTileRows));
      tile.first = first;
      tile.last = last;
      steps.push_back(tile);
    }
    return steps;
  }
  /// The gate of the pivots that are factored after a tile.
  std::int32_t let_pivots_follow(Step& tile) {
    tile.pivots_follow = true;
    tile.signals[1] = gates_++;
    return tile.signals[1];
  }
  void update() {
    const int begin = node_.columns / 8 * 8;
    const int tiles = (node_.stride - begin + kTileRows - 1) / kTileRows;
    std::vector<Step> steps;
    for (int tile = tiles - 1; tile >= 0; --tile) {  // the last have the longest rows
      const int row = begin + tile * kTileRows;
      steps.push_back(step(Step::Kind::update, row, std::min(node_.stride, row + kTileRows)));
    }
    phase(std::move(steps));
  }

  const Symbolic& symbolic_;
  const Supernode& node_;
  std::int32_t which_;
  std::int32_t& gates_;
  std::vector<Step>& steps_;
  Step::Wait before_;
};

/// Doubles of an update matrix, up to a cache line.
std::int64_t room(const Supernode& node) { return (node.update_size() + 7) / 8 * 8; }

/// About how long a step takes, in the units of `work_of`.
double work_of(const Step& step, const Symbolic& symbolic) {
  const Supernode& node = symbolic.supernodes()[step.which];
  const double rows = static_cast<double>(step.end - step.begin);
  switch (step.kind) {
    case Step::Kind::task:  // known to the schedule
    case Step::Kind::finish:
      return 0.0;
    case Step::Kind::front:
      return work_of(node);
    case Step::Kind::zero:
      return rows;
    case Step::Kind::assemble:
      return 4000.0;
    case Step::Kind::add_to_panel:
    case Step::Kind::add_to_update: {
      double entries = 0.0;
      for (const std::int32_t c :
           symbolic.children(step.which).subspan(step.child, step.child_end - step.child)) {
        const Supernode& child = symbolic.supernodes()[c];
        const double columns = rows > 0.0                              ? rows
                               : step.kind == Step::Kind::add_to_panel ? child.panel_rows
                                                                       : child.m - child.columns;
        entries += 0.5 * columns * (child.m - child.columns);
      }
      return 2.0 * entries;
    }
    case Step::Kind::pivots:
    case Step::Kind::rows: {
      const double columns = step.last - step.first;
      const int block = block_of(step.first);
      return std::max(rows, columns) * columns * (step.first + step.last - 2 * block);
    }
    case Step::Kind::subtract:
      return 2.0 * rows * (step.last - step.first) * step.first;
    case Step::Kind::update:
      return 1.5 * rows * node.columns * static_cast<double>(step.begin + step.end);
  }
  return 0.0;
}

/// Simulates the factorisation by so many lanes that take steps in postorder: in which order they
/// begin, and where what leaves a task is meanwhile.
///
/// The times are guessed, so whoever takes room that another matrix has had waits for the supernode
/// which has used that up.
class Simulation {
 public:
  /// `done`: by supernode, the gate that is signalled at its end.
  Simulation(const Symbolic& symbolic, Schedule& schedule, std::span<const std::int32_t> done,
             std::span<const Step> all)
      : symbolic_(symbolic),
        schedule_(schedule),
        done_(done),
        all_(all),
        begun_(symbolic.supernodes().size(), false) {}

  void run(int lanes) {
    using Ready = std::pair<std::int32_t, std::int32_t>;  // postorder, step
    using Running = std::pair<double, std::int32_t>;      // its end, step
    std::vector<std::int32_t> to_come(schedule_.gates, 0);
    std::vector<std::vector<std::int32_t>> waiting(schedule_.gates);
    std::vector<std::int32_t> missing(all_.size(), 0);
    std::priority_queue<Ready, std::vector<Ready>, std::greater<>> ready;
    std::priority_queue<Running, std::vector<Running>, std::greater<>> running;
    for (std::size_t k = 0; k < all_.size(); ++k) {
      const auto step = static_cast<std::int32_t>(k);
      for (const Step::Wait& wait : all_[k].waits) {
        if (wait.gate < 0 || wait.count == 0) continue;
        waiting[wait.gate].push_back(step);
        ++missing[k];
      }
      for_each_signal(all_[k], [&](std::int32_t gate) { ++to_come[gate]; });
      if (missing[k] == 0) ready.emplace(postorder(all_[k]), step);
    }
    double now = 0.0;
    for (int free = lanes;;) {
      for (; free > 0 && !ready.empty(); --free) {
        const std::int32_t step = ready.top().second;
        ready.pop();
        begin(all_[step]);
        running.emplace(now + work(all_[step]), step);
      }
      if (running.empty()) break;
      const auto [time, step] = running.top();
      running.pop();
      now = time;
      ++free;
      end(all_[step]);
      for_each_signal(all_[step], [&](std::int32_t gate) {
        if (--to_come[gate] > 0) return;
        for (const std::int32_t next : waiting[gate]) {
          if (--missing[next] == 0) ready.emplace(postorder(all_[next]), next);
        }
      });
    }
  }

  /// Finds room, and who has had it before.
  void place() {
    const auto nodes = symbolic_.supernodes();
    Placement& placement = schedule_.placement;
    const std::int64_t above = placement.size;
    std::vector<std::int64_t> size(nodes.size()), place(nodes.size());
    for (std::size_t s = 0; s < nodes.size(); ++s) size[s] = room(nodes[s]);
    placement.size += place_by_lifetimes(taken_, size, place);

    struct Freed {
      std::int64_t end;
      std::int32_t gate;  // of the supernode that has given it back
    };
    std::map<std::int64_t, Freed> free;  // by where it begins; they do not overlap
    std::vector<std::pair<std::int32_t, std::int32_t>> waits(nodes.size());  // in `freed`
    for (const std::int32_t event : taken_) {
      const std::int32_t s = event < 0 ? ~event : event;
      const std::int64_t begin = place[s], end = begin + size[s];
      if (event < 0) {
        free[begin] = {end, done_[nodes[s].parent]};
        continue;
      }
      placement.place[s] = above + begin;
      waits[s].first = static_cast<std::int32_t>(schedule_.freed.size());
      auto other = free.upper_bound(begin);
      if (other != free.begin() && std::prev(other)->second.end > begin) --other;
      while (other != free.end() && other->first < end) {
        const std::int64_t first = other->first;
        const Freed had = other->second;
        schedule_.freed.push_back(had.gate);
        other = free.erase(other);
        if (first < begin) free.emplace(first, Freed{begin, had.gate});
        if (had.end > end) free.emplace(end, had);
      }
      waits[s].second = static_cast<std::int32_t>(schedule_.freed.size());
    }
    for (Step& step : schedule_.steps) {
      const auto wait_for = [&](std::int32_t s) {
        if (step.freed_begin == step.freed_end) step.freed_begin = waits[s].first;
        step.freed_end = waits[s].second;
      };
      if (step.kind == Step::Kind::front || step.kind == Step::Kind::update) wait_for(step.which);
      // What leaves a task begins together.
      if (step.kind == Step::Kind::task)
        for_each_that_leaves(schedule_.tasks[step.which], wait_for);
    }
  }

 private:
  std::int32_t postorder(const Step& step) const {
    return step.kind == Step::Kind::task ? schedule_.tasks[step.which].begin : step.which;
  }
  double work(const Step& step) const {
    constexpr double kStep = 500.0;  // of any
    return kStep + (step.kind == Step::Kind::task ? schedule_.tasks[step.which].work
                                                  : work_of(step, symbolic_));
  }
  template <class Visit>
  void for_each_that_leaves(const Schedule::Task& task, const Visit& visit) const {
    for (std::int32_t s = task.begin; s < task.end; ++s) {
      if (symbolic_.supernodes()[s].parent >= task.end) visit(s);
    }
  }
  template <class Visit>
  void for_each_signal(const Step& step, const Visit& visit) const {
    for (const std::int32_t gate : step.signals) {
      if (gate >= 0) visit(gate);
    }
    if (step.kind != Step::Kind::task) return;
    for_each_that_leaves(schedule_.tasks[step.which], [&](std::int32_t s) {
      visit(schedule_.ready[symbolic_.supernodes()[s].parent]);
    });
  }

  void begin(const Step& step) {
    schedule_.steps.push_back(step);
    if (step.kind == Step::Kind::task)
      for_each_that_leaves(schedule_.tasks[step.which], [&](std::int32_t s) { take(s); });
    if (step.kind == Step::Kind::front || step.kind == Step::Kind::update) take(step.which);
  }
  void take(std::int32_t s) {
    if (begun_[s] || symbolic_.supernodes()[s].update_size() == 0) return;
    begun_[s] = true;
    taken_.push_back(s);
  }
  void end(const Step& step) {
    if (step.kind != Step::Kind::front && step.kind != Step::Kind::finish) return;
    for (const std::int32_t c : symbolic_.children(step.which)) {
      if (begun_[c]) taken_.push_back(~c);
    }
  }

  const Symbolic& symbolic_;
  Schedule& schedule_;
  std::span<const std::int32_t> done_;
  std::span<const Step> all_;
  std::vector<bool> begun_;          // by supernode: whether it has taken room
  std::vector<std::int32_t> taken_;  // takes room: s, and gives it back: ~s
};

}  // namespace

Schedule::Schedule(const Symbolic& symbolic, int threads) {
  cut(symbolic);
  const bool divided = std::ranges::any_of(levels, [&](const std::vector<std::int32_t>& level) {
    return std::ranges::any_of(
        level, [&](std::int32_t s) { return is_large(symbolic.supernodes()[s].m); });
  });
  lanes = divided ? threads : std::max(1, std::min(threads, static_cast<int>(tasks.size())));
  placement.place.assign(symbolic.supernodes().size(), 0);
  placement.in_lane.assign(symbolic.supernodes().size(), false);
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
    placement.place[s] = places.take(room(nodes[s]));
    for (const std::int32_t c : symbolic.children(static_cast<int>(s)))
      places.give_back(placement.place[c], room(nodes[c]));
  }
  placement.size = places.end();
}

/// What stays within a task.
void Schedule::place_in_lanes(const Symbolic& symbolic) {
  const auto nodes = symbolic.supernodes();
  for (const Task& task : tasks) {
    Places places;
    for (std::int32_t s = task.begin; s < task.end; ++s) {
      placement.in_lane[s] = nodes[s].parent >= 0 && nodes[s].parent < task.end;
      if (placement.in_lane[s]) placement.place[s] = places.take(room(nodes[s]));
      for (const std::int32_t c : symbolic.children(s))
        places.give_back(placement.place[c], room(nodes[c]));
    }
    placement.lane_size = std::max(placement.lane_size, places.end());
  }
  placement.size = placement.lane_size * lanes;
}

Placement Schedule::by_levels(const Symbolic& symbolic) const {
  if (lanes == 1) return placement;
  const auto nodes = symbolic.supernodes();
  Placement result = placement;
  const std::int64_t begin = result.lane_size * lanes;
  Places places;
  for (const Task& task : tasks) {
    for (std::int32_t s = task.begin; s < task.end; ++s) {
      if (!result.in_lane[s]) result.place[s] = begin + places.take(room(nodes[s]));
    }
  }
  for (const std::vector<std::int32_t>& level : levels) {
    for (const std::int32_t s : level) result.place[s] = begin + places.take(room(nodes[s]));
    for (const std::int32_t s : level) {
      for (const std::int32_t c : symbolic.children(s))
        places.give_back(result.place[c] - begin, room(nodes[c]));
    }
  }
  result.size = begin + places.end();
  return result;
}

void Schedule::list_steps(const Symbolic& symbolic) {
  const auto nodes = symbolic.supernodes();
  ready.assign(nodes.size(), -1);
  std::vector<std::int32_t> done(nodes.size(), -1);
  for (const std::vector<std::int32_t>& level : levels) {
    for (const std::int32_t s : level) {
      ready[s] = gates++;
      done[s] = gates++;
    }
  }
  std::vector<Step> all;
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    Step step;
    step.kind = Step::Kind::task;
    step.which = static_cast<std::int32_t>(t);
    all.push_back(step);
  }
  for (const std::vector<std::int32_t>& level : levels) {
    for (const std::int32_t s : level) {
      const Step::Wait children{ready[s], static_cast<std::int32_t>(symbolic.children(s).size())};
      Step end;
      end.which = s;
      end.signals[0] = done[s];
      if (nodes[s].parent >= 0) end.signals[1] = ready[nodes[s].parent];
      if (is_large(nodes[s].m)) {
        end.waits[0] = FrontSteps(symbolic, s, children, gates, all).done();
      } else {
        end.kind = Step::Kind::front;
        end.waits[0] = children;
      }
      all.push_back(end);
    }
  }
  Simulation simulation(symbolic, *this, done, all);
  simulation.run(lanes);
  simulation.place();
}

}  // namespace cairn::block
