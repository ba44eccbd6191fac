// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/sparsify_graph.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <memory>
#include <unordered_set>
#include <utility>

#include <fmt/core.h>

#include "cairn/evaluation/step_times.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/geometry/pose_chain.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/runtime/result_fields.hpp"
#include "cairn/runtime/timed.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/update/recorded_graph.hpp"
#include "kept_minimum.hpp"
#include "plain_loss.hpp"
#include "whole_graph.hpp"

namespace cairn {
namespace {

using Clock = std::chrono::steady_clock;

/// The parts that the job names.
struct Parts {
  Parts(const SparsifyJob& named, const SparsifySetting& setting)
      : job(named),
        sparsifier(setting.registry.make<Sparsifier>(job.sparsifier)),
        selection(setting.registry.make<NodeSelection>(job.selection)),
        optimizer(setting.registry.make<Optimizer>(job.optimizer)),
        solver(setting.registry.make<LinearSolver>(job.linear_solver)) {
    if (setting.observer) sparsifier->observe(setting.observer);
  }
  const SparsifyJob& job;
  std::unique_ptr<Sparsifier> sparsifier;
  std::unique_ptr<NodeSelection> selection;
  std::unique_ptr<Optimizer> optimizer;
  std::unique_ptr<LinearSolver> solver;
};

/// To the minimum; its chi2.
double optimize(Graph& graph, Parts& parts, const SparsifySetting& setting, const char* what,
                SparsifyResult& result) {
  return optimize_whole(graph, *parts.optimizer, parts.job.optimizer.name, setting, what, result);
}

/// A pose type of a plugin may have no position.
bool is_of_kind(const Graph& graph, int v, NodeKind kind) {
  const VariableType& type = graph.type(v);
  if (!type.lie_group()) return false;
  return kind == NodeKind::all || is_point(type) == (kind == NodeKind::landmarks);
}

bool is_open(const Graph& graph, int v, NodeKind kind) {
  return !graph.fixed(v) && is_of_kind(graph, v, kind);
}

/// Which of the graph's variables may leave: all of a kind but the first pose, those that hold the
/// gauge, the newest pose, and those that are to stay.
std::vector<int> open_nodes(const Graph& graph, NodeKind kind, std::span<const Id> kept) {
  std::vector<int> nodes, stay = resolve_gauge(graph).anchored;
  for (const Id id : kept) {
    if (const auto there = graph.find(id)) stay.push_back(*there);
  }
  int first = -1, newest = -1;
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (is_open(graph, v, kind)) nodes.push_back(v);
    if (!is_of_kind(graph, v, NodeKind::poses)) continue;
    if (first < 0) first = v;
    newest = v;
  }
  stay.insert(stay.end(), {first, newest});
  std::ranges::sort(stay);
  std::erase_if(nodes, [&](int v) { return std::ranges::binary_search(stay, v); });
  return nodes;
}

void report(const SparsifySetting& setting, const SparsifyProgress& progress) {
  if (setting.progress) setting.progress(progress);
}

Sparsification take_out(const Graph& graph, std::span<const int> nodes, Parts& parts,
                        const SparsifySetting& setting) {
  const int total = static_cast<int>(std::ssize(nodes));
  const auto progress = [&](int done) {
    report(setting, {SparsifyProgress::Phase::remove, done, total});
    return !setting.interrupted();
  };
  return call_plugin([&] { return fmt::format("sparsifier '{}'", parts.job.sparsifier.name); },
                     [&] { return parts.sparsifier->remove(graph, nodes, progress); });
}

/// Those of `nodes` that are to leave.
std::vector<int> select(const Graph& graph, const std::vector<int>& nodes, Parts& parts,
                        SparsifyResult& result) {
  const auto begin = Clock::now();
  std::vector<int> chosen =
      call_plugin([&] { return fmt::format("node selection '{}'", parts.job.selection.name); },
                  [&] { return parts.selection->select(graph, nodes, *parts.sparsifier); });
  result.select_seconds += seconds_since(begin);
  return chosen;
}

/// Of the sparsification, once all nodes have left.
void add_notes(SparsifyResult& result) {
  const std::vector<std::string> lines = result.change.note_lines();
  result.notes.insert(result.notes.end(), lines.begin(), lines.end());
}

void measure(const Graph& original, Parts& parts, SparsifyResult& result) {
  const bool measured = measure_or_note(result, "no KLD", [&] {
    result.error =
        sparsification_error(original, result.sparse, *parts.solver, parts.job.compared_at);
  });
  if (!measured) return;
  result.nonzeros_before = count_nonzeros(original, *parts.solver);
  result.nonzeros_after = count_nonzeros(result.sparse, *parts.solver);
  measure_or_note(result, "the smallest eigenvalue of Λ − Λ̆ is not known", [&] {
    result.conservative_margin = conservative_margin(original, result.sparse, *parts.solver);
  });
}

}  // namespace

std::optional<double> SparsifyProgress::part() const {
  if (phase == Phase::select) return std::nullopt;
  return static_cast<double>(done) / static_cast<double>(total);
}

std::string SparsifyProgress::to_string() const {
  switch (phase) {
    case Phase::select:
      break;
    case Phase::remove:
      return fmt::format("{} of {} nodes taken out", done, total);
    case Phase::feed:
      return fmt::format("pose {} of {}, {} kept", done, total, kept);
    case Phase::edges:
      return fmt::format("choosing loop closures, {} of {}", done, total);
  }
  return "choosing nodes";
}

void choose_recovery(ComponentSpec& sparsifier) {
  const auto topology = sparsifier.values.find("topology");
  if (topology == sparsifier.values.end()) return;
  // Beside the rest of the graph, what is exact for the tree alone is no minimum.
  const auto fit = sparsifier.values.find("fit");
  if (fit != sparsifier.values.end() && fit->second == "graph") return;
  if (topology->second.starts_with("clt") || topology->second.starts_with("cliquey"))
    sparsifier.values.emplace("recovery", "closed_form");
}

SparsifyResult sparsify_whole(const Graph& graph, const SparsifyJob& job,
                              const SparsifySetting& setting) {
  SparsifyResult result;
  Parts parts(job, setting);
  Graph original = graph.clone();
  result.variables_before = original.variable_count();
  result.factors_before = original.factor_count();
  original.set_loss(setting.loss, setting.loss_on);
  if (setting.initialise) result.notes = setting.initialise(original);
  if (!job.as_given) {
    result.chi2_before = optimize(original, parts, setting, "the graph", result);
    if (result.interrupted) {
      result.notes.push_back("interrupted before the graph had converged: nothing was taken out");
      result.sparse = std::move(original);
      return result;
    }
  }
  report(setting, {SparsifyProgress::Phase::select});
  const std::vector<int> open = open_nodes(original, job.nodes, job.stay);
  if (open.empty()) {
    result.notes.push_back(fmt::format("nothing was taken out: the graph has no {} that may leave",
                                       job.nodes == NodeKind::landmarks ? "landmark"
                                       : job.nodes == NodeKind::poses
                                           ? "pose (landmarks: --nodes landmarks or all)"
                                           : "pose or landmark"));
  }
  std::vector<int> nodes = select(original, open, parts, result);
  // Landmarks last: the poses that have observed one are then held together by other factors.
  std::stable_partition(nodes.begin(), nodes.end(),
                        [&](int v) { return !is_point(original.type(v)); });
  result.change = take_out(original, nodes, parts, setting);
  add_notes(result);
  result.interrupted = setting.interrupted();
  if (job.keep_minimum && result.converged && !result.interrupted) {
    keep_minimum(original, result.change,
                 [&] { return setting.registry.make<LinearSolver>(job.linear_solver); });
  }
  result.sparse = original.clone();
  apply(result.change, result.sparse);
  if (result.interrupted) return result;
  // What is written is at its own minimum, which is where it is compared.
  result.chi2_after = optimize(result.sparse, parts, setting, "the sparse graph", result);
  if (job.measure) measure(original, parts, result);
  return result;
}

// Online ------------------------------------------------------------------------------------------

namespace {

/// Not where one of its variables is missing.
void add(Graph& graph, const Factor& factor) {
  std::vector<int> on;
  for (const Id id : factor.variables) {
    const std::optional<int> v = graph.find(id);
    if (!v) return;
    on.push_back(*v);
  }
  graph.add_factor(factor.type, on, factor.measurement, factor.information);
}

class OnlineRun {
 public:
  OnlineRun(const Graph& recording, const SparsifyJob& job, const SparsifySetting& setting)
      : recording_(recording),
        job_(job),
        setting_(setting),
        parts_(job, setting),
        estimator_(setting.registry.make<Estimator>(job.estimator)),
        redirection_(job.redirection) {
    estimator_->set_loss(setting.loss, setting.loss_on);
  }

  SparsifyResult run() {
    result_.variables_before = recording_.variable_count();
    result_.factors_before = recording_.factor_count();
    const std::vector<Arrival> arrivals = arrival_order(recording_);
    const int total = static_cast<int>(std::ssize(arrivals));
    int count = 0;
    for (const Arrival& arrival : arrivals) {
      const auto begin = Clock::now();
      feed(arrival);
      ++count;
      if (count % job_.online == 0) sparsify();
      result_.steps.push_back(seconds_since(begin));
      report(setting_, {SparsifyProgress::Phase::feed, count, total, estimator_->variable_count()});
      result_.interrupted = setting_.interrupted();
      if (result_.interrupted) break;
    }
    if (!result_.interrupted) sparsify();
    finish();
    return std::move(result_);
  }

 private:
  void feed(const Arrival& arrival) {
    GraphUpdate update = arrival_update(recording_, arrival);
    if (job_.redirect_early > 0) leave_early(update);
    for (const Factor& as_came : std::exchange(update.factors, {})) {
      // Odometry holds the newest pose to the one before it, whether that is to leave or not.
      const bool odometry = std::ranges::all_of(as_came.variables, [&](Id id) {
        return (!arrival.variables.empty() && id == recording_.id(arrival.pose())) || id == newest_;
      });
      std::optional<Factor> factor = odometry && (newest_ < 0 || estimator_->has(newest_))
                                         ? as_came
                                         : redirection_.redirect(as_came);
      const bool moved = factor && factor->variables != as_came.variables;
      if (!factor) {
        ++result_.dropped;
        continue;
      }
      result_.redirected += moved;
      factors_.push_back(*factor);
      update.factors.push_back(std::move(*factor));
    }
    // The pose is placed by its odometry: the factor to the newest pose that is there.
    std::ranges::stable_sort(update.factors, std::greater{}, [&](const Factor& factor) {
      Id newest = -1;
      for (const Id id : factor.variables) {
        if (estimator_->has(id)) newest = std::max(newest, id);
      }
      return newest;
    });
    leave_states_to_factors(update, *estimator_);
    take(estimator_->update(update), update.factors.size());
    for (const Variable& variable : update.variables) pending_.push_back(variable.id);
    if (!update.variables.empty()) {
      newest_ = update.variables.front().id;
      if (first_ < 0) first_ = newest_;
      if (job_.redirect_early > 0 && count_++ % job_.redirect_early != 0) early_.insert(newest_);
    }
  }

  /// Nodes that are to leave, and that this pose has measured again: they are redirected from now
  /// on, although they are still there.
  void leave_early(const GraphUpdate& update) {
    std::vector<Id> leaving;
    for (const Factor& factor : update.factors) {
      for (const Id id : factor.variables) {
        if (id != newest_ && early_.contains(id) && estimator_->has(id) && !redirection_.has(id))
          leaving.push_back(id);
      }
    }
    if (leaving.empty()) return;
    const Graph graph = estimator_->graph();
    std::vector<int> nodes, all;
    for (int v = 0; v < graph.variable_count(); ++v) {
      if (early_.contains(graph.id(v))) all.push_back(v);
    }
    for (const Id id : leaving) nodes.push_back(graph.find(id).value());
    redirection_.leave(graph, nodes, all);
  }

  void take(const UpdateReport& report, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k)
      live_.push_back(report.first_factor + static_cast<FactorId>(k));
    if (!report.ok) ++failed_;
  }

  void sparsify() {
    estimator_->update({}, {.full = true});
    const Graph graph = estimator_->graph();
    if (graph.factor_count() != static_cast<int>(std::ssize(live_)))
      throw std::logic_error("an estimator's graph has other factors than it was given");
    std::vector<int> nodes;
    std::vector<Id> later;
    for (const Id id : pending_) {
      const int v = graph.find(id).value();
      if (id == newest_) {
        later.push_back(id);
      } else if (id != first_ && is_open(graph, v, NodeKind::poses)) {
        nodes.push_back(v);
      }
    }
    pending_ = std::move(later);
    const std::vector<int> chosen = select(graph, nodes, parts_, result_);
    const Sparsification change = take_out(graph, chosen, parts_, setting_);
    result_.change.add(change);
    result_.change.removed_variables.insert(result_.change.removed_variables.end(),
                                            change.removed_variables.begin(),
                                            change.removed_variables.end());
    std::vector<int> undecided;
    for (const Id id : pending_) undecided.push_back(graph.find(id).value());
    for (int v = 0; v < graph.variable_count(); ++v) {
      if (early_.contains(graph.id(v))) undecided.push_back(v);
    }
    redirection_.leave(graph, change.removed_variables, undecided);
    GraphUpdate update;
    for (const int f : change.removed_factors) update.removed_factors.push_back(live_[f]);
    for (const int v : change.removed_variables) update.removed_variables.push_back(graph.id(v));
    update.factors = change.factors;
    for (Factor& factor : update.factors) factor.loss = plain_loss();
    std::vector<FactorId> stay;
    std::ranges::set_difference(live_, update.removed_factors, std::back_inserter(stay));
    live_ = std::move(stay);
    take(estimator_->update(update), update.factors.size());
  }

  void finish() {
    estimator_->update({}, {.full = true});
    result_.sparse = estimator_->graph();
    result_.chi2_after = estimator_->chi2();
    add_notes(result_);
    if (failed_ > 0)
      result_.notes.push_back(fmt::format("{} updates were not positive definite", failed_));
    if (!job_.measure || result_.interrupted) return;
    // The same factors with no node taken out, and all factors as they arrived: both from the
    // estimate of the sparse graph.
    Graph redirected, full;
    for (int v = 0; v < recording_.variable_count(); ++v) {
      const Id id = recording_.id(v);
      if (redirection_.has(id) && redirection_.lost(id)) continue;
      const Id anchor = redirection_.has(id) ? redirection_.anchor(id) : id;
      const auto there = result_.sparse.find(anchor);
      if (!there) continue;
      const auto x = result_.sparse.state(*there);
      const std::vector<double> state =
          anchor == id ? std::vector<double>(x.begin(), x.end()) : redirection_.state(id, x);
      for (Graph* graph : {&redirected, &full}) {
        const int added = graph->add_variable(recording_.type_of(v), id, state);
        graph->set_fixed(added, recording_.fixed(v));
      }
    }
    for (const Factor& factor : factors_) add(redirected, factor);
    for (int f = 0; f < recording_.factor_count(); ++f) add(full, recording_.factor(f));
    for (Graph* graph : {&redirected, &full}) graph->set_loss(setting_.loss, setting_.loss_on);
    optimize(redirected, parts_, setting_, "the graph without removals", result_);
    measure(redirected, parts_, result_);
    result_.chi2_before = optimize(full, parts_, setting_, "the whole graph", result_);
    try {
      result_.rmse_full = sparsification_error(full, result_.sparse, *parts_.solver).rmse;
    } catch (const Error& error) {
      if (error.code() != ErrorCode::numerical && error.code() != ErrorCode::input) throw;
      result_.rmse_full = std::nan("");
    }
  }

  const Graph& recording_;
  const SparsifyJob& job_;
  const SparsifySetting& setting_;
  Parts parts_;
  std::unique_ptr<Estimator> estimator_;
  SparsifyResult result_;
  Redirection redirection_;
  std::vector<FactorId> live_;  ///< by position in the estimator's graph, rising
  std::vector<Id> pending_;     ///< nodes on which nothing has been decided
  Id first_ = -1, newest_ = -1;
  std::int64_t count_ = 0;
  std::unordered_set<Id> early_;  ///< with early redirection: nodes that are to leave
  std::vector<Factor> factors_;   ///< all that came, redirected
  int failed_ = 0;
};

}  // namespace

SparsifyResult sparsify_online(const Graph& recording, const SparsifyJob& job,
                               const SparsifySetting& setting) {
  if (job.nodes != NodeKind::poses) {
    throw Error(ErrorCode::usage,
                "online only poses can be removed: a landmark that has left may be observed again, "
                "and there is no other that the observation could be redirected to");
  }
  return call_plugin([&] { return fmt::format("estimator '{}'", job.estimator); },
                     [&] { return OnlineRun(recording, job, setting).run(); });
}

ResultFields<SparsifyResult> SparsifyResult::fields() {
  using R = SparsifyResult;
  const auto online = [](auto R::*member) {
    return
        [member](const R& r) { return r.steps.empty() ? std::nullopt : std::optional(r.*member); };
  };
  return ResultFields<R>()
      .figure(
          "status", [](const R& r) { return r.interrupted ? Status::interrupted : r.status; },
          "of the first optimisation that has not converged, or converged")
      .figure("poses.in", &R::variables_before, "variables of the original graph")
      .figure(
          "poses.kept", [](const R& r) { return r.sparse.variable_count(); },
          "variables of the sparse graph")
      .figure("factors.in", &R::factors_before, "factors of the original graph")
      .figure(
          "factors.out", [](const R& r) { return r.sparse.factor_count(); },
          "factors of the sparse graph")
      .part(&R::change)
      .part([](const R& r) {
        constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
        return r.error.value_or(
            SparsificationError{kUnknown, kUnknown, kUnknown, kUnknown, kUnknown});
      })
      .part("nonzeros.before", &R::nonzeros_before)
      .part("nonzeros.after", &R::nonzeros_after)
      .figure("conservative_margin", &R::conservative_margin,
              "the smallest eigenvalue of the original information less the sparse one; from 0 on "
              "the sparse graph is conservative")
      .round("{:.3g}")
      .figure("chi2.before", &R::chi2_before, "of the original graph at its minimum")
      .attribute("initial_chi2")
      .figure("chi2.after", &R::chi2_after, "of the sparse graph at its minimum")
      .attribute("chi2")
      .figure("seconds.select", &R::select_seconds, "s", "choosing what leaves")
      .figure("redirected", online(&R::redirected),
              "online: factors on nodes that had left, redirected to others")
      .optional()
      .figure("dropped", online(&R::dropped), "online: factors on nodes that had left, dropped")
      .optional()
      .figure("rmse_full", online(&R::rmse_full), "m",
              "online: distance from the minimum of all factors as they arrived")
      .round("{:.3g}")
      .optional()
      .part("steps",
            [](const R& r) {
              return r.steps.empty() ? std::nullopt : std::optional(StepTimes(r.steps));
            })
      .optional()
      .figure("notes", &R::notes, "sentences for the user")
      .details();
}

}  // namespace cairn
