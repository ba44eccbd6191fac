// SPDX-License-Identifier: BSD-3-Clause
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "cairn/sparsification/connectivity.hpp"
#include "edge_selections.hpp"
#include "linear_model.hpp"
#include "relaxed_choice.hpp"

namespace cairn::edges {
namespace {

/// λ2 of the factors that stay and weighted candidates.
class WeightedConnectivity {
 public:
  WeightedConnectivity(const PoseGraphEdges& edges, EdgeWeight weight, LinearSolver& solver)
      : stay_(edges.stay), solver_(edges.all, solver) {
    for (const RelativeEdge& edge : edges.all) full_.push_back(edge.weight(weight));
  }

  /// With w_k times the weight of each candidate; and the supergradient, unless that is empty.
  double operator()(std::span<const double> w, std::span<double> gradient) {
    weights_ = full_;
    for (std::size_t k = 0; k < w.size(); ++k) weights_[stay_ + k] *= w[k];
    const FiedlerPair& pair = solver_.solve(weights_);
    for (std::size_t k = 0; k < gradient.size(); ++k) {
      const auto& [a, b] = solver_.edges()[stay_ + k];
      const double apart =
          pair.vector[static_cast<std::size_t>(a)] - pair.vector[static_cast<std::size_t>(b)];
      gradient[k] = full_[stay_ + k] * apart * apart;
    }
    return pair.value;
  }

 private:
  std::size_t stay_;
  FiedlerSolver solver_;
  std::vector<double> full_, weights_;
};

}  // namespace

EdgeChoice MaximalConnectivity::choose(const Graph& graph, std::span<const int> candidates,
                                       int count, const Step& step) {
  const PoseGraphEdges edges(graph, candidates);
  edges.check(weight_);
  WeightedConnectivity connectivity(edges, weight_, *solver_);
  RelaxedChoice found = relaxed_choice(
      candidates, count, options_,
      [&](std::span<const double> w, std::span<double> g) { return connectivity(w, g); }, step);
  if (found.choice.complete) found.choice.connectivity_bound = found.bound;
  found.choice.connectivity_weight = weight_;
  return std::move(found.choice);
}

}  // namespace cairn::edges
