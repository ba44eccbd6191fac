// SPDX-License-Identifier: BSD-3-Clause
#include "descent.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include <fmt/core.h>

#include "cairn/linear/iterative_solver.hpp"
#include "cairn/runtime/timed.hpp"
#include "convergence.hpp"
#include "domain_entry.hpp"

namespace cairn {

namespace {

/// A direct solver's step solves its system to this. Rounding leaves 1e-16 times a small power of
/// the size.
constexpr double kLargestBackwardError = 1e-6;
/// An iterative solver's step lowers its residual at least to this part of the gradient, in the
/// solver's own units and in those of the unknowns. Otherwise the decrease that it predicts is
/// that of as much of the system as the solver has come to, and no sign of a minimum.
constexpr double kLargestResidual = 0.1;
/// Of the forcing terms η = min(kLargestForcing, kForcing ‖g‖²/‖g before‖²).
constexpr double kLargestForcing = 0.05, kForcing = 0.9;
/// A gradient is a sum of products of Jacobians and residuals, and zero up to this share of both.
constexpr double kGradientRounding = 1e-13;
/// What may be left when no step lowers chi2: of chi2, and of the states.
constexpr double kRounding = 1e-6;
/// So many times what rounding of the coordinates makes of chi2 a residual of zero may be.
constexpr double kCancelled = 100.0;
/// What rounding of the coordinates makes of chi2 is worth a note above this.
constexpr double kNoticeable = 1e-3;

/// States that all begin equal show the extent of the map after the first steps.
constexpr int kIterationsForExtent = 2;
/// What is smaller than this part of the largest diagonal entry is no number in another unit but
/// rounding.
constexpr double kUnit = 1e-30;
/// The diagonal of H counts in damping as at least this part of its largest entry of the same unit:
/// far below what measurements differ by, far above rounding.
constexpr double kLeastDiagonal = 1e-12;

/// Where the information of two factors differs by this, H in double precision holds nothing of
/// the smaller one beside the larger one.
constexpr double kLargestSpread = 1e15;

/// The largest of the information of all factors divided by the smallest that is not zero.
double information_spread(const Graph& graph) {
  double least = std::numeric_limits<double>::infinity(), most = 0.0;
  for (int f = 0; f < graph.factor_count(); ++f) {
    const std::span<const double> upper = graph.information(f);
    const int n = graph.factor_type(f).residual_size();
    std::size_t at = 0;  // of the diagonal, in the upper triangle row by row
    for (int k = 0; k < n; at += static_cast<std::size_t>(n - k), ++k) {
      if (!(upper[at] > 0.0)) continue;
      least = std::min(least, upper[at]);
      most = std::max(most, upper[at]);
    }
  }
  return most > 0.0 ? most / least : 1.0;
}

/// The first iteration, and about one in sixteen of those that follow, by multiplicative hashing.
bool is_sampled(int iteration) {
  return iteration == 1 || (static_cast<std::uint32_t>(iteration) * 2654435769U) >> 28U == 0;
}

}  // namespace

double dot(std::span<const double> a, std::span<const double> b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

double norm(std::span<const double> a) { return std::sqrt(dot(a, a)); }

Descent::Descent(std::string optimizer, std::string linear_solver, LinearSolver& solver,
                 Graph& graph, const Stop& stop, Observer& observer)
    : estimate(graph.values()),
      graph_(graph),
      stop_(stop),
      observer_(observer),
      solver_(solver),
      begin_(Clock::now()),
      iteration_begin_(begin_) {
  check(stop);
  summary_.optimizer = std::move(optimizer);
  summary_.linear_solver = std::move(linear_solver);
  summary_.iterations.reserve(static_cast<std::size_t>(std::clamp(stop.max_iterations, 0, 1000)));

  equations_.emplace(graph, solver);
  if (std::string gauge = equations_->gauge().describe(graph); !gauge.empty())
    note(std::move(gauge));
  const bool nothing_to_do = equations_->size() == 0;
  if (nothing_to_do) {
    chi2 = summary_.initial_chi2 = equations_->chi2(estimate);
    note("nothing to optimise: every variable is constant");
    end(Status::converged);
  } else {
    step.resize(static_cast<std::size_t>(equations_->size()));
    trial = estimate;
    chi2 = summary_.initial_chi2 = equations_->linearize(estimate);
    begin_inside();
    if (std::isfinite(chi2)) find_free();
    // Where a residual answers to no small motion, what it measures seems to be free.
    if (!free_.empty() &&
        departures_.depart_at_start(
            graph, equations_->gauge().held, chi2,
            [&](const Values& values) { return equations_->chi2(values); }, estimate)) {
      linearize();
    }
  }
  state_extent_ = cairn::state_extent(graph, equations_->gauge(), estimate);
  best_ = estimate;
  best_chi2_ = chi2;
  for (const std::string& sentence : summary_.notes) observer_.on_message(sentence);
  observer_.on_start(graph, summary_.initial_chi2);
  if (!std::isfinite(chi2)) {
    doubt("chi2 of the initial estimate is not finite");
    end(Status::diverged);
  }
}

/// Begins where all residuals have a meaning, if that lowers chi2.
void Descent::begin_inside() {
  std::string moved = enter_domains(graph_, equations_->gauge().held, trial);
  if (moved.empty()) return;
  if (!(equations_->chi2(trial) < chi2)) {
    trial = estimate;
    return;
  }
  estimate = trial;
  chi2 = equations_->linearize(estimate);
  note(std::move(moved));
}

void Descent::find_free() {
  free_ = find_free_directions(graph_, equations_->gauge(), estimate);
  free_space_ = FreeSpace(graph_, free_, equations_->linearizer(), equations_->diagonal());
}

/// Which directions are free may change with the estimate, where some are.
void Descent::linearize() {
  chi2 = equations_->linearize(estimate);
  if (!free_.empty()) find_free();
}

Factorization Descent::factorize() {
  return free_space_.empty() ? equations_->factorize()
                             : equations_->factorize_pinned(free_space_.pins());
}

bool Descent::begins_anew() {
  if (status_ != Status::converged || exact() || equations_->size() == 0) return false;
  trial = best_;
  if (!departures_.depart(graph_, equations_->gauge().held, best_chi2_, trial)) return false;
  std::swap(estimate, trial);
  linearize();
  if (!std::isfinite(chi2)) return false;
  keep_if_best();
  status_.reset();
  return true;
}

bool Descent::next_iteration() {
  if (ended() || must_stop()) return false;
  if (number_ >= stop_.max_iterations) {
    end(Status::max_iterations);
    return false;
  }
  ++number_;
  iteration_begin_ = Clock::now();
  return true;
}

bool Descent::must_stop() {
  if (ended()) return true;
  if (stop_.interrupt && stop_.interrupt->load(std::memory_order_relaxed)) {
    end(Status::interrupted);
  } else if (stop_.max_seconds > 0.0 && seconds_since(begin_) > stop_.max_seconds) {
    doubt(fmt::format("stopped by the limit of {} s", stop_.max_seconds));
    end(Status::max_iterations);
  }
  return ended();
}

bool Descent::keep_if_best() {
  if (!(chi2 < best_chi2_)) return false;
  best_chi2_ = chi2;
  best_ = estimate;  // same sizes: no allocation
  if (number_ <= kIterationsForExtent)
    state_extent_ =
        std::max(state_extent_, cairn::state_extent(graph_, equations_->gauge(), estimate));
  return true;
}

void Descent::record(double step_norm, double lambda, bool accepted) {
  const Iteration iteration{.number = number_,
                            .chi2 = chi2,
                            .step_norm = step_norm,
                            .lambda = lambda,
                            .accepted = accepted,
                            .seconds = seconds_since(iteration_begin_)};
  summary_.iterations.push_back(iteration);
  if (!observer_.on_iteration(iteration, graph_, best_) && !ended()) end(Status::interrupted);
}

/// An iterative solver's steps need be no better than the model: the less g has shrunk since the
/// step before, the less exact (Eisenstat, Walker 1996, choice 2). Near a minimum they are exact.
void Descent::choose_forcing() {
  auto* iterative = query<IterativeSolver>(solver_);
  if (!iterative || exact()) return;
  const double gradient = norm(equations_->g());
  if (gradient == gradient_) return;  // still at the same estimate
  const double ratio = gradient_ > 0.0 ? gradient / gradient_ : 1.0;
  is_forced_ = iterative->set_forcing(std::min(kLargestForcing, kForcing * ratio * ratio));
  gradient_ = gradient;
}

/// By a step that the forcing term allows, if it does: what lowers the residual of a reduced system
/// may not lower that of the whole.
void Descent::solve_inexactly(std::span<double> out) {
  choose_forcing();
  equations_->solve(out);
  if (!is_forced_) return;
  static_cast<void>(equations_->backward_error(out));
  if (relative_residual() <= kLargestResidual) return;
  query<IterativeSolver>(solver_)->set_forcing(0.0);
  is_forced_ = false;
  equations_->solve(out);
}

bool Descent::solve(std::span<double> out) {
  solve_inexactly(out);
  if (!free_space_.empty()) {
    solution_.assign(out.begin(), out.end());
    free_space_.project(out);
  }
  step_norm_ = norm(out);
  if (!std::isfinite(step_norm_)) return false;
  if (number_ != sampled_ && is_sampled(number_) && !query<IterativeSolver>(solver_)) {
    sampled_ = number_;
    static_cast<void>(is_solution(out));  // chi2 decides whether the step is taken
  }
  return true;
}

bool Descent::is_solution(std::span<const double> out) {
  const double error = equations_->backward_error(free_space_.empty() ? out : solution_);
  if (query<IterativeSolver>(solver_)) {
    const double left = relative_residual();
    if (left <= kLargestResidual || residual_is_rounding()) return true;
    note_wrong_step(fmt::format("{:.1g} of ‖g‖", left));
  } else {
    if (error <= kLargestBackwardError || residual_is_rounding()) return true;
    note_wrong_step(fmt::format("{:.1g} of ‖H‖ ‖x‖ + ‖g‖", error));
  }
  return false;
}

void Descent::note_wrong_step(const std::string& residual) {
  if (std::exchange(reported_wrong_step_, true)) return;
  doubt(
      fmt::format("linear solver {} returned in iteration {} what does not solve H x = g: "
                  "‖Hx − g‖ is {}",
                  summary_.linear_solver, number_, residual));
}

bool Descent::solves(std::span<const double> out) {
  if (is_solution(out)) return true;
  end(Status::diverged);
  return false;
}

double Descent::relative_residual() const {
  const std::span<const double> residual = equations_->solve_residual(), g = equations_->g();
  double largest = 0.0;  // squares of numbers as small as an information of 1e-200 would vanish
  for (const double value : g) largest = std::max(largest, std::abs(value));
  if (!(largest > 0.0)) return std::ranges::any_of(residual, [](double r) { return r != 0.0; });
  double left = 0.0, all = 0.0, scaled_left = 0.0, scaled_all = 0.0;
  for (std::size_t k = 0; k < g.size(); ++k) {
    const double entry = equations_->diagonal()[k], weight = entry > 0.0 ? largest / entry : 0.0;
    const double r = residual[k] / largest, right = g[k] / largest;
    left += r * r;
    all += right * right;
    scaled_left += weight * r * r;
    scaled_all += weight * right * right;
  }
  const double plain = left / all, scaled = scaled_left / scaled_all;
  return std::sqrt(std::isnan(plain) || scaled > plain ? scaled : plain);
}

bool Descent::residual_is_rounding() const {
  const std::span<const double> residual = equations_->solve_residual();
  const double residuals = std::sqrt(chi2);
  for (std::size_t k = 0; k < residual.size(); ++k) {
    if (!(residual[k] <= kGradientRounding * std::sqrt(equations_->diagonal()[k]) * residuals))
      return false;
  }
  return true;
}

std::vector<double> Descent::min_diagonal() const {
  const BlockStructure& s = equations_->linearizer().structure();
  const std::span<const double> diagonal = equations_->diagonal();
  std::vector<std::vector<double>> largest(graph_.variable_pools().size());
  const auto pool_of = [&](int block) {
    return static_cast<std::size_t>(graph_.pool(equations_->linearizer().variable_of(block)));
  };
  double of_all = 0.0;
  for (int block = 0; block < s.blocks(); ++block) {
    std::vector<double>& of_pool = largest[pool_of(block)];
    of_pool.resize(static_cast<std::size_t>(s.block_size(block)));
    for (std::size_t k = 0; k < of_pool.size(); ++k) {
      of_pool[k] = std::max(of_pool[k], diagonal[s.offsets()[block] + k]);
      of_all = std::max(of_all, of_pool[k]);
    }
  }
  std::vector<double> least(diagonal.size(), kLeastDiagonal * (of_all > 0.0 ? of_all : 1.0));
  for (int block = 0; block < s.blocks(); ++block) {
    const std::vector<double>& of_pool = largest[pool_of(block)];
    for (std::size_t k = 0; k < of_pool.size(); ++k) {
      if (of_pool[k] > kUnit * of_all) least[s.offsets()[block] + k] = kLeastDiagonal * of_pool[k];
    }
  }
  return least;
}

void Descent::end_not_finite() {
  doubt(fmt::format("linear solver {} returned a step that is not finite", summary_.linear_solver));
  end(Status::diverged);
}

double Descent::coordinate_rounding() const {
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  const Linearizer& linearizer = equations_->linearizer();
  const BlockStructure& structure = linearizer.structure();
  const double* information = equations_->diagonal().data();
  double sum = 0.0;
  for (int block = 0; block < structure.blocks(); ++block) {
    const int variable = linearizer.variable_of(block);
    const VariableType& type = graph_.type(variable);
    const double* x = estimate.pools[static_cast<std::size_t>(graph_.pool(variable))].data() +
                      std::int64_t{graph_.slot(variable)} * type.ambient_size();
    // Positions come first in the tangent space, and what else a pose has is of the size of one.
    std::array<double, 9> R{};
    std::array<double, 3> t{};
    int positions = type.tangent_size();
    double largest = 0.0;
    if (const Placement* placement = type.placement()) {
      placement->split(x, R.data(), t.data());
      positions = placement->dimension();
      for (const double number : t) largest = std::max(largest, std::abs(number));
    } else {
      for (int k = 0; k < type.ambient_size(); ++k) largest = std::max(largest, std::abs(x[k]));
    }
    for (int k = 0; k < structure.block_size(block); ++k) {
      const double rounding = kEpsilon * (k < positions ? largest : 1.0);
      sum += *information++ * rounding * rounding;
    }
  }
  return sum / 12.0;  // the variance of what is spread evenly over one unit
}

void Descent::end_converged(bool is_damped) {
  const double spread = is_damped ? information_spread(graph_) : 1.0;
  if (spread <= kLargestSpread) {
    end(Status::converged);
    return;
  }
  doubt(
      fmt::format("the information of the factors differs by a factor of {:.1g}, and of the "
                  "smallest H has no digit left in double precision: that no step lowers chi2 is "
                  "no sign of a minimum; linear solver spqr works without H",
                  spread));
  end(Status::not_positive_definite);
}

void Descent::end_without_descent(double promise, double step_norm, bool is_damped) {
  if (promise <= std::max(kRounding * chi2, coordinate_rounding()) ||
      step_norm <= kRounding * state_extent_) {
    end_converged(is_damped);
    return;
  }
  doubt(
      fmt::format("no step lowers chi2, though the model predicts a decrease of {:.3g}: a Jacobian "
                  "does not fit its residual, or a residual is not continuous or not finite nearby",
                  promise));
  end(Status::diverged);
}

void Descent::end_not_positive_definite(const Factorization& failure) {
  doubt(equations_->explain(failure));
  end(Status::not_positive_definite);
}

bool Descent::fits_exactly(double step_norm) const {
  return !exact() && Convergence::negligible(step_norm, state_extent_) &&
         chi2 <= coordinate_rounding();
}

void Descent::end_undetermined() {
  const int variable = free_.directions.front().moves.front().variable;
  end_not_positive_definite(
      {.ok = false, .failed_block = equations_->linearizer().block_of(variable)});
}

Summary Descent::finish() {
  if (is_forced_) query<IterativeSolver>(solver_)->set_forcing(0.0);
  summary_.status = status_.value_or(Status::max_iterations);
  std::string departed = departures_.conclude(graph_, best_chi2_, chi2, summary_.status);
  if (!departed.empty()) note(std::move(departed));
  summary_.final_chi2 = best_chi2_;
  if (summary_.status == Status::converged &&
      chi2 > best_chi2_ * (1.0 + kRounding) + kCancelled * coordinate_rounding()) {
    note(fmt::format("converged at chi2 {:.9g}; kept a better estimate of an earlier iteration",
                     chi2));
  }
  if (summary_.status == Status::converged && equations_->size() > 0) {
    const double rounding = coordinate_rounding();
    if (rounding > std::max(kRounding * best_chi2_, kNoticeable)) {
      doubt(
          fmt::format("the coordinates are so large that their rounding alone makes chi2 uncertain "
                      "by {:.1g}: an origin nearer to the map keeps more digits",
                      rounding));
    }
  }
  summary_.solver = solver_.stats();
  graph_.set_values(std::move(best_));
  if (std::isfinite(best_chi2_) && equations_->size() > 0) {
    if (!free_.everywhere)
      free_ = find_free_directions(graph_, equations_->gauge(), graph_.values());
    if (summary_.status == Status::converged && !free_.finite) {
      doubt("the Jacobian of a factor is not finite at the estimate");
      summary_.status = Status::diverged;
    }
    std::string sentence = free_.describe(graph_);
    const auto has_it = [&](const std::string& note) {
      return note.find(sentence) != std::string::npos;
    };
    if (!sentence.empty() && std::ranges::none_of(summary_.notes, has_it))
      note(std::move(sentence));
  }
  const double total = seconds_since(begin_);
  summary_.seconds = equations_->seconds();
  summary_.seconds.total = total;
  return std::move(summary_);
}

}  // namespace cairn
