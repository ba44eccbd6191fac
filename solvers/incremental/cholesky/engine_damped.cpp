// SPDX-License-Identifier: BSD-3-Clause
// Where Gauss-Newton does not do: everything linearised anew, and damped rounds
// (Levenberg-Marquardt).
#include <algorithm>

#include "engine.hpp"

namespace cairn::incremental {
namespace {

// Damped rounds, with H + λ diag(H).
constexpr double kFirstDamping = 1e-6;
constexpr double kMostDamping = 1e12;
constexpr double kEase = 0.1;  ///< factor of λ after a step that is accepted
/// Once a step lowers chi2 by less than this fraction, H is not damped: it would only delay.
constexpr double kUndamped = 1e-3;
constexpr double kConverged = 1e-6;
constexpr int kMostDampedRounds = 100;

}  // namespace

void Engine::begin_relinearizing_all() {
  covariances_.note_everything();
  job_.go_to(Job::Stage::follow_all);
}

/// Everything at the current estimate: H and g are summed anew, without the rounding of updates.
bool Engine::relinearize_all_more() {
  const std::size_t variables = static_cast<std::size_t>(states_.size());
  if (job_.stage == Job::Stage::follow_all) {
    for (; job_.next < variables; ++job_.next) {
      if (!pace_.allows(Work::move, 1.0)) return false;
      const std::int32_t v = static_cast<std::int32_t>(job_.next);
      if (!live_variable_[v] || held_[v]) continue;
      follow(v);
      touch(v);
    }
    for (const std::int32_t v : moved_) has_moved_[v] = 0;
    moved_.clear();
    for (const std::int32_t v : sources_) is_source_[v] = 0;
    sources_.clear();
    system_.clear_values();
    cost_ = gained_ = 0.0;
    job_.go_to(Job::Stage::frame_all);
  }
  if (job_.stage == Job::Stage::frame_all) {
    for (; job_.next < variables; ++job_.next) {
      if (!pace_.allows(Work::move, 1.0)) return false;
      states_.put_frame_here(static_cast<std::int32_t>(job_.next));
    }
    job_.go_to(Job::Stage::linearize_all);
  }
  for (; job_.next < static_cast<std::size_t>(admitted_); ++job_.next) {
    const int f = static_cast<int>(job_.next);
    if (!live_factor_[f]) continue;
    if (!pace_.allows(Work::linearize, 1.0)) return false;
    models_.linearize(f, graph_, states_);
    cost_ += models_.cost(f);
    models_.add_to(system_, states_, f, 1.0, held_);
  }
  return true;
}

void Engine::linearized_all(UpdateReport& report) {
  if (job_.damped == Job::Damped::tried) return judge(report);
  if (job_.damped == Job::Damped::no) report.relinearized_factors += live_factors_;
  if (job_.damped == Job::Damped::begun) job_.before = cost_;
  job_.go_to(Job::Stage::order);
}

/// A step has raised chi2, or H is not positive definite: back to the estimate from before, and on
/// from there with an optimizer that never raises chi2. With a limit of time this is done here, by
/// Levenberg-Marquardt, since it has to be done in pieces.
void Engine::diverged(UpdateReport& report) {
  step_back();
  const int factors = job_.factors;
  end_job();
  if (!pace_.limited()) return rescue(report, kConverged);
  job_.factors = std::max(factors, live_factors_);
  job_.damped = Job::Damped::begun;
  job_.lambda = kFirstDamping;
  left_share_ = 1.0;
  place_followers();
  begin_relinearizing_all();
}

void Engine::not_positive_definite(UpdateReport& report) {
  switch (job_.damped) {
    case Job::Damped::no:
      return diverged(report);
    case Job::Damped::last:
      broken_ = true;
      return end_job();
    default:
      break;
  }
  damp_more();
  if (job_.damped == Job::Damped::last && !job_.converged) job_.lambda = 0.0;
  factorization_.begin(tree_, job_.lambda);
  job_.go_to(Job::Stage::factorize);
}

void Engine::damp_more() {
  job_.undamped_fails = job_.undamped_fails || job_.lambda == 0.0;
  job_.lambda = std::max(job_.lambda, kFirstDamping) * job_.growth;
  job_.growth *= 2.0;
  if (job_.lambda > kMostDamping) give_up();
}

void Engine::give_up() {
  job_.converged = false;
  job_.damped = Job::Damped::last;
  job_.lambda = 0.0;
}

/// After a damped step, with everything linearised there: whether it is accepted.
void Engine::judge(UpdateReport& report) {
  ++report.iterations;
  ++job_.rounds;
  if (cost_ <= job_.before + rounding()) {
    const double gain = job_.before - cost_;
    job_.before = cost_;
    prove();
    job_.growth = 2.0;
    job_.damped = Job::Damped::begun;
    const bool judges = job_.lambda == 0.0 || job_.undamped_fails;
    if (judges && gain <= kConverged * cost_ + rounding()) {
      job_.damped = Job::Damped::last;
      job_.lambda = 0.0;
    } else if (!job_.undamped_fails && gain <= kUndamped * cost_) {
      job_.lambda = 0.0;
    } else {
      job_.lambda *= kEase;
    }
  } else {
    step_back();
    job_.unproven = false;
    pace_.keep_free(0.0);
    shown_.reset();
    job_.damped = Job::Damped::begun;
    damp_more();
    begin_relinearizing_all();
  }
  if (job_.rounds >= kMostDampedRounds && job_.damped != Job::Damped::last) give_up();
  if (job_.stage == Job::Stage::linearize_all) job_.go_to(Job::Stage::order);
}

}  // namespace cairn::incremental
