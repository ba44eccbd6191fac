// SPDX-License-Identifier: BSD-3-Clause
// Where Gauss-Newton does not do: everything linearised anew, and damped rounds
// (Levenberg-Marquardt).
#include <algorithm>

#include "engine.hpp"

namespace cairn::incremental {
namespace {

constexpr double kConverged = 1e-6;
constexpr int kMostDampedRounds = 100;

}  // namespace

/// Everything at the current estimate: H and g are summed anew, without the rounding of updates.
Engine::Stage Engine::begin_relinearizing_all() {
  problem_.covariances.note_everything();
  return Stage::follow_all;
}

Engine::Next Engine::follow_all() {
  for (; solution_.next < static_cast<std::size_t>(problem_.states.size()); ++solution_.next) {
    if (!pace_.allows(Work::move, 1.0)) return std::nullopt;
    problem_.follow_and_touch(static_cast<int>(solution_.next));
  }
  problem_.clear_values();
  prediction_.begin_anew();
  return Stage::frame_all;
}

Engine::Next Engine::frame_all() {
  for (; solution_.next < static_cast<std::size_t>(problem_.states.size()); ++solution_.next) {
    if (!pace_.allows(Work::move, 1.0)) return std::nullopt;
    problem_.states.put_frame_here(static_cast<std::int32_t>(solution_.next));
  }
  return Stage::linearize_all;
}

Engine::Next Engine::linearize_all(UpdateReport& report) {
  for (; solution_.next < static_cast<std::size_t>(problem_.admitted()); ++solution_.next) {
    const int f = static_cast<int>(solution_.next);
    if (!problem_.live_factor(f)) continue;
    if (!pace_.allows(Work::linearize, 1.0)) return std::nullopt;
    problem_.linearize(f);
  }
  switch (solution_.damping.stage()) {
    case Damping::Stage::none:
      report.relinearized_factors += problem_.live_factors();
      return Stage::order;
    case Damping::Stage::tried:
      return judge(report);
    case Damping::Stage::begun:
      solution_.before = problem_.cost();
      return Stage::order;
    case Damping::Stage::last:
      break;
  }
  return Stage::order;
}

/// A step has raised chi2, or H is not positive definite: back to the estimate from before, and on
/// from there with an optimizer that never raises chi2. With a limit of time this is done here, by
/// Levenberg-Marquardt, since it has to be done in pieces.
Engine::Stage Engine::diverged(UpdateReport& report) {
  step_back();
  const int factors = std::max(solution_.factors, problem_.live_factors());
  end();
  if (!pace_.limited()) {
    rescue(report, kConverged);
    return Stage::none;
  }
  solution_.factors = factors;
  solution_.damping.begin();
  prediction_.forget();
  pending_.place(problem_);
  return begin_relinearizing_all();
}

Engine::Stage Engine::not_positive_definite(UpdateReport& report) {
  switch (solution_.damping.stage()) {
    case Damping::Stage::none:
      return diverged(report);
    case Damping::Stage::last:
      broken_ = true;
      return end();
    case Damping::Stage::begun:
    case Damping::Stage::tried:
      break;
  }
  solution_.damping.reject();
  factorization_.begin(problem_.tree, solution_.damping.lambda());
  return Stage::factorize;
}

/// After a damped step, with everything linearised there: whether it is accepted.
Engine::Stage Engine::judge(UpdateReport& report) {
  Damping& damping = solution_.damping;
  ++report.iterations;
  ++solution_.rounds;
  const double cost = problem_.cost(), gain = solution_.before - cost;
  const double rounding = problem_.rounding();
  Stage next = Stage::order;
  damping.linearized_here();
  if (cost <= solution_.before + rounding) {
    solution_.before = cost;
    prove();
    damping.accept(gain, cost, rounding);
  } else {
    step_back();
    hide_unproven();
    damping.reject();
    next = begin_relinearizing_all();
  }
  if (solution_.rounds >= kMostDampedRounds && damping.stage() != Damping::Stage::last)
    damping.end(false);
  return next;
}

}  // namespace cairn::incremental
