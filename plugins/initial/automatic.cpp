// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <functional>
#include <optional>
#include <string_view>
#include <utility>

#include <fmt/core.h>

#include "cairn/evaluation/plausibility.hpp"
#include "cairn/evaluation/watched_guess.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/runtime/error.hpp"
#include "guesses.hpp"

namespace cairn::initial {
namespace {

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
/// The chordal relaxation takes two linear solves. If its chi2 is below that of the states as
/// given, it is the better start. If not, these may be optimised already, perhaps in a local
/// minimum: a few iterations from both decide. Where chi2 of the better start is not plausible, not
/// even after some iterations from it, the slow and thorough incremental estimate is compared too.
class Automatic final : public InitialGuess, public WatchedGuess {
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
    return name == WatchedGuess::kAbility ? static_cast<WatchedGuess*>(this) : nullptr;
  }

  std::vector<std::string> compute(Graph& graph) override {
    wanted_ = true;
    given_ = graph.values();
    best_ = {"as_given", chi2(graph), graph.values(), {}};
    tried_ = {best_name()};
    if (std::optional<Start> chordal = compute("chordal", candidates_.chordal.get(), graph)) {
      if (is_better(*chordal, graph)) best_ = std::move(*chordal);
    }
    const std::int64_t dof = degrees_of_freedom(graph, resolve_gauge(graph));
    if (!is_plausible(best_.chi2, dof) && candidates_.optimizer) {
      const double reached = optimized(best_, stop_, graph, [&](const Iteration& iteration) {
        return is_plausible(iteration.chi2, dof);
      });
      std::optional<Start> slow;
      if (!is_plausible(reached, dof))
        slow = compute("incremental", candidates_.incremental.get(), graph);
      if (slow && !(reached <= slow->chi2)) best_ = std::move(*slow);
    }
    graph.set_values(std::move(best_.states));
    std::vector<std::string> notes;
    if (tried_.size() > 1) notes.push_back(best_name() + rejected());
    for (std::string& note : best_.notes) notes.push_back(std::move(note));
    if (!wanted_) notes.push_back("interrupted: not all starts were tried");
    return notes;
  }

 private:
  struct Start {
    std::string_view name;
    double chi2 = 0.0;
    Values states;
    std::vector<std::string> notes;
  };

  std::string best_name() const { return fmt::format("{} (chi2 {:.4g})", best_.name, best_.chi2); }

  /// "; not as_given (chi2 3.1e+07)"
  std::string rejected() const {
    std::string text;
    for (const std::string& start : tried_) {
      if (start != best_name()) text += fmt::format("{} {}", text.empty() ? "; not" : ",", start);
    }
    return text;
  }

  /// Empty where there is no such guess, or it cannot be computed, or chi2 there is not finite.
  std::optional<Start> compute(std::string_view name, InitialGuess* guess, Graph& graph) {
    graph.set_values(given_);
    if (!guess || !wanted(name, 0.0)) return std::nullopt;
    try {
      std::vector<std::string> notes = guess->compute(graph);
      static_cast<void>(wanted(name, 1.0));
      Start start{name, chi2(graph), graph.values(), std::move(notes)};
      tried_.push_back(fmt::format("{} (chi2 {:.4g})", name, start.chi2));
      if (std::isfinite(start.chi2)) return start;
    } catch (const Error& error) {
      if (error.code() != ErrorCode::input && error.code() != ErrorCode::numerical) throw;
      tried_.push_back(fmt::format("{} ({})", name, error.what()));
    }
    return std::nullopt;
  }

  /// Whether `start` leads to a lower chi2 than the best one so far, as far as a few iterations can
  /// tell. One per thousand is no difference.
  bool is_better(const Start& start, Graph& graph) {
    if (!(best_.chi2 <= start.chi2)) return true;
    if (!candidates_.optimizer || start.states.pools == best_.states.pools) return false;
    const Stop few{.max_iterations = kFewIterations};
    const auto never = [](const Iteration&) { return false; };
    const double reached = optimized(best_, few, graph, never);
    return optimized(start, few, graph, never) < 0.999 * reached && wanted_;
  }

  /// chi2 after some iterations from `start`, until one of them is enough.
  double optimized(const Start& start, const Stop& stop, Graph& graph,
                   const Until::Enough& enough) {
    graph.set_values(start.states);
    Until observer([&](const Iteration& iteration) {
      return enough(iteration) ||
             !wanted(start.name, static_cast<double>(iteration.number) / stop.max_iterations);
    });
    return candidates_.optimizer->optimize(graph, stop, observer).final_chi2;
  }

  /// Whether to go on; once it is not, it never is.
  bool wanted(std::string_view what, double part) {
    return wanted_ = wanted_ && (!go_on_ || go_on_(what, part));
  }

  static constexpr int kFewIterations = 5;

  Stop stop_;
  Candidates candidates_;
  Values given_;
  Start best_;
  std::vector<std::string> tried_;
  GoOn go_on_;
  bool wanted_ = true;
};

}  // namespace

std::unique_ptr<InitialGuess> make_automatic(const AutomaticOptions& options,
                                             Candidates candidates) {
  return std::make_unique<Automatic>(options.iterations, std::move(candidates));
}

}  // namespace cairn::initial
