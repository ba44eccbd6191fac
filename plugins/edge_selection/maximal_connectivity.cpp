// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstddef>
#include <optional>
#include <set>

#include <fmt/core.h>

#include "budget.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/sparsification/connectivity.hpp"
#include "cairn/sparsification/loop_closures.hpp"
#include "edge_selections.hpp"

namespace cairn::edges {
namespace {

/// The edges of the backbone, and behind them those of the candidates.
std::vector<RelativeEdge> all_edges(const Graph& graph, std::span<const int> candidates) {
  std::vector<int> factors = find_loop_closures(graph).backbone;
  factors.insert(factors.end(), candidates.begin(), candidates.end());
  return relative_edges(graph, factors);
}

/// λ2 of the backbone and weighted candidates.
class WeightedConnectivity {
 public:
  WeightedConnectivity(const std::vector<RelativeEdge>& edges, std::size_t candidates,
                       EdgeWeight weight, LinearSolver& solver)
      : backbone_(edges.size() - candidates), solver_(edges, solver) {
    for (const RelativeEdge& edge : edges) full_.push_back(edge.weight(weight));
    const auto begin = full_.begin() + static_cast<std::ptrdiff_t>(backbone_);
    if (std::all_of(begin, full_.end(), [](double w) { return w == 0.0; })) {
      throw Error(ErrorCode::input,
                  fmt::format("the relative factors measure no {}: choose by the other weight",
                              to_string(weight)));
    }
  }

  /// With w_k times the weight of each candidate; and the supergradient, unless that is empty.
  double operator()(std::span<const double> w, std::span<double> gradient) {
    weights_ = full_;
    for (std::size_t k = 0; k < w.size(); ++k) weights_[backbone_ + k] *= w[k];
    const FiedlerPair& pair = solver_.solve(weights_);
    for (std::size_t k = 0; k < gradient.size(); ++k) {
      const auto& [a, b] = solver_.edges()[backbone_ + k];
      const double apart = pair.vector[static_cast<std::size_t>(a)] -
                           pair.vector[static_cast<std::size_t>(b)];
      gradient[k] = full_[backbone_ + k] * apart * apart;
    }
    return pair.value;
  }
  /// With these candidates alone, by number.
  double of(const std::vector<int>& numbers) {
    std::vector<double> w(full_.size() - backbone_, 0.0);
    for (const int k : numbers) w[static_cast<std::size_t>(k)] = 1.0;
    return (*this)(w, {});
  }

 private:
  std::size_t backbone_;
  FiedlerSolver solver_;
  std::vector<double> full_, weights_;
};

}  // namespace

EdgeChoice MaximalConnectivity::choose(const Graph& graph, std::span<const int> candidates,
                                       int count, const Step& step) {
  const int total = options_.iterations + options_.samples;
  WeightedConnectivity connectivity(all_edges(graph, candidates), candidates.size(),
                                    options_.weight, *solver_);
  const std::optional<Relaxed> relaxed = maximize_within_budget(
      [&](std::span<const double> w, std::span<double> g) { return connectivity(w, g); },
      static_cast<int>(std::ssize(candidates)), count, options_.iterations, options_.tolerance,
      [&](int done, int) { return !step || step(done, total); });
  if (!relaxed) return {.stay = {}, .complete = false};
  std::vector<int> best = largest(relaxed->weights, count);
  double value = connectivity.of(best);
  std::set<std::vector<int>> tried{best};
  Uniform uniform(static_cast<std::uint64_t>(options_.seed));
  for (int k = 0; k < options_.samples; ++k) {
    if (step && !step(options_.iterations + k, total)) return {.stay = {}, .complete = false};
    std::vector<int> sample = systematic_sample(relaxed->weights, uniform());
    if (!tried.insert(sample).second) continue;
    if (const double of_sample = connectivity.of(sample); of_sample > value) {
      value = of_sample;
      best = std::move(sample);
    }
  }
  EdgeChoice choice{.connectivity_bound = relaxed->bound,
                    .connectivity_weight = options_.weight};
  for (const int k : best) choice.stay.push_back(candidates[static_cast<std::size_t>(k)]);
  return choice;
}

}  // namespace cairn::edges
