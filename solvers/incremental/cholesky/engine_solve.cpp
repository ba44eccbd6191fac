// SPDX-License-Identifier: BSD-3-Clause
// How a change is solved for: in pieces, so that it can go on in a later update.
#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cairn/runtime/timed.hpp"
#include "engine.hpp"

namespace cairn::incremental {
namespace {

/// What would lower chi2 by nothing that matters is solved for once it comes from so many
/// variables, or each update would look at all that came since the last step.
constexpr std::size_t kMostSources = 256;
/// In graphs of no more factors all are evaluated after each step.
constexpr int kFew = 200;
/// Fewer iterations in each of two solutions do not say that there will never be enough.
constexpr int kPatience = 10;
/// If more than this part of the factors were to be renewed, all are.
constexpr double kMost = 0.2;

/// What is done for the next updates may cost so much of what this one does anyway.
constexpr double kPreparation = 0.25;
/// Of what is expected, so many variables of a run are ordered with the last ones.
constexpr std::int32_t kSoon = 10;

/// So many variables are moved, and factors evaluated, at a time.
constexpr std::size_t kAtOnce = 64;
/// What it takes to copy a variable's state for `Engine::shown_` [s].
constexpr double kCopySeconds = 0.15e-6;

}  // namespace

void Engine::solve(double max_seconds, UpdateReport& report) {
  pace_.begin(max_seconds);
  while (busy() || begin(report)) {
    if (!go_on(report)) break;
    const bool more = problem_.waiting() > 0;
    pending_.place(problem_);
    pending_.clear();
    problem_.admit_waiting();
    if (!more || !pace_.allows(Work::order, 1.0)) break;
  }
  if (busy()) {
    show_what_is_proven();
    report.owed = std::max(solution_.factors, 1) + problem_.waiting();
  } else if (!problem_.change.touched.empty()) {
    report.owed += problem_.change.factors;
  }
  report.ok = !broken_;
}

/// Whether there is anything to be solved for.
bool Engine::begin(UpdateReport& report) {
  Change& change = problem_.change;
  problem_.begin_solution();
  if (broken_) {
    solution_.go_to(diverged(report));
    return busy();
  }
  if (change.must_look) problem_.bring_back();
  if (change.touched.empty() && change.sources.list().empty()) return false;
  solution_ = {
      .stage = Stage::order, .at_first = cost(), .factors = std::exchange(change.factors, 0)};
  return true;
}

/// Continues the solution until it has ended. False if there was no time for that.
bool Engine::go_on(UpdateReport& report) {
  while (busy()) {
    const Next next = advance(report);
    if (!next) return false;
    solution_.go_to(*next);
  }
  return true;
}

Engine::Stage Engine::end() {
  solution_ = {};
  exhausted_ = false;
  hide_unproven();
  return Stage::none;
}

Engine::Next Engine::advance(UpdateReport& report) {
  using enum Solution::Stage;
  UpdateSeconds& seconds = report.seconds;
  const auto timed = [](double& sum, auto stage) {
    const Timed time(sum);
    return stage();
  };
  switch (solution_.stage) {
    case none:
      break;
    case order:
      return timed(seconds.order, [&] { return this->order(report); });
    case factorize:
      return this->factorize(report);
    case right_hand_side:
      return timed(seconds.solve, [&] { return set_right_hand_side(); });
    case climb:
      return timed(seconds.solve, [&] { return this->climb(); });
    case descend:
      return timed(seconds.solve, [&] { return this->descend(); });
    case move_states:
      return timed(seconds.check, [&] { return this->move_states(); });
    case turn_models:
      return timed(seconds.check, [&] { return this->turn_models(report); });
    case evaluate:
      return timed(seconds.check, [&] { return this->evaluate(report); });
    case gradient:
      return timed(seconds.solve, [&] { return evaluate_gradients(); });
    case decrement:
      return timed(seconds.solve, [&] { return this->decrement(report); });
    case set_aside:
      return timed(seconds.solve, [&] { return this->set_aside(); });
    case relinearize:
      return timed(seconds.linearize, [&] { return this->relinearize(report); });
    case follow_all:
      return timed(seconds.linearize, [&] { return this->follow_all(); });
    case frame_all:
      return timed(seconds.linearize, [&] { return this->frame_all(); });
    case linearize_all:
      return timed(seconds.linearize, [&] { return this->linearize_all(report); });
  }
  return none;
}

/// Finds what is affected, and orders it anew if blocks of H have come or gone.
Engine::Next Engine::order(UpdateReport& report) {
  Tree& tree = problem_.tree;
  Change& change = problem_.change;
  tree.clear_affected();
  if (change.of_structure && tree.worn_out() &&
      (!pace_.limited() || tree.seconds_to_order_anew() < pace_.limit())) {
    for (int v = 0; v < problem_.states.size(); ++v) problem_.follow_and_touch(v);
  }
  problem_.mark_affected();
  if (change.of_structure) {
    const std::vector<Expected> expected = prepare_for_revisits();
    if (!pace_.allows(Work::order, tree.affected_variables())) return std::nullopt;
    const Visits& visits = problem_.visits;
    tree.restructure(problem_.system, {visits.last, visits.now - settings_.recent, expected});
    problem_.states.remember();  // nodes keep their numbers from here on
  }
  report.affected_variables += tree.affected_variables();
  problem_.take_touched();
  if (solution_.damping.stage() == Damping::Stage::none) solution_.before = cost();
  factorization_.begin(tree, solution_.damping.lambda());
  return Stage::factorize;
}

/// Touches what measurements will probably join next, where that costs little beside what is
/// affected anyway: ordered last together, the paths of the next updates are short. Returns what
/// they will join.
std::vector<Expected> Engine::prepare_for_revisits() {
  Tree& tree = problem_.tree;
  Visits& visits = problem_.visits;
  std::vector<Expected> expected;
  const double cost = tree.affected_cost();
  double budget = kPreparation * cost;
  for (Revisits::Run& run : visits.revisits.at(visits.now)) {
    bool prepare = !run.was_prepared();
    if (prepare && cost <= settings_.prepares_above) continue;
    for (std::int32_t k = 1; k <= run.expected(); ++k) {
      const std::int32_t v = run.variable + k * run.direction;
      if (v < 0 || v >= problem_.states.size()) break;
      if (!problem_.is_free(v) || tree.node_of(v) < 0) continue;
      expected.push_back({v, k <= kSoon});
      if (!prepare) continue;
      const double more = tree.cost_to_touch(v, budget);
      prepare = more <= budget;
      if (!prepare) continue;
      if (more > 0.0) {
        ++prepared_;
        budget -= more;
        problem_.follow(v);
        tree.touch(v);
      }
      run.prepared_to = v;
      run.prepared_at = visits.now;
    }
  }
  return expected;
}

Engine::Next Engine::factorize(UpdateReport& report) {
  std::int32_t result = 0;
  {
    const Timed timed(report.seconds.factorize);
    result = factorization_.more(problem_.system, problem_.tree, pace_);
  }
  if (result == Factorization::kPaused) return std::nullopt;
  return result == Factorization::kDone ? factorized(report) : not_positive_definite(report);
}

Engine::Stage Engine::factorized(UpdateReport& report) {
  solution_.tolerance = 0.0;
  switch (solution_.damping.stage()) {
    case Damping::Stage::none:
      if (solution_.rounds == 0 && problem_.change.sources.list().size() < kMostSources &&
          negligible())
        return end();
      solution_.tolerance = prediction_.tolerance(cost(), problem_.live_factors());
      break;
    case Damping::Stage::begun:
      problem_.states.remember();
      solution_.damping.take_step();
      break;
    case Damping::Stage::tried:
      break;
    case Damping::Stage::last:
      broken_ = undetermined_;
      if (solution_.damping.has_converged()) break;
      report.converged = false;
      report.doubt(fmt::format("not converged after {} iterations", solution_.rounds));
      return end();
  }
  return Stage::right_hand_side;
}

/// Whether what has not been solved for yet would lower chi2 by nothing that matters.
bool Engine::negligible() {
  const std::vector<std::int32_t>& sources = problem_.change.sources.list();
  for (const std::int32_t v : sources) problem_.right_hand_side(v);
  const double gain = problem_.substitution.decrement(problem_.system, problem_.tree, sources);
  return gain <= std::min(settings_.significance, prediction_.negligible(cost()));
}

/// g of all sources. False if there was no time for that.
bool Engine::find_right_hand_side() {
  const std::vector<std::int32_t>& sources = problem_.change.sources.list();
  for (; solution_.next < sources.size(); ++solution_.next) {
    if (!pace_.allows(Work::move, 1.0)) return false;
    problem_.right_hand_side(sources[solution_.next]);
  }
  problem_.substitution.begin_climb(problem_.tree, sources);
  return true;
}

Engine::Next Engine::set_right_hand_side() {
  if (!find_right_hand_side()) return std::nullopt;
  for (const std::int32_t v : problem_.change.sources.list()) problem_.system.mark_solved(v);
  return Stage::climb;
}

Engine::Next Engine::climb() {
  Substitution& substitution = problem_.substitution;
  if (!substitution.climb(problem_.system, problem_.tree, pace_)) return std::nullopt;
  prediction_.step(substitution.climbed());
  problem_.change.sources.clear();
  solution_.unproven = true;
  if (!shown_) pace_.keep_free(kCopySeconds * problem_.states.size());
  substitution.begin_descent(problem_.tree, problem_.motions);
  return Stage::descend;
}

Engine::Next Engine::descend() {
  if (!problem_.substitution.descend(problem_.system, problem_.tree, problem_.states,
                                     problem_.motions, solution_.tolerance, problem_.steps, pace_))
    return std::nullopt;
  return Stage::move_states;
}

Engine::Next Engine::move_states() {
  const std::span<const std::int32_t> changed = problem_.steps.changed;
  while (solution_.next < changed.size()) {
    const std::size_t count = std::min(changed.size() - solution_.next, kAtOnce);
    if (!pace_.allows(Work::move, static_cast<double>(count))) return std::nullopt;
    problem_.move(changed.subspan(solution_.next, count));
    solution_.next += count;
  }
  return Stage::turn_models;
}

Engine::Next Engine::turn_models(UpdateReport& report) {
  for (const auto turns = problem_.motions.turns(); solution_.next < turns.size();
       ++solution_.next) {
    const Motions::Turn& turn = turns[solution_.next];
    const auto factors = problem_.factors_of(turn.variable).size();
    if (!pace_.allows(Work::move, static_cast<double>(factors))) return std::nullopt;
    problem_.turn_models(turn);
  }
  problem_.steps.clear(problem_.system);
  if (solution_.damping.stage() == Damping::Stage::tried) return begin_relinearizing_all();
  return look(report);
}

/// After a step: if what is known of the factors may be wrong by too much, all that have moved are
/// to be evaluated: few of them alone would say nothing of the rest.
Engine::Stage Engine::look(UpdateReport& report) {
  const bool last = solution_.damping.stage() == Damping::Stage::last;
  if (!last) ++report.iterations;
  const bool anyway = std::exchange(problem_.change.must_look, false) ||
                      problem_.live_factors() <= kFew || last || solution_.rounds > 0;
  ++solution_.rounds;
  if (!anyway && prediction_.is_sure(cost())) return end();
  prediction_.begin_evaluation(problem_.cost());
  solution_.looked_at = problem_.take_moved_factors();
  return Stage::evaluate;
}

Engine::Next Engine::evaluate(UpdateReport& report) {
  const std::vector<std::int32_t>& all = solution_.looked_at;
  const Models& models = problem_.models;
  std::vector<std::int32_t> together;
  together.reserve(kAtOnce);
  while (solution_.next < all.size()) {
    std::size_t end = solution_.next;
    together.clear();
    for (; end < all.size() && together.size() < kAtOnce; ++end) {
      if (!problem_.live_factor(all[end])) continue;
      if (!together.empty() && !models.alike(together.front(), all[end])) break;
      together.push_back(all[end]);
    }
    if (!pace_.allows(Work::evaluate, static_cast<double>(together.size()))) return std::nullopt;
    problem_.evaluate(together);
    for (const std::int32_t f : together) {
      if (problem_.others() > 0 && problem_.is_other(f))
        prediction_.note_mismatch(models.mismatch(f, graph(), problem_.states));
    }
    solution_.next = end;
  }
  const double cost = problem_.cost();
  prediction_.end_evaluation(cost);
  if (solution_.damping.stage() == Damping::Stage::last) return end();
  // Negated, so that what is not a number is bad too.
  if (!(cost <= 2.0 * solution_.before + problem_.rounding())) return diverged(report);
  if (pace_.limited() && cost <= solution_.before + problem_.rounding()) prove();
  return Stage::gradient;
}

/// The estimate is as good as it was before the round: it may be seen, and is what a later round
/// would go back to.
void Engine::prove() {
  hide_unproven();
  pending_.place(problem_);
  problem_.states.remember();
}

/// The estimate is again one that may be seen.
void Engine::hide_unproven() {
  solution_.unproven = false;
  pace_.keep_free(0.0);
  shown_.reset();
}

/// Keeps the estimate from before a step that has not been evaluated.
void Engine::show_what_is_proven() {
  if (!solution_.unproven || shown_) return;
  Leads leads;
  Estimate before = problem_.states.before([&](std::int32_t node, std::span<const double> lead) {
    leads[node].assign(lead.begin(), lead.end());
  });
  shown_ = settled(problem_.tree, problem_.states, std::move(before), leads);
}

Engine::Next Engine::evaluate_gradients() {
  if (!find_right_hand_side()) return std::nullopt;
  System& system = problem_.system;
  const std::vector<std::int32_t>& sources = problem_.change.sources.list();
  std::size_t doubles = 0;
  for (const std::int32_t v : sources) doubles += static_cast<std::size_t>(system.size(v));
  solution_.gradients.resize(doubles);
  double* next = solution_.gradients.data();
  for (const std::int32_t v : sources) next = std::copy_n(system.g(v), system.size(v), next);
  return Stage::decrement;
}

Engine::Next Engine::decrement(UpdateReport& report) {
  if (!problem_.substitution.climb(problem_.system, problem_.tree, pace_)) return std::nullopt;
  problem_.substitution.end_decrement(problem_.system, problem_.tree);
  return improve(report);
}

/// Whether to solve once more: whether that would lower chi2 noticeably. If H is not that of the
/// current estimate, what has moved is relinearised.
Engine::Stage Engine::improve(UpdateReport& report) {
  const int looked_at = static_cast<int>(solution_.looked_at.size());
  const bool poses_alone = problem_.others() == 0 && problem_.live_factors() > kFew;
  const CostPrediction::Judgement judgement = prediction_.judge(
      problem_.substitution.climbed(), problem_.cost(), problem_.rounding(), poses_alone);
  report.owed = 0;
  if (judgement.is_enough) return Stage::set_aside;
  if (solution_.rounds >= settings_.iterations) {
    // The next update goes on; where that is not enough either, Gauss-Newton may never be.
    const bool hopeless =
        exhausted_ && solution_.rounds >= kPatience && judgement.likely > settings_.significance;
    if (hopeless) {
      if (problem_.cost() <= solution_.at_first + problem_.rounding()) prove();
      return diverged(report);
    }
    report.owed = looked_at;
    end();
    exhausted_ = true;
    return Stage::none;
  }
  solution_.factors = looked_at;
  if (judgement.H_is_right) return Stage::order;
  if (solution_.rounds >= 2 || looked_at > kMost * problem_.live_factors())
    return begin_relinearizing_all();
  return Stage::relinearize;
}

/// Leaves the gradients at hand alone until the factors are evaluated again: with an old H, what
/// little they have to tell might do more harm than good.
Engine::Next Engine::set_aside() {
  System& system = problem_.system;
  const std::vector<std::int32_t>& sources = problem_.change.sources.list();
  for (; solution_.next < sources.size(); ++solution_.next) {
    if (!pace_.allows(Work::move, 1.0)) return std::nullopt;
    const std::int32_t v = sources[solution_.next], size = system.size(v);
    std::copy_n(solution_.gradients.data() + solution_.next_gradient, size, system.g(v));
    solution_.next_gradient += static_cast<std::size_t>(size);
    system.set_aside(v);
  }
  problem_.change.sources.clear();
  return end();
}

Engine::Next Engine::relinearize(UpdateReport& report) {
  for (; solution_.next < solution_.looked_at.size(); ++solution_.next) {
    const std::int32_t f = solution_.looked_at[solution_.next];
    if (!problem_.live_factor(f)) continue;
    if (!pace_.allows(Work::linearize, 1.0)) return std::nullopt;
    problem_.relinearize(f);
    ++report.relinearized_factors;
  }
  return Stage::order;
}

/// A step with the factor at hand to its end, and everything that has moved evaluated.
void Engine::step_and_look(UpdateReport& report) {
  solution_ = {.stage = Stage::right_hand_side};
  solution_.damping.end(true);
  go_on(report);
}

void Engine::relinearize_all(UpdateReport& report) {
  solution_ = {.stage = begin_relinearizing_all()};
  while (solution_.stage != Stage::order) solution_.go_to(*advance(report));
  solution_ = {};
}

/// The factor of H as it is now. False if H is not positive definite.
bool Engine::bring_factor_up_to_date(UpdateReport& report) {
  solution_ = {};
  {
    const Timed timed(report.seconds.order);
    order(report);
  }
  solution_ = {};
  const Timed timed(report.seconds.factorize);
  return factorization_.more(problem_.system, problem_.tree, pace_) == Factorization::kDone;
}

}  // namespace cairn::incremental
