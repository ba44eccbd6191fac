// SPDX-License-Identifier: BSD-3-Clause
#include "engine.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn::incremental {
namespace {

using Clock = std::chrono::steady_clock;

/// What a factor's chi2 may be off by rounding, where its information is ordinary.
constexpr double kRounding = 1e-18;

// How the accuracy that is asked for, a fraction of chi2, is shared out. Found by trying on the
// published graphs: what is left at the end stays well within it.
constexpr double kEnough = 0.2;     ///< of it all: by how much more solving could lower chi2
constexpr double kStepShare = 0.1;  ///< of a factor's: steps that are not followed down the tree
/// So much may be left of the steps since the factors were evaluated, before they are again.
constexpr double kLook = 0.1;
/// A step that has gained so many times what may be left is looked at in any case.
constexpr double kFar = 4.0;
/// What is left is guessed from what was: a share of what the steps have gained, at least …
constexpr double kLeastShare = 5e-3;
constexpr double kOthersShare = 0.01;  ///< … where factors are not of poses alone, …
constexpr double kForget = 0.5;        ///< … and not less than so much of the guess before
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
/// If more than this part of the factors were to be renewed, all are.
constexpr double kMost = 0.2;

const block::Kernels& kernels_named(const std::string& name) {
  const block::Kernels* kernels = block::choose_kernels(name.c_str());
  if (kernels) return *kernels;
  throw Error(ErrorCode::usage, "this machine cannot run the kernels '" + name + "'; use auto");
}

}  // namespace

Engine::Engine(const Settings& settings, std::shared_ptr<Rescuer> rescuer)
    : EngineState(settings, std::move(rescuer), kernels_named(settings.kernels)),
      tree_(system_, states_, bound_, *kernels_) {}

Engine::Engine(const Engine& other)
    : EngineState(other),
      graph_(other.graph_.clone()),
      tree_(other.tree_, system_, states_, bound_) {}

void Engine::solve(double max_seconds, UpdateReport& report) {
  const Clock::time_point begin = Clock::now();
  settle_gauge();
  ++time_;
  limit_ = max_seconds;
  states_.remember();
  if (broken_) return rescue(report, 1e-6);
  if (must_look_) bring_back();
  bool again = !touched_.empty() || !sources_.empty();
  for (int round = 0; again; ++round) {
    const Clock::time_point round_begin = Clock::now();
    const double before = cost();
    if (!bring_factor_up_to_date(report)) {
      step_back();
      return rescue(report, 1e-6);
    }
    if (round == 0 && sources_.size() < kMostSources && negligible()) break;
    take_step(share(kStepShare), report);
    ++report.iterations;
    if (!check(round > 0, report)) return;
    // Negated, so that what is not a number is bad too.
    if (!(cost_ <= 2.0 * before + rounding())) {
      step_back();
      return rescue(report, 1e-6);
    }
    // The next round may have to factorise more than this one had.
    const bool in_time =
        max_seconds <= 0.0 || seconds_since(begin) + 2.0 * seconds_since(round_begin) < max_seconds;
    again = improve(in_time && report.iterations < settings_.iterations, report);
  }
}

/// Whether what has not been solved for yet would lower chi2 by nothing that matters.
bool Engine::negligible() {
  set_right_hand_side();
  const double gain = tree_.decrement(sources_, system_.g());
  return gain <= std::min(settings_.significance, kEnough * settings_.accuracy * cost());
}

/// A share of the accuracy that is asked for, of the mean cost of a factor.
double Engine::share(double part) const {
  return part * settings_.accuracy * cost() / std::max(live_factors_, 1);
}

double Engine::rounding() {
  if (std::exchange(rounding_is_old_, false)) {
    rounding_scale_ = 0.0;
    for (int f = 0; f < std::ssize(live_factor_); ++f)
      if (live_factor_[f]) rounding_scale_ += rounding_scale(f);
  }
  return kRounding * rounding_scale_;
}

/// The estimate from before this update.
void Engine::step_back() {
  states_.undo(
      [&](std::int32_t node, std::span<const double> lead) { tree_.undo_lead(node, lead); });
}

/// Starts anew at the current estimate with an optimizer that never raises chi2.
void Engine::rescue(UpdateReport& report, double tolerance) {
  {
    const Timed timed(report.seconds.linearize);
    write_back();
    Graph graph = clean_graph();
    const std::lock_guard lock(rescuer_->mutex);
    const Summary summary =
        rescuer_->optimizer->optimize(graph, {.max_iterations = 100, .tolerance = tolerance});
    report.iterations += static_cast<int>(summary.iterations.size());
    report.converged = summary.status == Status::converged;
    if (!report.converged)
      report.notes.push_back(fmt::format("not converged: {} after {} iterations",
                                         to_string(summary.status), summary.iterations.size()));
    load(std::move(graph), live_ids());
  }
  broken_ = !bring_factor_up_to_date(report);
  report.ok = !broken_;
  if (broken_) return;
  take_step(0.0, report);
  check(true, report);
}

void Engine::add_source(std::int32_t v) {
  if (held_[v] || is_source_[v]) return;
  is_source_[v] = 1;
  sources_.push_back(v);
}

/// The factor of H as it is now. False if H is not positive definite.
bool Engine::bring_factor_up_to_date(UpdateReport& report) {
  {
    const Timed timed(report.seconds.order);
    tree_.clear_affected();
    if (structure_changed_ && tree_.worn_out() &&
        (limit_ <= 0.0 || tree_.seconds_to_order_anew() < limit_)) {
      touch_all();
    }
    for (const std::int32_t v : touched_) {
      if (!held_[v] || tree_.node_of(v) >= 0) tree_.touch(v);
    }
    for (const std::int32_t v : retiring_) tree_.retire(v);
    if (structure_changed_) {
      tree_.restructure(touched_at_, time_ - settings_.recent);
      states_.remember();  // nodes keep their numbers from here on
    }
    retiring_.clear();
    structure_changed_ = false;
    report.affected_variables += tree_.affected_variables();
    for (const std::int32_t v : touched_) add_source(v);
    touched_.clear();
  }
  const Timed timed(report.seconds.factorize);
  return tree_.factorize() < 0;
}

/// Where something is taken out, what was little may have become much.
void Engine::bring_back() {
  for (int v = 0; v < states_.size(); ++v) {
    if (held_[v] || tree_.node_of(v) < 0 || !system_.has_set_aside(v)) continue;
    system_.count_all(v);
    add_source(v);
  }
}

void Engine::set_right_hand_side() {
  for (const std::int32_t v : sources_) {
    tree_.settle(v);
    models_.right_hand_side(system_, states_, v);
  }
}

void Engine::touch_all() {
  for (int v = 0; v < states_.size(); ++v) {
    if (!live_variable_[v] || held_[v]) continue;
    follow(v);
    touch(v);
  }
}

void Engine::take_step(double tolerance, UpdateReport& report) {
  const Timed timed(report.seconds.solve);
  set_right_hand_side();
  for (const std::int32_t v : sources_) system_.mark_solved(v);
  decrease_ = tree_.solve(sources_, tolerance, system_.g(), steps_, changed_);
  gained_ += decrease_;
  for (const std::int32_t v : sources_) is_source_[v] = 0;
  sources_.clear();
}

/// Moves to the solution, and if what is known of the factors may be wrong by too much then,
/// evaluates all that have moved: few of them alone would say nothing of the rest. Whether it has.
bool Engine::check(bool anyway, UpdateReport& report) {
  const Timed timed(report.seconds.check);
  apply_steps();
  const double allowed = settings_.accuracy * cost();
  anyway = std::exchange(must_look_, false) || live_factors_ <= kFew || anyway;
  if (!anyway && left_share_ * gained_ <= kLook * allowed && decrease_ <= kFar * allowed)
    return false;
  const double expected = cost();
  looked_at_ = std::exchange(gained_, 0.0);
  looked_.swap(moving_);
  moving_.clear();
  double square = 0.0;
  int compared = 0;
  for (const std::int32_t f : looked_) {
    if (!live_factor_[f]) continue;
    for (const std::int32_t v : models_.variables(f)) tree_.settle(v);
    cost_ -= models_.cost(f);
    const bool compare = others_ > 0 && is_other(f);
    const double mismatch = models_.correct(f, graph_, states_, system_, held_, compare);
    square += mismatch * mismatch;
    compared += compare;
    cost_ += models_.cost(f);
    for (const std::int32_t v : models_.variables(f)) add_source(v);
  }
  mismatch_ = compared > 0 ? std::sqrt(square / compared) : 0.0;
  shortfall_ = cost_ - expected;
  return true;
}

/// Whether to solve once more: whether that would lower chi2 noticeably.
///
/// The gradients that are left would gain gᵀH⁻¹g if H were right, and for poses alone, as a rule,
/// not much more than what chi2 has fallen short of (see docs/online.md). If both agree, H does as
/// it is; if the former is much larger, H is not that of the current estimate, and what has moved
/// is relinearised.
bool Engine::improve(bool enough_time, UpdateReport& report) {
  const double allowed = settings_.accuracy * cost_ + rounding();
  report.owed = 0;
  double left = 0.0;
  {
    const Timed timed(report.seconds.solve);
    set_right_hand_side();
    left = tree_.decrement(sources_, system_.g());
  }
  const bool poses_alone = others_ == 0 && live_factors_ > kFew;
  const double likely = poses_alone ? std::min(left, kCaution * std::abs(shortfall_)) : left;
  left_share_ = std::max(kForget * left_share_, poses_alone ? kLeastShare : kOthersShare);
  if (looked_at_ > 0.0) left_share_ = std::clamp(likely / looked_at_, left_share_, 1.0);
  const bool right =
      poses_alone ? left <= std::min(kTrusted * likely, looked_at_) : left <= kFast * looked_at_;
  if (likely <= kEnough * allowed && mismatch_ <= kMismatch) {
    set_aside();
    return false;
  }
  if (!enough_time) {
    report.owed = static_cast<int>(looked_.size());
    return false;
  }
  if (right && mismatch_ <= kMismatch) return true;
  const Timed timed(report.seconds.linearize);
  if (report.iterations >= 2 || static_cast<double>(looked_.size()) > kMost * live_factors_) {
    relinearize_all();
    report.relinearized_factors += live_factors_;
    return true;
  }
  for (const std::int32_t f : looked_) {
    if (!live_factor_[f]) continue;
    relinearize(f);
    ++report.relinearized_factors;
  }
  return true;
}

/// Leaves the gradients at hand alone until the factors are evaluated again: with an old H, what
/// little they have to tell might do more harm than good.
void Engine::set_aside() {
  set_right_hand_side();
  for (const std::int32_t v : sources_) {
    system_.set_aside(v);
    is_source_[v] = 0;
  }
  sources_.clear();
}

/// Everything at the current estimate: H and g are summed anew, without the rounding of updates.
void Engine::relinearize_all() {
  covariances_.note_everything();
  touch_all();
  moving_.clear();
  for (const std::int32_t v : sources_) is_source_[v] = 0;
  sources_.clear();
  system_.clear_values();
  cost_ = gained_ = 0.0;
  for (int v = 0; v < states_.size(); ++v) states_.put_frame_here(v);
  for (int f = 0; f < models_.size(); ++f) {
    if (!live_factor_[f]) continue;
    models_.linearize(f, graph_, states_);
    cost_ += models_.cost(f);
    models_.add_to(system_, f, 1.0, held_);
  }
}

std::vector<FactorId> Engine::live_ids() const {
  std::vector<FactorId> ids;
  for (std::size_t f = 0; f < ids_.size(); ++f) {
    if (live_factor_[f]) ids.push_back(ids_[f]);
  }
  return ids;
}

void Engine::compact() {
  if (dead_ == 0) return;
  Graph graph = snapshot();
  load(std::move(graph), live_ids());
}

/// Without what has been removed.
Graph Engine::clean_graph() const {
  Graph graph = graph_.clone();
  remove_dead(graph);
  return graph;
}

void Engine::remove_dead(Graph& graph) const {
  if (dead_ == 0) return;
  std::vector<bool> factors(live_factor_.size()), variables(live_variable_.size());
  for (std::size_t f = 0; f < factors.size(); ++f) factors[f] = !live_factor_[f];
  for (std::size_t v = 0; v < variables.size(); ++v) variables[v] = !live_variable_[v];
  graph.remove(factors, variables);
}

void Engine::solve_fully(UpdateReport& report) {
  settle_gauge();
  ++time_;
  limit_ = 0.0;
  states_.remember();
  if (broken_) return rescue(report, 1e-12);
  structure_changed_ = true;
  for (int round = 0; round < 50; ++round) {
    {
      const Timed timed(report.seconds.linearize);
      relinearize_all();
      report.relinearized_factors += live_factors_;
    }
    const double before = cost_;
    const bool ok = bring_factor_up_to_date(report);
    if (ok) {
      take_step(0.0, report);
      ++report.iterations;
      check(true, report);
    }
    if (!ok || !(cost_ <= 1.01 * before + rounding())) {
      step_back();
      return rescue(report, 1e-12);
    }
    if (decrease_ <= 1e-12 * cost_ + rounding()) return;
  }
  rescue(report, 1e-12);
}

std::vector<double> Engine::x(int v) const {
  std::vector<double> x(static_cast<std::size_t>(states_.ambient(v)));
  if (!tree_.read(v, x.data())) std::copy_n(states_.x(v), x.size(), x.begin());
  return x;
}

double Engine::chi2() const {
  const Estimate estimate = current();
  double sum = 0.0;
  for (int f = 0; f < models_.size(); ++f) {
    if (live_factor_[f]) sum += models_.cost_now(f, graph_, estimate);
  }
  return sum;
}

/// The states as the graph's pools hold them.
Values Engine::values_of(const Estimate& estimate) const {
  Values values = graph_.values();
  for (int v = 0; v < estimate.size(); ++v) {
    const std::int32_t ambient = states_.ambient(v);
    std::copy_n(estimate.x(v), ambient,
                values.pools[graph_.pool(v)].begin() + std::ptrdiff_t{graph_.slot(v)} * ambient);
  }
  return values;
}

void Engine::write_back() {
  tree_.settle_all();
  graph_.set_values(values_of(states_.estimate()));
}

Graph Engine::snapshot() const {
  Graph graph = graph_.clone();
  graph.set_values(values_of(current()));
  remove_dead(graph);
  return graph;
}

}  // namespace cairn::incremental
