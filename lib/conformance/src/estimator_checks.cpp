// SPDX-License-Identifier: BSD-3-Clause
// What estimators do while a small pose graph grows and changes, against Gauss-Newton with dense
// algebra on the graph as it is then.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/conformance/checker.hpp"
#include "cairn/conformance/repetition.hpp"
#include "cairn/conformance/sample_graph.hpp"
#include "cairn/conformance/samples.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/estimator.hpp"
#include "failure_checks.hpp"
#include "own_checks.hpp"

namespace cairn::conformance {
namespace {

constexpr int kPoses = 40;
constexpr double kFilter =
    0.05;  // share of chi2 and covariances: each factor may be linearised once

/// The same between updates, where a loop closure may have been linearised far off.
constexpr double kOnTheWay = 0.5;

/// The graph in the order of its poses, each with its factors to earlier ones.
std::vector<GraphUpdate> updates_of(const Graph& graph) {
  std::vector<GraphUpdate> updates(static_cast<std::size_t>(graph.variable_count()));
  for (int v = 0; v < graph.variable_count(); ++v) {
    Variable variable = graph.variable(v);
    if (v > 0) variable.state.clear();  // the odometry gives it
    updates[static_cast<std::size_t>(v)].variables.push_back(std::move(variable));
  }
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto ends = graph.factor_variables(f);
    updates[static_cast<std::size_t>(*std::ranges::max_element(ends))].factors.push_back(
        graph.factor(f));
  }
  return updates;
}

/// The estimator after the whole graph.
Made<Estimator> fed(const Subject& subject, const Graph& graph, Checker& check) {
  Made<Estimator> estimator = made<Estimator>(subject, check);
  for (const GraphUpdate& update : updates_of(graph))
    check.call("update", [&] { return estimator->update(update); });
  check.call("update", [&] { return estimator->update({}, {.full = true}); });
  return estimator;
}

/// What an update calls solved is near the minimum, also before the last: what is put off is owed,
/// or has not converged.
void check_on_the_way(const Subject& subject, Checker& check) {
  const Graph graph = two_laps(kPoses, check.options().seed);
  check.sample(described(graph) + ", looked at on the second lap", [&] {
    const auto estimator = made<Estimator>(subject, check);
    const std::vector<GraphUpdate> updates = updates_of(graph);
    Graph so_far;
    for (int k = 0; k < kPoses; ++k) {
      const GraphUpdate& update = updates[static_cast<std::size_t>(k)];
      const UpdateReport report = check.call("update", [&] { return estimator->update(update); });
      so_far.add(graph.variable(k));
      for (const Factor& factor : update.factors) so_far.add(factor);
      if (k <= kPoses / 2 || !report.ok || !report.converged || report.owed > 0) continue;
      const double least = minimize_densely(so_far);
      const double found = check.call("chi2", [&] { return estimator->chi2(); });
      check.describe(fmt::format("{}, after pose {}", described(graph), k));
      check.expect(found <= least * (1.0 + kOnTheWay) + kOnTheWay,
                   "an update that is said to be solved leaves chi2 near the minimum", [&] {
                     return fmt::format("{}, where dense Gauss-Newton reaches {}", found, least);
                   });
    }
  });
}

void check_estimate(const Subject& subject, Checker& check) {
  const Graph graph = two_laps(kPoses, check.options().seed);
  check.sample(described(graph) + ", pose by pose", [&] {
    Graph reference = graph.clone();
    const double least = minimize_densely(reference);
    const auto estimator = fed(subject, graph, check);
    check.expect(estimator->variable_count() == graph.variable_count() &&
                     estimator->factor_count() == graph.factor_count(),
                 "it holds all that was added", [&] {
                   return fmt::format("{} variables and {} factors", estimator->variable_count(),
                                      estimator->factor_count());
                 });
    const double found = check.call("chi2", [&] { return estimator->chi2(); });
    check.expect(found <= least * (1.0 + kFilter) + 1e-9, "chi2 is near the minimum", [&] {
      return fmt::format("{}, where dense Gauss-Newton reaches {}", found, least);
    });
    const Graph own = check.call("graph", [&] { return estimator->graph(); });
    check.expect(std::abs(chi2(own) - found) <= 1e-9 * (1.0 + found),
                 "chi2 is that of the graph that it gives",
                 [&] { return fmt::format("{} and {}", found, chi2(own)); });
    for (int v = 0; v < graph.variable_count(); ++v) {
      const std::span<const double> x =
          check.call("state", [&] { return estimator->state(graph.id(v)); });
      State delta(3);
      reference.type(v).local(1, x.data(), reference.state(v).data(), delta.data());
      check.within(norm(delta), 0.05, "states are near those of the minimum");
    }
  });
}

/// The block of the dense covariance at the minimum of the graph.
class DenseBlocks {
 public:
  explicit DenseBlocks(const Graph& graph) : graph_(graph.clone()) {
    minimize_densely(graph_);
    dense_ = dense_covariance(graph_);
  }
  /// None where one of the two is held.
  std::optional<Eigen::MatrixXd> block(Id a, Id b) const {
    const std::int64_t row = first(a), column = first(b);
    if (row < 0 || column < 0) return {};
    return dense_.Sigma.block(row, column, 3, 3);
  }

 private:
  std::int64_t first(Id id) const {
    return dense_.first[static_cast<std::size_t>(*graph_.find(id))];
  }
  Graph graph_;
  DenseCovariance dense_;
};

void compare_covariances(Estimator& estimator, const DenseBlocks& dense, Id newest,
                         Checker& check) {
  const std::array<std::pair<Id, Id>, 5> pairs{
      {{1, 1}, {newest / 2, newest / 2}, {newest, newest}, {newest / 2, newest}, {newest, 1}}};
  for (const auto& pair : pairs) {
    const Id a = pair.first, b = pair.second;
    Guarded block("block", 9);
    const bool known = check.call("covariance", {&block},
                                  [&] { return estimator.covariance(a, b, block.span()); });
    check.expect(known, "covariance is known",
                 [&] { return fmt::format("not that of poses {} and {}", a, b); });
    const std::optional<Eigen::MatrixXd> expected = dense.block(a, b);
    if (!known || !expected) continue;
    const State values = block.values();
    const Eigen::Map<const Eigen::MatrixXd> found(values.data(), 3, 3);
    // A cross block may be small; what it is relative to is not.
    const double scale = std::sqrt(dense.block(a, a)->norm() * dense.block(b, b)->norm());
    check.within((found - *expected).norm(), kFilter * scale,
                 "covariance is the block of H⁻¹ at the minimum");
  }
}

void check_covariances(const Subject& subject, Checker& check) {
  const Graph graph = two_laps(kPoses, check.options().seed);
  check.sample(described(graph) + ", asked for after half of the poses and at the end", [&] {
    const auto estimator = made<Estimator>(subject, check);
    const std::vector<GraphUpdate> updates = updates_of(graph);
    Graph half;
    for (int k = 0; k < kPoses; ++k) {
      const GraphUpdate& update = updates[static_cast<std::size_t>(k)];
      check.call("update", [&] { return estimator->update(update, {.full = k == kPoses / 2}); });
      if (k > kPoses / 2) continue;
      half.add(graph.variable(k));
      for (const Factor& factor : update.factors) half.add(factor);
      if (k == kPoses / 2) compare_covariances(*estimator, DenseBlocks(half), k, check);
    }
    check.call("update", [&] { return estimator->update({}, {.full = true}); });
    compare_covariances(*estimator, DenseBlocks(graph), kPoses - 1, check);
    // A column is made of blocks.
    const std::array<Id, 2> rows{kPoses - 1, 5};
    Guarded column("out", 18), first("block", 9), second("block", 9);
    const bool known = check.call("covariance_column", {&column}, [&] {
      return estimator->covariance_column(3, rows, column.span()) &&
             estimator->covariance(rows[0], 3, first.span()) &&
             estimator->covariance(rows[1], 3, second.span());
    });
    if (check.expect(known, "covariance_column is known",
                     [] { return std::string("it is not"); })) {
      State expected(18);
      for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t r = 0; r < 3; ++r) {
          expected[6 * c + r] = first.values()[3 * c + r];
          expected[6 * c + 3 + r] = second.values()[3 * c + r];
        }
      }
      check.within(norm(difference(column.values(), expected)), 1e-6 * norm(expected),
                   "covariance_column is made of the blocks of covariance");
    }
    for (const auto& [id, size] : {std::pair<Id, std::size_t>{1000, 9}, {3, 4}}) {
      State block(size);
      const bool refused = check.call("covariance", [&, id = id] {
        try {
          estimator->covariance(id, id, block);
          return false;
        } catch (const Error&) {
          return true;
        }
      });
      check.expect(refused, "covariance refuses unknown ids and wrong sizes with an Error",
                   [&, id = id, size = size] {
                     return fmt::format("it answered for pose {} and {} numbers", id, size);
                   });
    }
  });
}

/// What an estimator holds, to the last bit.
State held_by(Estimator& estimator) {
  State all{static_cast<double>(estimator.factor_count()), estimator.chi2()};
  for (const Id id : estimator.variables()) {
    all.push_back(static_cast<double>(id));
    const std::span<const double> x = estimator.state(id);
    all.insert(all.end(), x.begin(), x.end());
  }
  for (const FactorId id : estimator.factors()) {
    all.push_back(static_cast<double>(id));
    const std::vector<double> z = estimator.factor(id).measurement;
    all.insert(all.end(), z.begin(), z.end());
  }
  return all;
}

/// Each good but for one thing at its end.
std::vector<std::pair<std::string, GraphUpdate>> bad_updates(const Graph& graph) {
  std::vector<std::pair<std::string, GraphUpdate>> all;
  const auto add = [&](std::string what) -> GraphUpdate& {
    GraphUpdate update;  // that alone would be accepted
    update.variables.push_back({graph.type_of(0), 1000, {}});
    update.factors.push_back(graph.factor(0));
    update.factors.back().variables = {0, 1000};
    return all.emplace_back(std::move(what), std::move(update)).second;
  };
  const auto with_factor = [&](std::string what) -> Factor& {
    GraphUpdate& update = add(std::move(what));
    update.factors.push_back(graph.factor(0));
    return update.factors.back();
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  with_factor("a factor on a variable that is not there").variables = {0, 2000};
  with_factor("a factor on one variable twice").variables = {0, 0};
  with_factor("a measurement that is not finite").measurement[1] = nan;
  with_factor("a measurement that is too short").measurement.pop_back();
  with_factor("information that is indefinite").information = {1, 0, 0, -1, 0, 1};
  add("an id that is there already").variables.push_back(graph.variable(3));
  add("a state that is not finite").variables.push_back({graph.type_of(0), 1001, {0, nan, 0}});
  add("a variable that nothing places").variables.push_back({graph.type_of(0), 1002, {}});
  add("the removal of a factor that is not there").removed_factors = {100000};
  add("the removal of a variable that is not there").removed_variables = {2000};
  add("the marginalisation of a variable that is not there").marginalized = {2000};
  add("another measurement of a factor that is not there")
      .changed.push_back({100000, {0, 0, 0}, {}});
  return all;
}

void check_bad_updates(const Subject& subject, Checker& check) {
  const Graph graph = two_laps(kPoses, check.options().seed);
  check.sample("", [&] {
    const auto estimator = fed(subject, graph, check);
    const State before = held_by(*estimator);
    for (const auto& [what, update] : bad_updates(graph)) {
      check.describe(what);
      const bool refused = check.call("update", [&, &update = update] {
        try {
          estimator->update(update);
          return false;
        } catch (const Error&) {
          return true;
        }
      });
      check.expect(refused, "update refuses what is wrong with an Error",
                   [] { return std::string("it was accepted"); });
      if (!refused) return;
      check.expect(held_by(*estimator) == before, "a refused update changes nothing", [&] {
        return fmt::format("{} variables and {} factors, chi2 {}", estimator->variable_count(),
                           estimator->factor_count(), estimator->chi2());
      });
    }
  });
}

/// The position of the factor between two poses.
int factor_between(const Graph& graph, int a, int b) {
  for (int f = 0; f < graph.factor_count(); ++f) {
    if (std::ranges::equal(graph.factor_variables(f), std::array{a, b})) return f;
  }
  return -1;
}

/// A factor that contradicts the others by half a metre, some 25 standard deviations: with it and
/// without it are two estimates.
void contradict(Graph& graph, int factor) {
  State z(graph.measurement(factor).begin(), graph.measurement(factor).end());
  z[0] += 0.5;
  graph.set_measurement(factor, z);
}

/// After a change, solved to convergence; `reference` is the graph after that change.
void compare_change(const std::string& what, const Subject& subject, const Graph& graph,
                    const std::function<void(Estimator&)>& prepare, const GraphUpdate& update,
                    Graph reference, Checker& check) {
  check.sample(described(graph) + ", " + what, [&] {
    const auto estimator = fed(subject, graph, check);
    UpdateReport report;
    const std::string refusal = check.call("update", [&]() -> std::string {
      try {
        prepare(*estimator);
        report = estimator->update(update, {.full = true});
        return {};
      } catch (const Error& error) {
        return error.what();
      }
    });
    if (!refusal.empty()) return check.note(fmt::format("it refuses {}: {}", what, refusal));
    const double least = minimize_densely(reference);
    check.expect(estimator->variable_count() == reference.variable_count(),
                 "a change is carried out", [&] {
                   return fmt::format("{} variables instead of {}", estimator->variable_count(),
                                      reference.variable_count());
                 });
    check.expect(estimator->factor_count() == reference.factor_count() &&
                     std::ranges::none_of(update.removed_factors,
                                          [&](FactorId id) { return estimator->has_factor(id); }),
                 "factors that are removed are gone, and no others", [&] {
                   return fmt::format("{} factors instead of {}", estimator->factor_count(),
                                      reference.factor_count());
                 });
    // What converges to something else says so, as filters do.
    if (!report.converged) return check.note(fmt::format("it has not converged after {}", what));
    const double found = check.call("chi2", [&] { return estimator->chi2(); });
    check.expect(
        found <= least * (1.0 + kFilter) + 1e-9, "after a change, chi2 is near the minimum",
        [&] { return fmt::format("{}, where dense Gauss-Newton reaches {}", found, least); });
    if (reference.has_losses()) return;  // Gauss-Newton may end above a robust minimum
    check.expect(found >= least * (1.0 - 1e-6) - 1e-9,
                 "after a change, chi2 is that of all factors that are left", [&] {
                   return fmt::format("{}, below the minimum {} of dense Gauss-Newton", found,
                                      least);
                 });
  });
}

void check_changes(const Subject& subject, Checker& check) {
  const Graph graph = two_laps(kPoses, check.options().seed);
  const auto nothing = [](Estimator&) {};
  const int f = factor_between(graph, 10, 30);
  GraphUpdate changed, removed, left;
  State z(graph.measurement(f).begin(), graph.measurement(f).end());
  z[0] += 0.1;
  changed.changed.push_back({f, z, {}});
  Graph reference = graph.clone();
  reference.set_measurement(f, z);
  compare_change("another measurement", subject, graph, nothing, changed, std::move(reference),
                 check);
  removed.removed_factors.push_back(f);
  Graph contradictory = graph.clone();
  contradict(contradictory, f);
  reference = graph.clone();
  reference.erase_factor(f);
  compare_change("a factor that contradicts the others removed", subject, contradictory, nothing,
                 removed, std::move(reference), check);
  left.removed_variables.push_back(kPoses - 1);
  reference = graph.clone();
  reference.erase(kPoses - 1);
  compare_change("a variable removed", subject, graph, nothing, left, std::move(reference), check);
  reference = graph.clone();
  reference.set_loss(own_loss());
  compare_change(
      "a robust loss", subject, graph, [](Estimator& estimator) { estimator.set_loss(own_loss()); },
      {}, std::move(reference), check);
}

void check_copies(const Subject& subject, Checker& check) {
  const Graph graph = two_laps(kPoses, check.options().seed);
  check.sample(described(graph) + ", copied", [&] {
    const auto estimator = fed(subject, graph, check);
    const double before = estimator->chi2();
    const auto copy = check.call("clone", [&] { return estimator->clone(); });
    check.expect(copy != nullptr, "clone gives a copy", [] { return std::string("it is null"); });
    if (!copy) return;
    check.expect(copy->chi2() == before, "a copy has the same chi2",
                 [&] { return fmt::format("{} and {}", copy->chi2(), before); });
    GraphUpdate more;
    more.variables.push_back({graph.type_of(0), 1000, {}});
    more.factors.push_back(graph.factor(0));
    more.factors.back().variables = {0, 1000};
    check.call("update", [&] { return copy->update(more); });
    check.expect(!estimator->has(1000) && copy->has(1000) && estimator->chi2() == before,
                 "a change of the copy is none of the original",
                 [] { return std::string("the original changed"); });
    check.call("reset", [&] { estimator->reset(); });
    check.expect(estimator->variable_count() == 0 && copy->has(1000), "reset forgets everything",
                 [&] { return fmt::format("{} variables", estimator->variable_count()); });
  });
}

/// A new map each time.
Repetition estimator_uses(const Subject& subject, Checker& check) {
  constexpr int kFew = 12;
  return {"update", 4, [&subject, &check](std::uint64_t input) {
            const std::shared_ptr<Estimator> estimator = made<Estimator>(subject, check);
            return [estimator, updates = updates_of(two_laps(kFew, check.options().seed + input))] {
              estimator->reset();
              for (const GraphUpdate& update : updates) estimator->update(update);
              State result = held_by(*estimator);
              State block(9);
              estimator->covariance(kFew - 1, kFew - 1, block);
              result.insert(result.end(), block.begin(), block.end());
              return result;
            };
          }};
}

}  // namespace

std::span<const Group> estimator_groups() {
  static constexpr std::array<Group, 9> groups{{{"estimate", check_estimate},
                                                {"on the way", check_on_the_way, true},
                                                {"covariances", check_covariances},
                                                {"bad updates", check_bad_updates},
                                                {"failing updates", check_failing_updates},
                                                {"changes", check_changes},
                                                {"copies", check_copies},
                                                {"memory", memory_group<estimator_uses>, true},
                                                {"threads", threads_group<estimator_uses>, true}}};
  return groups;
}

}  // namespace cairn::conformance
