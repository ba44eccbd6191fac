// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <numeric>
#include <string>
#include <utility>

#include "cairn/evaluation/watched_guess.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/update/placement.hpp"
#include "guesses.hpp"
#include "placing.hpp"

namespace cairn::initial {
namespace {

/// Ends an optimisation as soon as the guess is not to go on.
class WhileWanted final : public Observer {
 public:
  WhileWanted(const WatchedGuess::GoOn& go_on, double part) : go_on_(go_on), part_(part) {}
  bool on_iteration(const Iteration&, const Graph&, const Values&) override {
    return wanted_ = !go_on_ || go_on_("incremental", part_);
  }
  bool wanted() const { return wanted_; }

 private:
  const WatchedGuess::GoOn& go_on_;
  double part_;
  bool wanted_ = true;
};

/// A graph that grows along the robot's way and is optimised now and then: every new pose is placed
/// from an estimate that has already been corrected, so that errors of odometry never pile up to
/// where an optimizer goes astray.
class Incremental final : public InitialGuess, public WatchedGuess {
 public:
  Incremental(int step, int least_step, Stop stop, std::unique_ptr<Optimizer> optimizer)
      : step_(step), least_step_(least_step), stop_(stop), optimizer_(std::move(optimizer)) {}

  void watch(GoOn go_on) override { go_on_ = std::move(go_on); }
  void* ability(std::string_view name) override {
    return name == WatchedGuess::kAbility ? static_cast<WatchedGuess*>(this) : nullptr;
  }

  std::vector<std::string> compute(Graph& graph) override {
    Growth growth(graph);
    const std::vector<int> poses = poses_by_id(graph);
    const int step =
        step_ > 0 ? step_ : std::max(least_step_, static_cast<int>(std::ssize(poses) / 50));
    int since = 0, rounds = 0;
    std::size_t added = 0;
    bool wanted = true;
    for (; wanted && added < poses.size(); ++added) {
      growth.add_pose(poses[added]);
      if (++since < step) continue;
      wanted = optimize(growth.grown, added + 1, poses.size());
      since = 0;
      ++rounds;
    }
    if (wanted && growth.grown.factor_count() > 0)
      wanted = optimize(growth.grown, added, poses.size());
    std::vector<std::string> notes = {"optimised " + counted(rounds + 1, "time", "times") +
                                      " on the way"};
    if (!wanted) {
      notes = {"interrupted after " + counted(static_cast<std::int64_t>(added), "pose", "poses") +
               " of " + std::to_string(poses.size()) + ": the others are not optimised"};
    }
    growth.copy_back(notes);
    return notes;
  }

 private:
  /// The part of a graph that has been met so far.
  struct Growth {
    explicit Growth(Graph& whole_graph)
        : whole(whole_graph),
          factors(whole_graph),
          gauge(resolve_gauge(whole_graph)),
          index(whole_graph.variable_count(), -1),
          used(whole_graph.factor_count(), false) {}

    /// Adds a pose where its first factor to what is there puts it, then what it sees, then all
    /// factors among them.
    void add_pose(int variable) {
      std::vector<double> state(whole.state(variable).begin(), whole.state(variable).end());
      if (!gauge.held[variable]) {
        const auto placed_by = [&](Extent extent) {
          return std::ranges::any_of(factors[variable],
                                     [&](int f) { return place(variable, f, extent, state); });
        };
        if (!placed_by(Extent::whole)) placed_by(Extent::part);
      }
      add(variable, state);
      for (const int f : factors[variable]) {
        for (const std::int32_t other : whole.factor_variables(f)) {
          if (index[other] >= 0 || !is_point(whole.type(other))) continue;
          std::vector<double> seen(whole.state(other).begin(), whole.state(other).end());
          if (gauge.held[other] || place(other, f, Extent::whole, seen)) add(other, seen);
        }
      }
      add_factors_of(variable);
    }

    void copy_back(std::vector<std::string>& notes) {
      Placing placing(whole);
      for (int v = 0; v < whole.variable_count(); ++v) {
        if (index[v] < 0) continue;
        whole.set_state(v, grown.state(index[v]));
        placing.set_placed(v);
      }
      placing.spread();
      placing.finish(notes);
    }

    Graph& whole;
    FactorsByVariable factors;
    Gauge gauge;
    std::vector<int> index;  // in `grown`, -1 while not met
    std::vector<bool> used;  // factors in `grown`
    Graph grown;

   private:
    /// Of a state that a measurement gives: all of it, or all but directions without information.
    enum class Extent { whole, part };

    bool place(int variable, int factor, Extent extent, std::vector<double>& state) {
      const auto variables = whole.factor_variables(factor);
      std::vector<const double*> x;
      int target = -1;
      for (std::size_t k = 0; k < variables.size(); ++k) {
        if (variables[k] == variable) {
          target = static_cast<int>(k);
          x.push_back(state.data());
        } else if (index[variables[k]] >= 0) {
          x.push_back(grown.state(index[variables[k]]).data());
        } else {
          return false;
        }
      }
      const FactorType& type = whole.factor_type(factor);
      const std::span<const double> root = whole.sqrt_information(factor);
      const double* const z = whole.measurement(factor).data();
      if (extent == Extent::part)
        return x.size() > 1 && place_beside(type, whole.type(variable), root, target, x, z, state);
      std::vector<double> placed(state.size());
      if (!place_wholly(type, root, target, x.data(), z, placed.data())) return false;
      state = std::move(placed);
      return true;
    }

    void add(int variable, std::span<const double> state) {
      const auto& type = whole.type_of(variable);
      index[variable] = grown.add_variable(type, whole.id(variable), state);
      if (gauge.held[variable]) grown.set_fixed(index[variable]);
    }

    /// With their losses, those whose variables have all been met.
    void add_factors_of(int variable) {
      for (const int f : factors[variable]) {
        if (used[f]) continue;
        const auto on = whole.factor_variables(f);
        if (std::ranges::any_of(on, [&](std::int32_t v) { return index[v] < 0; })) continue;
        used[f] = true;
        grown.add(whole.factor(f));
      }
    }
  };

  /// False if the guess is not to go on.
  bool optimize(Graph& grown, std::size_t added, std::size_t all) {
    const double part = static_cast<double>(added) / static_cast<double>(all);
    if (go_on_ && !go_on_("incremental", part)) return false;
    WhileWanted observer(go_on_, part);
    optimizer_->optimize(grown, stop_, observer);
    return observer.wanted();
  }

  static std::vector<int> poses_by_id(const Graph& graph) {
    std::vector<int> order;
    for (int v = 0; v < graph.variable_count(); ++v) {
      if (!is_point(graph.type(v))) order.push_back(v);
    }
    std::ranges::stable_sort(order, {}, [&](int v) { return graph.id(v); });
    return order;
  }

  int step_, least_step_;
  Stop stop_;
  std::unique_ptr<Optimizer> optimizer_;
  GoOn go_on_;
};

}  // namespace

std::unique_ptr<InitialGuess> make_incremental(const IncrementalOptions& options,
                                               std::unique_ptr<Optimizer> optimizer,
                                               int least_step) {
  const Stop stop{.max_iterations = options.iterations, .tolerance = 1e-4};
  return std::make_unique<Incremental>(options.step, least_step, stop, std::move(optimizer));
}

}  // namespace cairn::initial
