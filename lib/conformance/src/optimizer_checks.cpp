// SPDX-License-Identifier: BSD-3-Clause
// What optimizers do on small graphs, against Gauss-Newton with dense algebra: the minimum, how
// they stop, and how they report what has none.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "cairn/conformance/checker.hpp"
#include "cairn/conformance/repetition.hpp"
#include "cairn/conformance/sample_graph.hpp"
#include "cairn/conformance/samples.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/lie/point.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/types/define_factor.hpp"
#include "cairn/types/define_variable.hpp"
#include "own_checks.hpp"

namespace cairn::conformance {
namespace {

constexpr int kPoses = 40;
constexpr double kMinimum = 1e-4;  // share of chi2 by which an optimizer may end above the minimum

// Graphs ------------------------------------------------------------------------------------------

/// Two laps with a robust loss on the factors that close loops, one of which is wrong by metres.
Graph with_outlier(std::uint64_t seed) {
  Graph graph = two_laps(kPoses, seed);
  const std::shared_ptr<const Loss> loss = own_loss();
  int last = 0;
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto ends = graph.factor_variables(f);
    if (std::abs(ends[1] - ends[0]) < 2) continue;
    graph.set_loss(f, loss);
    last = f;
  }
  std::vector<double> z(graph.measurement(last).begin(), graph.measurement(last).end());
  z[0] += 3.0;
  graph.set_measurement(last, z);
  return graph;
}

/// r = (ln x − z, y): not a number for x < 0, where a whole Gauss-Newton step from x > e · exp(z)
/// leads. The minimum is at x = exp(z), y = 0, with chi2 = 0.
struct LogarithmOfX {
  static constexpr std::string_view kTag = "CONFORMANCE_LOGARITHM";
  static constexpr int kResidual = 2, kMeasurement = 1;
  using Variables = std::tuple<PointXY>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 2>& x, const Vector<double, 1>& z) {
    using std::log;
    return {log(x[0]) - z[0], x[1]};
  }
};

Graph logarithm_at(double x) {
  Graph graph;
  const std::vector<double> start{x, 1.0}, z{0.0}, information{1.0, 0.0, 1.0};
  graph.add_variable(define_variable<PointXY>(), 0, start);
  graph.add_factor(define_factor<LogarithmOfX>(), std::vector{0}, z, information);
  return graph;
}

// Minimum -----------------------------------------------------------------------------------------

/// What holds however a run has ended.
void check_outcome(const Graph& graph, double before, const Summary& summary, double least,
                   Checker& check) {
  const double after = chi2(graph);
  check.expect(all_finite(graph), "the states are finite",
               [] { return std::string("one is not"); });
  check.expect(!(after > before), "chi2 is not above that of the states given",
               [&] { return fmt::format("{} from {}", after, before); });
  check.expect(summary.status != Status::converged || after <= least * (1.0 + kMinimum) + 1e-9,
               "what has converged is at a minimum", [&] {
                 return fmt::format(
                     "chi2 {} after {} iterations, where dense Gauss-Newton reaches {}", after,
                     summary.iterations.size(), least);
               });
  check.expect(std::abs(summary.final_chi2 - after) <= 1e-9 * (1.0 + after),
               "final_chi2 is that of the states left in the graph",
               [&] { return fmt::format("{} and {}", summary.final_chi2, after); });
  check.expect(std::abs(summary.initial_chi2 - before) <= 1e-9 * (1.0 + before),
               "initial_chi2 is that of the states given",
               [&] { return fmt::format("{} and {}", summary.initial_chi2, before); });
}

void find_minimum(Graph graph, const std::string& input, const Subject& subject, Checker& check) {
  Graph reference = graph.clone();
  check.sample(input, [&] {
    const double least = minimize_densely(reference);
    const auto optimizer = made<Optimizer>(subject, check);
    const double before = chi2(graph);
    const Graph original = graph.clone();
    const Summary summary = check.call(
        "optimize", [&] { return optimizer->optimize(graph, {.max_iterations = 2000}); });
    // With other options than the defaults it may be slow, as steepest descent is, if it says so.
    const bool must_arrive = check.of_defaults() || summary.status == Status::converged;
    check.expect(!must_arrive || chi2(graph) <= least * (1.0 + kMinimum),
                 "chi2 reaches the minimum", [&] {
                   return fmt::format("{} ({}), where dense Gauss-Newton reaches {}", chi2(graph),
                                      to_string(summary.status), least);
                 });
    check_outcome(graph, before, summary, least, check);
    check.expect(graph.variable_count() == original.variable_count() &&
                     graph.factor_count() == original.factor_count(),
                 "the graph keeps its variables and factors",
                 [] { return std::string("it does not"); });
    for (int v = 0; v < original.variable_count(); ++v) {
      if (!original.fixed(v)) continue;
      check.expect(graph.fixed(v) && std::ranges::equal(original.state(v), graph.state(v)),
                   "a fixed variable stays",
                   [&] { return "it moved to " + text_of(graph.state(v)); });
    }
    // The same object on a graph of another structure and back: nothing is left of the one before.
    Graph other = two_laps(8, check.options().seed), again = original.clone();
    check.call("optimize", [&] { return optimizer->optimize(other, {.max_iterations = 5}); });
    check.call("optimize", [&] { return optimizer->optimize(again, {.max_iterations = 2000}); });
    check.expect(!must_arrive || chi2(again) <= least * (1.0 + kMinimum),
                 "an optimizer may be used again",
                 [&] { return fmt::format("chi2 {} instead of {}", chi2(again), least); });
  });
}

void check_minimum(const Subject& subject, Checker& check) {
  for (std::uint64_t k = 0; k < 2; ++k) {
    Graph graph = two_laps(kPoses, check.options().seed + k);
    const std::string input = described(graph);
    find_minimum(std::move(graph), input, subject, check);
  }
  Graph fixed = two_laps(kPoses, check.options().seed + 2);
  fixed.set_fixed(3);
  const std::string input = described(fixed);
  find_minimum(std::move(fixed), input + ", pose 3 fixed", subject, check);
  find_minimum(with_outlier(check.options().seed),
               input + ", a robust loss and a wrong loop closure", subject, check);
  // Nothing is free.
  Graph held = two_laps(4, check.options().seed);
  for (int v = 0; v < held.variable_count(); ++v) held.set_fixed(v);
  check.sample(described(held) + ", all fixed", [&] {
    const std::vector<double> states = states_of(held);
    const double before = chi2(held);
    const auto optimizer = made<Optimizer>(subject, check);
    const Summary summary = check.call("optimize", [&] { return optimizer->optimize(held); });
    check.expect(states_of(held) == states, "a fixed variable stays",
                 [] { return std::string("it moved"); });
    check.expect(std::abs(summary.final_chi2 - before) <= 1e-9 * (1.0 + before),
                 "final_chi2 is that of the states left in the graph",
                 [&] { return fmt::format("{} and {}", summary.final_chi2, before); });
  });
}

// Stopping ----------------------------------------------------------------------------------------

/// Ends the run after so many iterations, by its answer or by the flag.
class Ending final : public Observer {
 public:
  explicit Ending(int after, std::atomic<bool>* flag = nullptr) : after_(after), flag_(flag) {}
  bool on_iteration(const Iteration&, const Graph&, const Values&) override {
    if (++seen < after_) return true;
    if (!flag_) return false;
    *flag_ = true;
    return true;
  }
  int seen = 0;

 private:
  int after_;
  std::atomic<bool>* flag_;
};

class Stopping {
 public:
  Stopping(const Subject& subject, Checker& check)
      : subject_(subject), check_(check), graph_(two_laps(kPoses, check.options().seed)) {
    Graph reference = graph_.clone();
    least_ = minimize_densely(reference);
  }

  /// Runs with these limits, and checks what holds of every outcome.
  template <class Body>
  void with(const std::string& input, const Stop& stop, Observer& observer, const Body& body) {
    check_.sample(described(graph_) + ", " + input, [&] {
      Graph copy = graph_.clone();
      const double before = chi2(copy);
      const auto optimizer = made<Optimizer>(subject_, check_);
      const Summary summary =
          check_.call("optimize", [&] { return optimizer->optimize(copy, stop, observer); });
      check_outcome(copy, before, summary, least_, check_);
      body(summary, copy);
    });
  }
  const Graph& graph() const { return graph_; }

 private:
  const Subject& subject_;
  Checker& check_;
  Graph graph_;
  double least_ = 0.0;
};

std::string ended(const Summary& summary) {
  return fmt::format("it ended as {} after {} iterations", to_string(summary.status),
                     summary.iterations.size());
}

void check_stopping(const Subject& subject, Checker& check) {
  Stopping stopping(subject, check);
  Observer nobody;
  for (const int limit : {0, 1, 2}) {
    stopping.with(fmt::format("max_iterations = {}", limit), {.max_iterations = limit}, nobody,
                  [&](const Summary& summary, const Graph& graph) {
                    check.expect(std::ssize(summary.iterations) <= limit,
                                 "max_iterations is a limit", [&] { return ended(summary); });
                    if (limit > 0) return;
                    check.expect(states_of(graph) == states_of(stopping.graph()),
                                 "without an iteration the states stay",
                                 [] { return std::string("they changed"); });
                  });
  }
  stopping.with("max_seconds = 1e-9", {.max_iterations = 2000, .max_seconds = 1e-9}, nobody,
                [&](const Summary& summary, const Graph&) {
                  check.expect(summary.iterations.size() <= 1, "max_seconds is a limit",
                               [&] { return ended(summary); });
                });
  std::atomic<bool> interrupt{true};
  const auto is_interrupted = [&](const Summary& summary, int most) {
    check.expect(summary.status == Status::interrupted && std::ssize(summary.iterations) <= most,
                 "an interrupt ends it", [&] { return ended(summary); });
  };
  stopping.with("interrupted before the first iteration",
                {.max_iterations = 2000, .interrupt = &interrupt}, nobody,
                [&](const Summary& summary, const Graph&) { is_interrupted(summary, 0); });
  interrupt = false;
  // With no tolerance it is not at its end after one iteration.
  Ending by_flag(1, &interrupt);
  stopping.with("interrupted after an iteration",
                {.max_iterations = 2000, .tolerance = 0.0, .interrupt = &interrupt}, by_flag,
                [&](const Summary& summary, const Graph&) { is_interrupted(summary, 1); });
  Ending by_answer(1);
  stopping.with("the observer's answer after an iteration is to stop",
                {.max_iterations = 2000, .tolerance = 0.0}, by_answer,
                [&](const Summary& summary, const Graph&) { is_interrupted(summary, 1); });
  Ending counting(std::numeric_limits<int>::max());
  stopping.with("watched", {.max_iterations = 2000}, counting,
                [&](const Summary& summary, const Graph&) {
                  check.expect(counting.seen == std::ssize(summary.iterations),
                               "on_iteration is called after each iteration", [&] {
                                 return fmt::format("{} calls, {} iterations", counting.seen,
                                                    summary.iterations.size());
                               });
                });
  for (const Stop& bad : {Stop{.max_iterations = -1}, Stop{.tolerance = -1.0},
                          Stop{.max_seconds = std::numeric_limits<double>::quiet_NaN()}}) {
    check.sample(fmt::format("max_iterations = {}, tolerance = {}, max_seconds = {}",
                             bad.max_iterations, bad.tolerance, bad.max_seconds),
                 [&] {
                   Graph copy = stopping.graph().clone();
                   const auto optimizer = made<Optimizer>(subject, check);
                   const bool refused = check.call("optimize", [&] {
                     try {
                       optimizer->optimize(copy, bad);
                       return false;
                     } catch (const Error&) {
                       return true;
                     }
                   });
                   check.expect(refused, "limits that are none are refused with an Error",
                                [] { return std::string("it ran (cairn::check(stop) throws)"); });
                 });
  }
}

/// Residuals that are not finite: in the states given, and where a step leads.
void check_not_finite(const Subject& subject, Checker& check) {
  check.sample("r = (ln x, y) at x = -1, where it is not a number", [&] {
    Graph graph = logarithm_at(-1.0);
    const std::vector<double> states = states_of(graph);
    const auto optimizer = made<Optimizer>(subject, check);
    const Summary summary = check.call("optimize", [&] { return optimizer->optimize(graph); });
    check.expect(summary.status != Status::converged, "chi2 that is not finite has not converged",
                 [&] { return ended(summary); });
    check.expect(states_of(graph) == states || std::isfinite(chi2(graph)),
                 "the states stay where nothing better is found",
                 [&] { return "they are " + text_of(states_of(graph)); });
  });
  for (const double x : {2.0, 10.0}) {
    check.sample(fmt::format("r = (ln x, y) from x = {}", x), [&] {
      Graph graph = logarithm_at(x);
      const double before = chi2(graph);
      const auto optimizer = made<Optimizer>(subject, check);
      const Summary summary = check.call(
          "optimize", [&] { return optimizer->optimize(graph, {.max_iterations = 2000}); });
      check_outcome(graph, before, summary, 0.0, check);
    });
  }
}

Repetition optimizer_uses(const Subject& subject, Checker& check) {
  return {"optimize", 4, [&subject, &check](std::uint64_t input) {
            const std::shared_ptr<Optimizer> optimizer = made<Optimizer>(subject, check);
            return [optimizer, seed = check.options().seed + input] {
              Graph graph = two_laps(kPoses, seed);
              const Summary summary = optimizer->optimize(graph, {.max_iterations = 20});
              State result = states_of(graph);
              result.push_back(summary.final_chi2);
              return result;
            };
          }};
}

}  // namespace

std::span<const Group> optimizer_groups() {
  static constexpr std::array<Group, 5> groups{{{"minimum", check_minimum},
                                                {"stopping", check_stopping},
                                                {"numbers that are not finite", check_not_finite},
                                                {"memory", memory_group<optimizer_uses>, true},
                                                {"threads", threads_group<optimizer_uses>, true}}};
  return groups;
}

}  // namespace cairn::conformance
