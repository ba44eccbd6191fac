// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/sparsify_edges.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <iterator>
#include <memory>
#include <vector>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/runtime/result_fields.hpp"
#include "cairn/runtime/timed.hpp"
#include "cairn/sparsification/connectivity.hpp"
#include "whole_graph.hpp"

namespace cairn {
namespace {

/// The choice, checked: a plugin may return anything.
EdgeChoice choose(const Graph& graph, const LoopClosures& closures, EdgeSelection& selection,
                  const SparsifyEdgesJob& job, const SparsifySetting& setting,
                  SparsifyResult& result) {
  const auto begin = std::chrono::steady_clock::now();
  const auto step = [&](int done, int total) {
    if (setting.progress) setting.progress({SparsifyProgress::Phase::edges, done, total});
    return !setting.interrupted();
  };
  EdgeChoice choice =
      call_plugin([&] { return fmt::format("edge selection '{}'", job.selection.name); },
                  [&] { return selection.choose(graph, closures.candidates, step); });
  result.select_seconds += seconds_since(begin);
  if (std::ranges::adjacent_find(choice.stay, std::greater_equal{}) != choice.stay.end() ||
      !std::ranges::includes(closures.candidates, choice.stay)) {
    throw Error(ErrorCode::plugin,
                fmt::format("edge selection '{}' returned factors that are not candidates, or not "
                            "in rising order",
                            job.selection.name));
  }
  return choice;
}

/// The candidates that leave.
void remove_others(const LoopClosures& closures, const EdgeChoice& choice, SparsifyResult& result) {
  std::vector<int>& leave = result.change.removed_factors;
  std::ranges::set_difference(closures.candidates, choice.stay, std::back_inserter(leave));
  apply(result.change, result.sparse);
}

/// λ2 of all relative edges and of those that stay, by one weight; NaN where it is not defined.
Connectivity connectivity(const std::vector<RelativeEdge>& edges, const std::vector<bool>& stays,
                          EdgeWeight weight, LinearSolver& solver) {
  std::vector<double> all, left;
  for (std::size_t k = 0; k < edges.size(); ++k) {
    all.push_back(edges[k].weight(weight));
    left.push_back(stays[k] ? all.back() : 0.0);
  }
  Connectivity result;
  try {
    FiedlerSolver fiedler(edges, solver);
    result.full = fiedler.solve(all).value;
    result.sparse = fiedler.solve(left).value;
  } catch (const Error& error) {
    if (error.code() != ErrorCode::input && error.code() != ErrorCode::numerical) throw;
  }
  return result;
}

void measure(const Graph& original, LinearSolver& solver, const SparsifyEdgesJob& job,
             SparsifyEdgesResult& result) {
  measure_or_note(result.whole, "no KLD", [&] {
    result.whole.error =
        sparsification_error(original, result.whole.sparse, solver, job.compared_at);
  });
  std::vector<int> relative;
  std::ranges::merge(result.closures.backbone, result.closures.candidates,
                     std::back_inserter(relative));
  const std::vector<RelativeEdge> edges = relative_edges(original, relative);
  std::vector<bool> stays;
  for (const int f : relative)
    stays.push_back(!std::ranges::binary_search(result.whole.change.removed_factors, f));
  for (const EdgeWeight weight : {EdgeWeight::rotation, EdgeWeight::translation}) {
    Connectivity& of = result.connectivity[static_cast<std::size_t>(weight)];
    of = connectivity(edges, stays, weight, solver);
    if (result.choice.connectivity_bound && result.choice.connectivity_weight == weight)
      of.bound = std::min(of.full, *result.choice.connectivity_bound);  // λ2 grows with each weight
  }
}

}  // namespace

SparsifyEdgesResult sparsify_edges(const Graph& graph, const SparsifyEdgesJob& job,
                                   const SparsifySetting& setting) {
  SparsifyEdgesResult result;
  SparsifyResult& whole = result.whole;
  const auto selection = setting.registry.make<EdgeSelection>(job.selection);
  const auto optimizer = setting.registry.make<Optimizer>(job.optimizer);
  const auto solver = setting.registry.make<LinearSolver>(job.linear_solver);
  Graph original = graph.clone();
  whole.variables_before = original.variable_count();
  whole.factors_before = original.factor_count();
  original.set_loss(setting.loss, setting.loss_on);
  result.closures = find_loop_closures(original);
  if (result.closures.candidates.empty()) {
    throw Error(ErrorCode::input,
                "there are no loop closures to choose from: all relative factors are needed to "
                "connect the poses, or there are none");
  }
  if (setting.initialise) whole.notes = setting.initialise(original);
  const auto optimize = [&](Graph& which, const char* what) {
    return optimize_whole(which, *optimizer, job.optimizer.name, setting, what, whole);
  };
  if (!job.as_given) whole.chi2_before = optimize(original, "the graph");
  whole.sparse = original.clone();
  if (!whole.interrupted) {
    result.choice = choose(original, result.closures, *selection, job, setting, whole);
    whole.notes.insert(whole.notes.end(), result.choice.notes.begin(), result.choice.notes.end());
    whole.interrupted = setting.interrupted() || !result.choice.complete;
  }
  if (whole.interrupted) {
    whole.notes.emplace_back("interrupted before the loop closures were chosen: none was removed");
    return result;
  }
  remove_others(result.closures, result.choice, whole);
  whole.chi2_after = optimize(whole.sparse, "the sparse graph");
  if (job.measure && !whole.interrupted) measure(original, *solver, job, result);
  return result;
}

ResultFields<Connectivity> Connectivity::fields() {
  using C = Connectivity;
  return ResultFields<C>()
      .figure("full", &C::full, "with all factors")
      .figure("sparse", &C::sparse, "with those that stay")
      .figure("bound", &C::bound, "that no choice of as many exceeds")
      .details();
}

ResultFields<SparsifyEdgesResult> SparsifyEdgesResult::fields() {
  using R = SparsifyEdgesResult;
  const auto by = [](EdgeWeight weight) {
    return [weight](const R& r) { return r.connectivity[static_cast<std::size_t>(weight)]; };
  };
  return ResultFields<R>()
      .part(&R::whole)
      .without("problems")
      .without("refused")
      .without("nonzeros")
      .without("conservative_margin")
      .without("seconds")
      .without("redirected")
      .without("dropped")
      .without("rmse_full")
      .without("steps")
      .figure(
          "loops.in", [](const R& r) { return r.closures.candidates.size(); },
          "loop closures that might leave")
      .figure(
          "loops.kept",
          [](const R& r) {
            return r.closures.candidates.size() - r.whole.change.removed_factors.size();
          },
          "those of them that stay")
      .figure(
          "backbone.factors", [](const R& r) { return r.closures.backbone.size(); },
          "factors of the spanning forest that stays")
      .figure(
          "backbone.odometry", [](const R& r) { return r.closures.odometry; },
          "those of them between poses that follow each other")
      .figure(
          "backbone.components", [](const R& r) { return r.closures.components; },
          "sets of variables that relative factors join")
      .figure(
          "kld_bound", [](const R& r) { return r.choice.kld_bound.value_or(std::nan("")); }, "nats",
          "divergence of covariances that no choice of as many is below")
      .part("connectivity.rotation", by(EdgeWeight::rotation))
      .part("connectivity.translation", by(EdgeWeight::translation))
      .figure(
          "seconds.total", [](const R& r) { return r.whole.select_seconds; }, "s",
          "choosing what leaves")
      .figure(
          "seconds.select", [](const R& r) { return r.whole.select_seconds; }, "s",
          "choosing what leaves")
      .details();
}

}  // namespace cairn
