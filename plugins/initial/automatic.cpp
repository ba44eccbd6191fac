// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include <fmt/core.h>
#include <boost/math/distributions/chi_squared.hpp>

#include "cairn/evaluation/plausibility.hpp"
#include "cairn/evaluation/second_look.hpp"
#include "cairn/evaluation/watched_guess.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/update/rejected_factors.hpp"
#include "guesses.hpp"
#include "other_minima.hpp"
#include "placing.hpp"
#include "trial_losses.hpp"

namespace cairn::initial {
namespace {

/// Where no pose disagrees by a larger angle, neither with a relative measurement nor with all of
/// them on the way to it, no loop closure is off by the half of a turn that divides minima: no
/// other start ends elsewhere, and most take more time. (States that are all alike disagree with no
/// single measurement by much.) [rad]
constexpr double kAgreement = 0.5;

bool is_of_relative_poses_alone(const Graph& graph) {
  return std::ranges::all_of(graph.factor_pools(), [](const FactorPool& pool) {
    return pool.size() == 0 || pool.type->is_relative();
  });
}

/// Ends an optimisation as soon as this is true of an iteration.
class Until final : public Observer {
 public:
  using Enough = std::function<bool(const Iteration&)>;
  explicit Until(Enough enough) : enough_(std::move(enough)) {}
  bool on_iteration(const Iteration& iteration, const Graph&, const Values&) override {
    return !enough_(iteration);
  }

 private:
  Enough enough_;
};

/// The best start of several by its chi2.
///
/// States whose angles agree with all relative measurements are a start as they are: nothing else
/// is tried.
///
/// The chordal relaxation takes two linear solves. If its chi2 is below that of the states as
/// given, it is the better start. If not, these may be optimised already, perhaps in a local
/// minimum: a few iterations from both decide, and where these speak for the start whose chi2 is
/// higher, the minima to which both lead. Where chi2 of the better start is not plausible, not
/// even after some iterations from it, the slow and thorough incremental estimate is compared too.
///
/// A bounded loss leaves dead reckoning, which contradicts loop closures alone, a chi2 that is
/// hardly higher than that of the right estimate. Starts are then chosen by a loss that grows, and
/// the loss is tightened from there.
///
/// How the optimisation went that follows tells more (`look_again`): where poses disagree with
/// measurements by a large angle, or by some angle and chi2 fell by far or, in a small graph, is
/// not what the information says, where chi2 is larger than chance allows, or where a loss is
/// bounded or rejects measurements, other minima are looked for.
class Automatic final : public InitialGuess, public WatchedGuess, public SecondLook {
 public:
  Automatic(int iterations, Candidates candidates)
      : stop_{.max_iterations = iterations}, candidates_(std::move(candidates)) {}

  void watch(GoOn go_on) override {
    go_on_ = go_on;
    if (!candidates_.incremental) return;
    if (auto* incremental = query<WatchedGuess>(*candidates_.incremental))
      incremental->watch(std::move(go_on));
  }
  void* ability(std::string_view name) override {
    if (name == WatchedGuess::kAbility) return static_cast<WatchedGuess*>(this);
    return name == SecondLook::kAbility ? static_cast<SecondLook*>(this) : nullptr;
  }

  std::vector<std::string> compute(Graph& graph) override {
    wanted_ = true;
    given_ = graph.values();
    std::vector<std::string> notes;
    if (has_bounded_losses(graph) && candidates_.optimizer) {
      const KeptLosses losses(graph);
      notes = choose_by_a_loss_that_grows(graph, losses);
    } else {
      notes = choose(graph);
    }
    if (!wanted_) notes.push_back("interrupted: not all starts were tried");
    if (graph.variable_count() <= kMostVariables) chosen_ = graph.values();
    return notes;
  }

  Result look_again(Graph& graph, const Summary& summary) override {
    wanted_ = true;
    const std::string reason = reason_to_look_again(graph, summary);
    if (reason.empty()) return {};
    if (!other_ && candidates_.make_other) other_ = candidates_.make_other();
    const std::vector<NamedStart> starts = {
        {"as_given", [&](Graph& of) { of.set_values(given_); }},
        {"spanning_tree", [&](Graph& of) { make_spanning_tree({})->compute(of); }},
        {"spanning_tree by information",
         [&](Graph& of) { make_spanning_tree({.weight = TreeWeight::information})->compute(of); }},
        {"its own start", [&](Graph& of) { of.set_values(chosen_); }},
        {"incremental", [&](Graph& of) { small_steps(of); }, 75}};
    const OtherMinima found =
        search_other_minima(graph, starts, {candidates_.optimizer.get(), other_.get()},
                            [&](double part) { return wanted("other starts", part); });
    return {.lower = !found.found_by.empty(),
            .notes = in_words(found, reason),
            .doubt = doubt(found, graph)};
  }

 private:
  struct Start {
    std::string_view name;
    double chi2 = 0.0;
    Values states;
    std::vector<std::string> notes;
    /// After a trial: how many iterations, and what they reached.
    int iterations = 0;
    double reached = 0.0;

    /// "chordal (chi2 31.2)", "as_given (chi2 31.2, after 5 iterations 7.1)"
    std::string in_words() const {
      const std::string trial =
          iterations > 0 ? fmt::format(", after {} {:.4g}",
                                       counted(iterations, "iteration", "iterations"), reached)
                         : "";
      return fmt::format("{} (chi2 {:.4g}{})", name, chi2, trial);
    }
  };

  // The start ------------------------------------------------------------------------------------

  std::vector<std::string> choose(Graph& graph) {
    rejected_.clear();
    agreed_ = false;
    Start best{"as_given", chi2(graph), graph.values(), {}};
    if (!can_place(graph)) return {};
    if (is_of_relative_poses_alone(graph)) {
      const double turn = largest_turn(graph);
      if (turn <= kAgreement && largest_drift(graph) <= kAgreement) {
        agreed_ = true;
        return {fmt::format("{}: no measurement disagrees with its angles by more than {:.2g} rad",
                            best.in_words(), turn)};
      }
    }
    if (std::optional<Start> chordal = compute("chordal", candidates_.chordal.get(), graph))
      keep_better(best, std::move(*chordal), graph);
    const std::int64_t dof = degrees_of_freedom(graph, resolve_gauge(graph));
    if (!is_plausible(best.chi2, dof) && candidates_.optimizer) {
      try_out(best, stop_, graph,
              [&](const Iteration& iteration) { return is_plausible(iteration.chi2, dof); });
      std::optional<Start> slow;
      if (!is_plausible(best.reached, dof))
        slow = compute("incremental", candidates_.incremental.get(), graph);
      if (slow) replace_if(!(best.reached <= slow->chi2), best, std::move(*slow));
    }
    graph.set_values(std::move(best.states));
    std::vector<std::string> notes;
    if (!rejected_.empty()) notes.push_back(best.in_words() + "; not " + rejected_);
    for (std::string& note : best.notes) notes.push_back(std::move(note));
    return notes;
  }

  /// Whether a factor can say where a variable is. Of cameras that see points alone, as in bundle
  /// adjustment, none can: they are where they are given, and no start differs from that.
  static bool can_place(const Graph& graph) {
    return std::ranges::any_of(graph.factor_pools(), [&](const FactorPool& pool) {
      const std::size_t looked_at = std::min(pool.size(), kLookedAt);
      return std::ranges::any_of(pool.sequence.begin(), pool.sequence.begin() + looked_at,
                                 [&](int factor) { return can_place(graph, factor); });
    });
  }
  static bool can_place(const Graph& graph, int factor) {
    const FactorType& type = graph.factor_type(factor);
    std::vector<const double*> x;
    for (const std::int32_t v : graph.factor_variables(factor)) x.push_back(graph.state(v).data());
    for (int target = 0; target < type.arity(); ++target) {
      std::vector<double> state(static_cast<std::size_t>(type.ambient_size(target)));
      if (type.propagate(target, x.data(), graph.measurement(factor).data(), state.data()))
        return true;
    }
    return false;
  }

  /// By a Cauchy loss in the place of each bounded one, whose scale is then tightened.
  std::vector<std::string> choose_by_a_loss_that_grows(Graph& graph, const KeptLosses& losses) {
    set_instead_of_bounded(graph, losses, [](const auto&) { return make_cauchy(); });
    std::vector<std::string> notes = choose(graph);
    optimise(kToAMinimum, graph);
    for (const double k : {4.0, 2.0}) {
      set_instead_of_bounded(graph, losses, [k](const auto& own) { return make_wider(own, k); });
      optimise(kOnTheWay, graph);
    }
    if (!notes.empty()) notes.front() += ", by a cauchy loss that was tightened to the bounded one";
    return notes;
  }

  void optimise(const Stop& stop, Graph& graph) {
    Until observer([&](const Iteration&) { return !wanted("robust loss", 0.5); });
    if (wanted_) candidates_.optimizer->optimize(graph, stop, observer);
  }

  void reject(std::string_view start) {
    rejected_ += fmt::format("{}{}", rejected_.empty() ? "" : ", ", start);
  }

  void replace_if(bool better, Start& best, Start other) {
    if (better) std::swap(best, other);
    reject(other.in_words());
  }

  /// Empty where there is no such guess, or it cannot be computed, or chi2 there is not finite.
  std::optional<Start> compute(std::string_view name, InitialGuess* guess, Graph& graph) {
    graph.set_values(given_);
    if (!guess || !wanted(name, 0.0)) return std::nullopt;
    try {
      std::vector<std::string> notes = guess->compute(graph);
      static_cast<void>(wanted(name, 1.0));
      Start start{name, chi2(graph), graph.values(), std::move(notes)};
      if (std::isfinite(start.chi2)) return start;
      reject(start.in_words());
    } catch (const Error& error) {
      if (error.code() != ErrorCode::input && error.code() != ErrorCode::numerical) throw;
      reject(fmt::format("{} ({})", name, error.what()));
    }
    return std::nullopt;
  }

  /// Of the best start so far and another one, that from which a lower chi2 is reached. One per
  /// thousand is no difference.
  void keep_better(Start& best, Start other, Graph& graph) {
    if (!(best.chi2 <= other.chi2)) return replace_if(true, best, std::move(other));
    if (candidates_.optimizer && other.states.pools != best.states.pools) {
      const auto never = [](const Iteration&) { return false; };
      // Minima are compared where the start whose chi2 is lower seems to fall behind.
      for (const int iterations : {kFewIterations, kToAMinimum.max_iterations}) {
        const Stop stop{.max_iterations = iterations, .tolerance = kToAMinimum.tolerance};
        try_out(best, stop, graph, never);
        try_out(other, stop, graph, never);
        if (!(other.reached < 0.999 * best.reached) || !wanted_) break;
      }
    }
    const bool better = other.iterations > 0 && other.reached < 0.999 * best.reached && wanted_;
    replace_if(better, best, std::move(other));
  }

  /// Notes what some iterations from `start` reach, until one of them is enough.
  void try_out(Start& start, const Stop& stop, Graph& graph, const Until::Enough& enough) {
    graph.set_values(start.states);
    Until observer([&](const Iteration& iteration) {
      return enough(iteration) ||
             !wanted(start.name, static_cast<double>(iteration.number) / stop.max_iterations);
    });
    const Summary summary = candidates_.optimizer->optimize(graph, stop, observer);
    start.reached = summary.final_chi2;
    start.iterations = static_cast<int>(summary.iterations.size());
  }

  // The second look ------------------------------------------------------------------------------

  std::string reason_to_look_again(const Graph& graph, const Summary& summary) const {
    if (!candidates_.optimizer || graph.variable_count() > kMostVariables || !can_place(graph))
      return {};
    const double fall = summary.initial_chi2 / summary.final_chi2;
    if (!(fall < kToNothing)) return {};  // an exact solution: none is lower
    if (has_bounded_losses(graph)) return "since the loss is bounded";
    // Where measurements are wrong, minima are many, and none is the right one: that is said.
    const std::int64_t dof = degrees_of_freedom(graph, resolve_gauge(graph));
    if (!is_plausible(summary.final_chi2, dof)) return {};
    if (rejects(graph)) return "since losses reject measurements";
    const double ratio = summary.final_chi2 / static_cast<double>(dof);
    const double chance = graph.has_losses() ? 0.5 : chance_of_more(summary.final_chi2, dof);
    if (chance < kChance)
      return fmt::format("since chi2 is {:.3g} times the {} degrees of freedom", ratio, dof);
    const double angle = largest_turn(graph);
    const bool few = few_that_disagree(graph, angle);
    // Where chi2 says that information is of another scale, it says nothing of measurements.
    if (few && std::min(chance, 1.0 - chance) < kUnusual) {
      return fmt::format(
          "since poses disagree with a measurement by {:.2g} rad, and chi2 is {:.3g} times the {} "
          "degrees of freedom",
          angle, ratio, dof);
    }
    if (!agreed_ && fall > kLargeFall && angle > kSmallAngle)
      return fmt::format("since chi2 fell {:.3g} times from the start", fall);
    // Where loop closures are few, chi2 is plausible in many minima.
    if (few && static_cast<double>(dof) < kFewLoops * graph.variable_count()) {
      return fmt::format(
          "since poses disagree with a measurement by {:.2g} rad, and loop closures are few",
          angle);
    }
    if (!(angle > kLargeAngle)) return {};
    return fmt::format("since poses disagree with a measurement by {:.2g} rad", angle);
  }

  static bool rejects(const Graph& graph) {
    const RejectedFactors rejected = rejected_factors(graph);
    return rejected.rejected_loops + rejected.rejected_others > 0;
  }

  /// How likely right measurements with the right information lead to a larger chi2: it is χ² at
  /// the minimum. Without degrees of freedom chi2 says nothing.
  static double chance_of_more(double chi2, std::int64_t dof) {
    if (dof <= 0) return 0.5;
    const boost::math::chi_squared distribution(static_cast<double>(dof));
    return boost::math::cdf(boost::math::complement(distribution, chi2));
  }

  void small_steps(Graph& graph) {
    if (!candidates_.small_steps) throw Error(ErrorCode::input, "there is no such guess");
    candidates_.small_steps->compute(graph);
  }

  static std::vector<std::string> in_words(const OtherMinima& found, const std::string& reason) {
    std::vector<std::string> notes;
    if (!found.found_by.empty()) {
      notes.push_back(
          fmt::format("looked for other minima, {}: {} leads to chi2 {:.6g} instead of {:.6g}",
                      reason, found.found_by, found.chi2, found.before));
    }
    return notes;
  }

  static std::string doubt(const OtherMinima& found, const Graph& graph) {
    if (found.until_the_end) {
      return fmt::format(
          "{} of {} starts ended in other minima, and lower ones were found until the end: there "
          "may be a lower one than chi2 {:.6g}",
          found.elsewhere, found.starts, found.chi2);
    }
    if (found.many_nearly_as_low()) {
      return fmt::format(
          "chi2 has many minima: {} of {} starts ended in this one, and {} others are within 5 % "
          "of it: there may be a lower one than chi2 {:.6g}",
          found.in_the_lowest, found.starts, found.nearly_as_low, found.chi2);
    }
    return contradiction(found, graph);
  }

  /// Where measurements contradict each other beyond chance, which of them give way, and so which
  /// minimum is met, depends on the start.
  static std::string contradiction(const OtherMinima& found, const Graph& graph) {
    const std::int64_t dof = degrees_of_freedom(graph, resolve_gauge(graph));
    if (graph.has_losses() || found.elsewhere == 0 || !(chance_of_more(found.chi2, dof) < kChance))
      return {};
    const double ratio = found.chi2 / static_cast<double>(dof);
    if (!(ratio > kContradiction)) return {};
    return fmt::format(
        "measurements contradict each other, or their information is too large: chi2 is {:.3g} "
        "times the {} degrees of freedom, and {} of {} starts ended in other minima than that of "
        "chi2 {:.6g}",
        ratio, dof, found.elsewhere, found.starts, found.chi2);
  }

  /// Whether to go on; once it is not, it never is.
  bool wanted(std::string_view what, double part) {
    return wanted_ = wanted_ && (!go_on_ || go_on_(what, part));
  }

  static constexpr std::size_t kLookedAt = 16;  // of the factors of a type
  static constexpr int kFewIterations = 5;
  static constexpr Stop kToAMinimum{.max_iterations = 100, .tolerance = 1e-6};
  static constexpr Stop kOnTheWay{.max_iterations = 30, .tolerance = 1e-4};
  // Other minima differ by turns: where no residual turns far, chi2 is nearly convex. Where they
  // turn a little, a start near the minimum is another sign that all is well.
  static constexpr double kLargeFall = 2.5;
  static constexpr double kSmallAngle = 0.1, kLargeAngle = 0.9;  // [rad]
  static constexpr double kToNothing = 1e10;
  static constexpr double kChance = 1e-4, kUnusual = 1e-2;  // of χ²
  static constexpr double kFewLoops = 2.0;                  // degrees of freedom per variable
  static constexpr double kContradiction = 5.0;             // chi2 per degree of freedom

  Stop stop_;
  Candidates candidates_;
  std::unique_ptr<Optimizer> other_;  ///< once a search has needed it
  Values given_, chosen_;
  std::string rejected_;  // starts, with the numbers that decided
  GoOn go_on_;
  bool wanted_ = true;
  bool agreed_ = false;  ///< the given states with all angles
};

}  // namespace

std::unique_ptr<InitialGuess> make_automatic(const AutomaticOptions& options,
                                             Candidates candidates) {
  return std::make_unique<Automatic>(options.iterations, std::move(candidates));
}

}  // namespace cairn::initial
