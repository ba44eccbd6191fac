// SPDX-License-Identifier: BSD-3-Clause
#include "other_minima.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <utility>

#include <fmt/core.h>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/factor_selector.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/update/rejected_factors.hpp"
#include "trial_losses.hpp"

namespace cairn::initial {
namespace {

constexpr double kLower = 1e-4;            // a smaller fraction of chi2 is no lower minimum
constexpr double kElsewhere = 1e-3;        // nor is this another one
constexpr double kIterations = 500'000.0;  // of one variable
// Random starts in vain end the search; more where they cost little.
constexpr int kInVain = 32, kInVainOfFew = 64;
constexpr int kMostTries = 1000;  // random starts
constexpr double kNearly = 0.05;  // of chi2: minima that are nearly as low
// Of its weight without a loss: a factor that is rejected, and one that others nearly outvoted.
constexpr double kRejected = 0.01, kOutvoted = 0.25;
constexpr Stop kOnTheWay{.max_iterations = 30, .tolerance = 1e-4};
constexpr Stop kToAMinimum{.max_iterations = 60, .tolerance = 1e-6};

class WhileWanted final : public Observer {
 public:
  explicit WhileWanted(const std::function<bool()>& wanted) : wanted_(wanted) {}
  bool on_iteration(const Iteration&, const Graph&, const Values&) override { return wanted_(); }

 private:
  const std::function<bool()>& wanted_;
};

/// Half of the squared norms are smaller.
double median(std::vector<double> norms) {
  const auto middle = norms.begin() + std::ssize(norms) / 2;
  std::ranges::nth_element(norms, middle);
  return *middle;
}

/// A part of a trajectory, from one fraction of its poses to another.
struct Part {
  double begin, end;
};

class Search {
 public:
  Search(Graph& graph, const SearchOptimizers& optimizers,
         const std::function<bool(double)>& wanted)
      : graph_(graph),
        losses_(graph),
        gauge_(resolve_gauge(graph)),
        to_the_end_(few_that_disagree(graph, largest_turn(graph)) ||
                    (graph.variable_count() <= kFewVariables && !below(kOutvoted).empty())),
        in_vain_(graph.variable_count() <= kFewVariables ? kInVainOfFew : kInVain),
        optimizers_(optimizers),
        optimizer_(optimizers.one),
        given_(graph.values()),
        best_(graph.values()) {
    found_.chi2 = found_.before = chi2(graph);
    most_ = kIterations / std::max(1, graph.variable_count());
    wanted_ = [this, wanted] { return go_on_ = go_on_ && wanted(spent_ / most_); };
  }

  OtherMinima run(const std::vector<NamedStart>& starts) {
    if (graph_.variable_count() > kMostVariables) return found_;
    for (const NamedStart& start : starts) {
      if (start.iterations == 0.0) try_start(start);
    }
    try_robust("cauchy", make_cauchy, 1.0);
    try_robust("geman_mcclure", make_geman_mcclure, 4.0);
    for (const double turns : {1.0, -1.0}) try_turned(turns, 0);
    if (to_the_end_ || !rejected().empty() || found_.elsewhere > 0 || !found_.found_by.empty())
      try_more(starts);
    graph_.set_values(std::move(best_));
    found_.until_the_end = !found_.found_by.empty() && found_.starts - last_ <= found_.starts / 4;
    count_nearly_as_low();
    return found_;
  }

 private:
  void try_start(const NamedStart& start) {
    attempt(start.name, [&] {
      graph_.set_values(given_);
      start.compute(graph_);
      spent_ += start.iterations;
      tighten();
    });
  }

  void use_other(bool other) {
    optimizer_ = other && optimizers_.other ? optimizers_.other : optimizers_.one;
  }

  void try_more(const std::vector<NamedStart>& starts) {
    use_other(true);
    for (const NamedStart& start : starts) {
      if (optimizers_.other && start.iterations == 0.0) try_start(start);
    }
    use_other(false);
    for (const NamedStart& start : starts) {
      if (start.iterations > 0.0) try_start(start);
    }
    for (const double turns : {2.0, -2.0}) try_turned(turns, 0);
    try_robust("geman_mcclure", make_geman_mcclure, 1.0);
    try_robust("cauchy", make_cauchy, 0.1);
    for (const int axis : {1, 2}) {
      for (const double turns : {1.0, -1.0}) try_turned(turns, axis);
    }
    for (int k = 0; found_.starts - last_ < in_vain_ && k < kMostTries; ++k) {
      use_other(k / 4 % 2 == 1);
      try_at_random(k);
    }
  }

  void try_at_random(int k) {
    if (k % 2 == 0 && !rejected().empty()) return try_with_rejected();
    if (k % 4 == 1) return try_without_some(5, [](int) { return true; });
    if (k % 4 == 2 && turns_about(0)) return try_turned_in_part();
    const std::vector<bool> loops = loop_closures(graph_);
    try_without_some(2, [&](int f) { return loops[static_cast<std::size_t>(f)]; });
  }

  /// The factors that losses have all but taken from the best minimum so far.
  std::vector<int> rejected() {
    graph_.set_values(best_);
    return below(kRejected);
  }

  /// The factors to which losses leave less than a fraction of their weight.
  std::vector<int> below(double fraction) const {
    std::vector<int> result;
    if (!graph_.has_losses()) return result;
    const std::vector<double> weights = loss_weights(graph_);
    for (int f = 0; f < graph_.factor_count(); ++f)
      if (weights[static_cast<std::size_t>(f)] < fraction) result.push_back(f);
    return result;
  }

  /// Tightens bounded losses: all measurements count at first, what contradicts the others less and
  /// less.
  void tighten() {
    if (!has_bounded_losses(graph_)) return;
    set_instead_of_bounded(graph_, losses_, [](const auto&) { return make_cauchy(); });
    optimise(kOnTheWay);
    for (const double k : {4.0, 2.0}) {
      set_instead_of_bounded(graph_, losses_, [k](const auto& own) { return make_wider(own, k); });
      optimise(kOnTheWay);
    }
  }

  /// What was rejected counts fully, a half of it, a third, or a single factor: others give way.
  void try_with_rejected() {
    attempt("an estimate that takes back rejected factors", [&] {
      const std::vector<int> all = rejected();
      const std::uint64_t part = 1 + random_() % 3;
      for (const int f : all) {
        if (part > 1 && random_() % part == 0) graph_.set_loss(f, fully_);
      }
      if (part == 1) graph_.set_loss(all[random_() % all.size()], fully_);
      optimise(kOnTheWay);
      losses_.put_back();
      tighten();
    });
  }

  template <class Make>
  void try_robust(const char* name, const Make& make, double part) {
    attempt(fmt::format("a {} estimate", name), [&] {
      const double q = part * median(squared_norms(graph_));
      if (!(q > 0.0)) return;
      graph_.set_loss(make(q));
      optimise(kOnTheWay);
    });
  }

  /// Further turns about an axis of the poses, the last of their tangent space first, spread over
  /// a part of the poses in the order of their ids.
  void try_turned(double turns, int axis, Part part = {0.0, 1.0}) {
    if (!turns_about(axis)) return;
    attempt("a trajectory with further turns", [&] { turn(turns, axis, part); });
  }

  void try_turned_in_part() {
    const int axis = turns_about(1) ? static_cast<int>(random_() % 3) : 0;
    const double turns = random_() % 2 == 0 ? 1.0 : -1.0;
    const double one = fraction(), other = fraction();
    try_turned(turns, axis, {std::min(one, other), std::max(one, other)});
  }

  double fraction() { return static_cast<double>(random_() % 1024) / 1024.0; }

  bool turns_about(int axis) const {
    return std::ranges::any_of(graph_.variable_pools(), [&](const VariablePool& pool) {
      return pool.variables.size() > 1 && is_pose(*pool.type) &&
             (axis == 0 || pool.type->placement()->dimension() == 3);
    });
  }

  void turn(double turns, int axis, Part part) {
    for (const VariablePool& pool : graph_.variable_pools()) {
      if (!is_pose(*pool.type) || pool.variables.size() < 2) continue;
      std::vector<int> order(pool.variables.begin(), pool.variables.end());
      std::ranges::sort(order, {}, [&](int v) { return graph_.id(v); });
      turn(*pool.type, order, turns, axis, part);
    }
  }

  void turn(const VariableType& type, const std::vector<int>& order, double turns, int axis,
            Part part) {
    const LieGroup& group = *type.lie_group();
    const auto n = static_cast<std::size_t>(type.ambient_size());
    std::vector<double> tangent(static_cast<std::size_t>(type.tangent_size()));
    if (axis >= static_cast<int>(tangent.size())) return;
    const auto first = static_cast<std::size_t>(part.begin * static_cast<double>(order.size()));
    const auto last = static_cast<std::size_t>(part.end * static_cast<double>(order.size()));
    if (last <= first) return;
    tangent[tangent.size() - 1 - static_cast<std::size_t>(axis)] =
        2.0 * std::numbers::pi * turns / static_cast<double>(last - first);
    std::vector<double> step(n), inverse(n), motion(n), turned(n), next(n);
    group.exp(tangent.data(), step.data());
    std::vector<double> before(graph_.state(order[0]).begin(), graph_.state(order[0]).end());
    std::vector<double> at = before;
    for (std::size_t k = 1; k < order.size(); ++k) {
      const std::vector<double> old(graph_.state(order[k]).begin(), graph_.state(order[k]).end());
      group.inverse(before.data(), inverse.data());
      group.compose(inverse.data(), old.data(), motion.data());
      if (k >= first && k < last)
        group.compose(motion.data(), step.data(), turned.data());
      else
        turned = motion;
      group.compose(at.data(), turned.data(), next.data());
      before = old;
      at = gauge_.held[static_cast<std::size_t>(order[k])] ? old : next;
      if (!type.normalize(at.data()).empty()) return;
      graph_.set_state(order[k], at);
    }
  }

  /// One in `of` of the factors that `select` names almost left out.
  template <class Select>
  void try_without_some(std::uint64_t of, const Select& select) {
    attempt("an estimate without a part of the factors", [&] {
      for (int f = 0; f < graph_.factor_count(); ++f) {
        if (select(f) && random_() % of == 0) graph_.set_loss(f, hardly_);
      }
      optimise(kOnTheWay);
    });
  }

  /// Lets `move` change the states and the losses from the best minimum so far, and optimises.
  template <class Move>
  void attempt(const std::string& name, const Move& move) {
    if (spent_ >= most_ || !wanted_()) return;
    graph_.set_values(best_);
    double reached = 0.0;
    try {
      move();
      losses_.put_back();
      reached = optimise(kToAMinimum);
    } catch (const Error& error) {
      losses_.put_back();
      if (error.code() != ErrorCode::input && error.code() != ErrorCode::numerical) throw;
      return;
    }
    if (!go_on_) return;
    ++found_.starts;
    reached_.push_back(reached);
    if (std::abs(reached - found_.chi2) > kElsewhere * found_.chi2) ++found_.elsewhere;
    if (!(reached < (1.0 - kLower) * found_.chi2)) return;
    found_.chi2 = reached;
    found_.found_by = name;
    last_ = found_.starts;
    best_ = graph_.values();
  }

  /// What the starts say about the minima around the lowest.
  void count_nearly_as_low() {
    std::ranges::sort(reached_);
    double before = found_.chi2;
    for (const double reached : reached_) {
      if (reached <= (1.0 + kElsewhere) * found_.chi2) {
        ++found_.in_the_lowest;
      } else if (reached > (1.0 + kElsewhere) * before &&
                 reached <= (1.0 + kNearly) * found_.chi2) {
        before = reached;
        ++found_.nearly_as_low;
      }
    }
  }

  double optimise(const Stop& stop) {
    WhileWanted observer(wanted_);
    const Summary summary = optimizer_->optimize(graph_, stop, observer);
    spent_ += static_cast<double>(summary.iterations.size());
    return summary.final_chi2;
  }

  Graph& graph_;
  KeptLosses losses_;
  Gauge gauge_;
  bool to_the_end_;
  int in_vain_;
  SearchOptimizers optimizers_;
  Optimizer* optimizer_;  ///< by which the next start is optimised
  std::function<bool()> wanted_;
  Values given_, best_;
  OtherMinima found_;
  std::shared_ptr<const Loss> hardly_ = make_weight(0.01), fully_ = make_weight(1.0);
  std::mt19937_64 random_{1};        // the same for every graph, on every machine
  double spent_ = 0.0, most_ = 0.0;  // iterations
  std::vector<double> reached_;      // by each start
  int last_ = 0;                     // the start that led to the best so far
  bool go_on_ = true;
};

}  // namespace

OtherMinima search_other_minima(Graph& graph, const std::vector<NamedStart>& starts,
                                const SearchOptimizers& optimizers,
                                const std::function<bool(double)>& wanted) {
  return Search(graph, optimizers, wanted).run(starts);
}

namespace {

/// Of a rotation, by its trace 1 + 2 cos(angle).
double angle_of(double trace) { return std::acos(std::clamp(0.5 * (trace - 1.0), -1.0, 1.0)); }

}  // namespace

double largest_turn(const Graph& graph) {
  double least = 3.0;  // trace
  std::vector<std::vector<Eigen::Matrix3d>> rotations(graph.variable_pools().size());
  for (const FactorPool& pool : graph.factor_pools()) {
    if (!pool.type->is_relative() || pool.size() == 0) continue;
    const auto p = static_cast<std::size_t>(pool.variable_pools[0]);
    const VariableType& type = *graph.variable_pools()[p].type;
    if (!is_pose(type)) continue;
    const Placement& placement = *type.placement();
    const auto size = static_cast<std::size_t>(type.ambient_size());
    std::vector<Eigen::Matrix3d>& R = rotations[p];
    const auto& states = graph.values().pools[p];
    for (std::size_t v = R.size(); v < states.size() / size; ++v)
      R.push_back(pose_of(placement, states.data() + v * size).R);
    for (std::size_t f = 0; f < pool.size(); ++f) {
      const Eigen::Matrix3d& from = R[static_cast<std::size_t>(pool.slots[2 * f])];
      const Eigen::Matrix3d& to = R[static_cast<std::size_t>(pool.slots[2 * f + 1])];
      const Pose measured = pose_of(placement, pool.measurements.data() + f * size);
      // The trace of from · measured · toᵀ.
      least = std::min(least, (from.transpose() * to).cwiseProduct(measured.R).sum());
    }
  }
  return angle_of(least);
}

double largest_drift(const Graph& graph) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  struct Step {
    int from = -1;
    Eigen::Matrix3d R;
  };
  std::vector<Step> steps(static_cast<std::size_t>(graph.variable_count()));
  for (const FactorPool& pool : graph.factor_pools()) {
    if (!pool.type->is_relative()) continue;
    for (std::size_t f = 0; f < pool.size(); ++f) {
      const int a = pool.variables[2 * f], b = pool.variables[2 * f + 1];
      const VariableType& type = graph.type(a);
      if (!is_pose(type)) return kNone;
      Step& step = steps[static_cast<std::size_t>(std::max(a, b))];
      if (std::min(a, b) <= step.from) continue;
      const auto size = static_cast<std::size_t>(type.ambient_size());
      const Eigen::Matrix3d R = pose_of(*type.placement(), pool.measurements.data() + f * size).R;
      step.from = std::min(a, b);
      step.R = a < b ? R : Eigen::Matrix3d(R.transpose());
    }
  }
  std::vector<Eigen::Matrix3d> reckoned;
  double least = 3.0;  // trace
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (!is_pose(graph.type(v))) return kNone;
    const Eigen::Matrix3d given = pose_of(*graph.type(v).placement(), graph.state(v).data()).R;
    const Step& step = steps[static_cast<std::size_t>(v)];
    if (v > 0 && step.from < 0) return kNone;
    reckoned.push_back(v == 0 ? given : reckoned[static_cast<std::size_t>(step.from)] * step.R);
    least = std::min(least, reckoned.back().cwiseProduct(given).sum());
  }
  return angle_of(least);
}

bool few_that_disagree(const Graph& graph, double angle) {
  return graph.variable_count() <= kFewVariables && angle > kTurnOfFew;
}

}  // namespace cairn::initial
