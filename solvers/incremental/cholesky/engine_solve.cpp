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

// How the accuracy that is asked for, a fraction of chi2, is shared out. Found by trying on the
// published graphs: what is left at the end stays well within it.
constexpr double kEnough = 0.08;    ///< of it all: by how much more solving could lower chi2
constexpr double kStepShare = 0.1;  ///< of a factor's: steps that are not followed down the tree
/// So much may be left of the steps since the factors were evaluated, before they are again.
constexpr double kLook = 0.15;
/// A step that has gained so many times what may be left is looked at in any case.
constexpr double kFar = 6.0;
/// What is left is guessed from what was: a share of what the steps have gained, at least …
constexpr double kLeastShare = 5e-3;
constexpr double kOthersShare = 0.05;   ///< … where factors are not of poses alone, …
constexpr double kForget = 0.5;         ///< … and not less than so much of the guess before, …
constexpr double kOthersForget = 0.95;  ///< … where they are not
/// What can still be gained is at most so many times what steps have fallen short of.
constexpr double kCaution = 6.0;
/// Gradients that promise up to so many times as much say that H is right.
constexpr double kTrusted = 3.0;
/// Where some factors are none of poses alone: while a solution leaves less than this fraction of
/// what it has gained, H does as it is.
constexpr double kFast = 0.2;
/// Jacobians of such factors that are off by more than this part are renewed.
constexpr double kMismatch = 0.05;
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
  while (busy() || begin_job(report)) {
    if (!go_on(report) || !admit_waiting()) break;
    if (!pace_.allows(Work::order, 1.0)) break;
  }
  const int waiting = models_.size() - admitted_;
  if (busy()) {
    show_what_is_proven();
    report.owed = std::max(job_.factors, 1) + waiting;
  } else if (!touched_.empty()) {
    report.owed += unsolved_;
  }
  report.ok = !broken_;
}

/// Whether there is anything to be solved for.
bool Engine::begin_job(UpdateReport& report) {
  settle_gauge();
  ++time_;
  states_.remember();
  if (broken_) {
    diverged(report);
    return busy();
  }
  if (must_look_) bring_back();
  if (touched_.empty() && sources_.empty()) return false;
  job_ = {};
  job_.factors = std::exchange(unsolved_, 0);
  job_.at_first = cost();
  job_.go_to(Job::Stage::order);
  return true;
}

/// Continues the job until it has ended. False if there was no time for that.
bool Engine::go_on(UpdateReport& report) {
  while (busy()) {
    if (!advance(report)) return false;
  }
  return true;
}

void Engine::end_job() {
  job_ = {};
  exhausted_ = false;
  pace_.keep_free(0.0);
  shown_.reset();
}

/// A stage of the job. False if there was no time for all of it.
bool Engine::advance(UpdateReport& report) {
  using enum Job::Stage;
  UpdateSeconds& seconds = report.seconds;
  switch (job_.stage) {
    case none:
      break;
    case order:
      return order_affected(report);
    case factorize:
      return factorize_more(report);
    case right_hand_side: {
      const Timed timed(seconds.solve);
      if (!set_right_hand_side_more()) return false;
      for (const std::int32_t v : sources_) system_.mark_solved(v);
      substitution_.begin_climb(tree_, sources_);
      job_.go_to(climb);
      break;
    }
    case climb: {
      const Timed timed(seconds.solve);
      if (!substitution_.climb(system_, tree_, pace_)) return false;
      decrease_ = substitution_.climbed();
      gained_ += decrease_;
      for (const std::int32_t v : sources_) is_source_[v] = 0;
      sources_.clear();
      job_.unproven = true;
      if (!shown_) pace_.keep_free(kCopySeconds * states_.size());
      substitution_.begin_descent(tree_, motions_);
      job_.go_to(descend);
      break;
    }
    case descend: {
      const Timed timed(seconds.solve);
      if (!substitution_.descend(system_, tree_, states_, motions_, job_.tolerance, steps_, pace_))
        return false;
      job_.go_to(move_states);
      break;
    }
    case move_states:
    case turn_models: {
      const Timed timed(seconds.check);
      if (!move_more()) return false;
      if (job_.damped == Job::Damped::tried) {
        begin_relinearizing_all();
      } else {
        look(report);
      }
      break;
    }
    case evaluate: {
      const Timed timed(seconds.check);
      if (!evaluate_more()) return false;
      evaluated(report);
      break;
    }
    case gradient: {
      const Timed timed(seconds.solve);
      if (!set_right_hand_side_more()) return false;
      gradients_.resize(system_.g().size());
      for (const std::int32_t v : sources_)
        std::copy_n(system_.g(v), system_.size(v), gradients_.data() + system_.offset(v));
      substitution_.begin_climb(tree_, sources_);
      job_.go_to(decrement);
      break;
    }
    case decrement: {
      const Timed timed(seconds.solve);
      if (!substitution_.climb(system_, tree_, pace_)) return false;
      substitution_.end_decrement(system_, tree_);
      improve(report);
      break;
    }
    case set_aside: {
      const Timed timed(seconds.solve);
      return set_aside_more();
    }
    case relinearize: {
      const Timed timed(seconds.linearize);
      return relinearize_more(report);
    }
    case follow_all:
    case frame_all:
    case linearize_all: {
      const Timed timed(seconds.linearize);
      if (!relinearize_all_more()) return false;
      linearized_all(report);
      break;
    }
  }
  return true;
}

/// Finds what is affected, and orders it anew if blocks of H have come or gone.
bool Engine::order_affected(UpdateReport& report) {
  const Timed timed(report.seconds.order);
  tree_.clear_affected();
  if (structure_changed_ && tree_.worn_out() &&
      (!pace_.limited() || tree_.seconds_to_order_anew() < pace_.limit())) {
    touch_all();
  }
  for (const std::int32_t v : touched_) {
    if (!held_[v] || tree_.node_of(v) >= 0) tree_.touch(v);
  }
  for (const std::int32_t v : retiring_) tree_.retire(v);
  if (structure_changed_) {
    prepare_for_revisits();
    if (!pace_.allows(Work::order, tree_.affected_variables())) return false;
    tree_.restructure(system_, {touched_at_, time_ - settings_.recent, expected_});
    states_.remember();  // nodes keep their numbers from here on
  }
  retiring_.clear();
  structure_changed_ = false;
  report.affected_variables += tree_.affected_variables();
  for (const std::int32_t v : touched_) add_source(v);
  touched_.clear();
  if (job_.damped == Job::Damped::no) job_.before = cost();
  factorization_.begin(tree_, job_.damped == Job::Damped::no ? 0.0 : job_.lambda);
  job_.go_to(Job::Stage::factorize);
  return true;
}

/// Touches what measurements will probably join next, where that costs little beside what is
/// affected anyway: ordered last together, the paths of the next updates are short.
void Engine::prepare_for_revisits() {
  expected_.clear();
  const double cost = tree_.affected_cost();
  double budget = kPreparation * cost;
  for (Revisits::Run& run : revisits_.at(time_)) {
    bool prepare = !run.was_prepared();
    if (prepare && cost <= settings_.prepares_above) continue;
    for (std::int32_t k = 1; k <= run.expected(); ++k) {
      const std::int32_t v = run.variable + k * run.direction;
      if (v < 0 || v >= states_.size()) break;
      if (!live_variable_[v] || held_[v] || tree_.node_of(v) < 0) continue;
      expected_.push_back({v, k <= kSoon});
      if (!prepare) continue;
      const double more = tree_.cost_to_touch(v, budget);
      prepare = more <= budget;
      if (!prepare) continue;
      if (more > 0.0) {
        ++prepared_;
        budget -= more;
        follow(v);
        tree_.touch(v);
      }
      run.prepared_to = v;
      run.prepared_at = time_;
    }
  }
}

bool Engine::factorize_more(UpdateReport& report) {
  std::int32_t result = 0;
  {
    const Timed timed(report.seconds.factorize);
    result = factorization_.more(system_, tree_, pace_);
  }
  if (result == Factorization::kPaused) return false;
  if (result == Factorization::kDone) {
    factorized(report);
  } else {
    not_positive_definite(report);
  }
  return true;
}

void Engine::factorized(UpdateReport& report) {
  job_.tolerance = 0.0;
  switch (job_.damped) {
    case Job::Damped::no:
      if (job_.rounds == 0 && sources_.size() < kMostSources && negligible()) return end_job();
      job_.tolerance = share(kStepShare);
      break;
    case Job::Damped::begun:
      states_.remember();
      job_.damped = Job::Damped::tried;
      break;
    case Job::Damped::tried:
      break;
    case Job::Damped::last:
      broken_ = undetermined_;
      if (job_.converged) break;
      report.converged = false;
      report.doubt(fmt::format("not converged after {} iterations", job_.rounds));
      return end_job();
  }
  job_.go_to(Job::Stage::right_hand_side);
}

/// Whether what has not been solved for yet would lower chi2 by nothing that matters.
bool Engine::negligible() {
  for (const std::int32_t v : sources_) {
    settle(v);
    models_.right_hand_side(system_, states_, v);
  }
  const double gain = substitution_.decrement(system_, tree_, sources_);
  return gain <= std::min(settings_.significance, kEnough * settings_.accuracy * cost());
}

/// A share of the accuracy that is asked for, of the mean cost of a factor.
double Engine::share(double part) const {
  return part * settings_.accuracy * cost() / std::max(live_factors_, 1);
}

bool Engine::set_right_hand_side_more() {
  for (; job_.next < sources_.size(); ++job_.next) {
    if (!pace_.allows(Work::move, 1.0)) return false;
    const std::int32_t v = sources_[job_.next];
    settle(v);
    models_.right_hand_side(system_, states_, v);
  }
  return true;
}

void Engine::touch_all() {
  for (int v = 0; v < states_.size(); ++v) {
    if (!live_variable_[v] || held_[v]) continue;
    follow(v);
    touch(v);
  }
}

/// Moves the estimate by the step.
bool Engine::move_more() {
  if (job_.stage == Job::Stage::move_states) {
    while (job_.next < steps_.changed.size()) {
      const std::size_t count = std::min(steps_.changed.size() - job_.next, kAtOnce);
      if (!pace_.allows(Work::move, static_cast<double>(count))) return false;
      move_states(std::span(steps_.changed).subspan(job_.next, count));
      job_.next += count;
    }
    job_.go_to(Job::Stage::turn_models);
  }
  for (const auto turns = motions_.turns(); job_.next < turns.size(); ++job_.next) {
    const auto factors = factors_of_[turns[job_.next].variable].size();
    if (!pace_.allows(Work::move, static_cast<double>(factors))) return false;
    turn_models(turns[job_.next]);
  }
  steps_.clear(system_);
  return true;
}

/// After a step: if what is known of the factors may be wrong by too much, all that have moved are
/// to be evaluated: few of them alone would say nothing of the rest.
void Engine::look(UpdateReport& report) {
  const bool last = job_.damped == Job::Damped::last;
  if (!last) ++report.iterations;
  const bool anyway =
      std::exchange(must_look_, false) || live_factors_ <= kFew || last || job_.rounds > 0;
  ++job_.rounds;
  const double allowed = settings_.accuracy * cost();
  if (!anyway && left_share_ * gained_ <= kLook * allowed && decrease_ <= kFar * allowed)
    return end_job();
  job_.expected = cost();
  looked_at_ = std::exchange(gained_, 0.0);
  collect_moved_factors();
  job_.square = 0.0;
  job_.compared = 0;
  job_.go_to(Job::Stage::evaluate);
}

bool Engine::evaluate_more() {
  while (job_.next < looked_.size()) {
    std::size_t end = job_.next;
    together_.clear();
    for (; end < looked_.size() && together_.size() < kAtOnce; ++end) {
      if (!live_factor_[looked_[end]]) continue;
      if (!together_.empty() && !models_.alike(together_.front(), looked_[end])) break;
      together_.push_back(looked_[end]);
    }
    if (!pace_.allows(Work::evaluate, static_cast<double>(together_.size()))) return false;
    evaluate(together_);
    job_.next = end;
  }
  mismatch_ = job_.compared > 0 ? std::sqrt(job_.square / job_.compared) : 0.0;
  shortfall_ = cost_ - job_.expected;
  return true;
}

/// Evaluates factors that are alike again. Where a factor type throws, nothing has changed.
void Engine::evaluate(std::span<const std::int32_t> factors) {
  double before = 0.0, now = 0.0;
  for (const std::int32_t f : factors) {
    for (const std::int32_t v : models_.variables(f)) {
      if (is_source_[v]) continue;
      settle(v);
      add_source(v);
    }
    before += models_.cost(f);
  }
  models_.correct(factors, graph_, states_, system_, held_);
  for (const std::int32_t f : factors) now += models_.cost(f);
  cost_ += now - before;
  for (const std::int32_t f : factors) {
    if (others_ == 0 || !is_other(f)) continue;
    const double mismatch = models_.mismatch(f, graph_, states_);
    job_.square += mismatch * mismatch;
    ++job_.compared;
  }
}

void Engine::evaluated(UpdateReport& report) {
  if (job_.damped == Job::Damped::last) return end_job();
  // Negated, so that what is not a number is bad too.
  if (!(cost_ <= 2.0 * job_.before + rounding())) return diverged(report);
  if (pace_.limited() && cost_ <= job_.before + rounding()) prove();
  job_.go_to(Job::Stage::gradient);
}

/// The estimate is as good as it was before the round: it may be seen, and is what a later round
/// would go back to.
void Engine::prove() {
  job_.unproven = false;
  pace_.keep_free(0.0);
  shown_.reset();
  place_followers();
  states_.remember();
}

/// Whether to solve once more: whether that would lower chi2 noticeably.
///
/// The gradients that are left would gain gᵀH⁻¹g if H were right, and for poses alone, as a rule,
/// not much more than what chi2 has fallen short of (see docs/online.md). If both agree, H does as
/// it is; if the former is much larger, H is not that of the current estimate, and what has moved
/// is relinearised.
void Engine::improve(UpdateReport& report) {
  const double left =
      std::min(substitution_.climbed(), cost_);  // more is rounding: chi2 is not negative
  const double allowed = settings_.accuracy * cost_ + rounding();
  report.owed = 0;
  const bool poses_alone = others_ == 0 && live_factors_ > kFew;
  const double likely = poses_alone ? std::min(left, kCaution * std::abs(shortfall_)) : left;
  left_share_ = poses_alone ? std::max(kForget * left_share_, kLeastShare)
                            : std::max(kOthersForget * left_share_, kOthersShare);
  if (looked_at_ > 0.0) left_share_ = std::clamp(likely / looked_at_, left_share_, 1.0);
  const bool right =
      poses_alone ? left <= std::min(kTrusted * likely, looked_at_) : left <= kFast * looked_at_;
  if (likely <= kEnough * allowed && mismatch_ <= kMismatch)
    return job_.go_to(Job::Stage::set_aside);
  if (job_.rounds >= settings_.iterations) {
    // The next update goes on; where that is not enough either, Gauss-Newton may never be.
    const bool hopeless = exhausted_ && job_.rounds >= kPatience && likely > settings_.significance;
    if (hopeless) {
      if (cost_ <= job_.at_first + rounding()) prove();
      return diverged(report);
    }
    report.owed = static_cast<int>(looked_.size());
    end_job();
    exhausted_ = true;
    return;
  }
  job_.factors = static_cast<int>(looked_.size());
  if (right && mismatch_ <= kMismatch) return job_.go_to(Job::Stage::order);
  if (job_.rounds >= 2 || static_cast<double>(looked_.size()) > kMost * live_factors_)
    return begin_relinearizing_all();
  job_.go_to(Job::Stage::relinearize);
}

/// Leaves the gradients at hand alone until the factors are evaluated again: with an old H, what
/// little they have to tell might do more harm than good.
bool Engine::set_aside_more() {
  for (; job_.next < sources_.size(); ++job_.next) {
    if (!pace_.allows(Work::move, 1.0)) return false;
    const std::int32_t v = sources_[job_.next];
    std::copy_n(gradients_.data() + system_.offset(v), system_.size(v), system_.g(v));
    system_.set_aside(v);
    is_source_[v] = 0;
  }
  sources_.clear();
  end_job();
  return true;
}

bool Engine::relinearize_more(UpdateReport& report) {
  for (; job_.next < looked_.size(); ++job_.next) {
    const std::int32_t f = looked_[job_.next];
    if (!live_factor_[f]) continue;
    if (!pace_.allows(Work::linearize, 1.0)) return false;
    relinearize(f);
    ++report.relinearized_factors;
  }
  job_.go_to(Job::Stage::order);
  return true;
}

/// A step with the factor at hand to its end, and everything that has moved evaluated.
void Engine::step_and_look(UpdateReport& report) {
  job_ = {};
  job_.damped = Job::Damped::last;
  job_.go_to(Job::Stage::right_hand_side);
  go_on(report);
}

void Engine::relinearize_all() {
  begin_relinearizing_all();
  relinearize_all_more();
  job_ = {};
}

/// The factor of H as it is now. False if H is not positive definite.
bool Engine::bring_factor_up_to_date(UpdateReport& report) {
  job_ = {};
  order_affected(report);
  job_ = {};
  const Timed timed(report.seconds.factorize);
  return factorization_.more(system_, tree_, pace_) == Factorization::kDone;
}

}  // namespace cairn::incremental
