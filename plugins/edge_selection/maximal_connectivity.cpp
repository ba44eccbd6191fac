// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstddef>
#include <utility>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "cairn/sparsification/connectivity.hpp"
#include "cairn/sparsification/loop_closures.hpp"
#include "edge_selections.hpp"
#include "relaxed_choice.hpp"

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
      const double apart =
          pair.vector[static_cast<std::size_t>(a)] - pair.vector[static_cast<std::size_t>(b)];
      gradient[k] = full_[backbone_ + k] * apart * apart;
    }
    return pair.value;
  }

 private:
  std::size_t backbone_;
  FiedlerSolver solver_;
  std::vector<double> full_, weights_;
};

}  // namespace

EdgeChoice MaximalConnectivity::choose(const Graph& graph, std::span<const int> candidates,
                                       int count, const Step& step) {
  WeightedConnectivity connectivity(all_edges(graph, candidates), candidates.size(), weight_,
                                    *solver_);
  RelaxedChoice found = relaxed_choice(
      candidates, count, options_,
      [&](std::span<const double> w, std::span<double> g) { return connectivity(w, g); }, step);
  if (found.choice.complete) found.choice.connectivity_bound = found.bound;
  found.choice.connectivity_weight = weight_;
  return std::move(found.choice);
}

}  // namespace cairn::edges
