// SPDX-License-Identifier: BSD-3-Clause
#include "edge_selections.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "determinant_gain.hpp"
#include "lazy_greedy.hpp"
#include "linear_model.hpp"
#include "relaxed_choice.hpp"

namespace cairn::edges {
namespace {

using Eigen::MatrixXd;

EdgeChoice greedy_choice(std::span<const int> candidates, int count, const Increments& function,
                         const EdgeSelection::Step& step) {
  const std::optional<std::vector<int>> numbers =
      lazy_greedy(static_cast<int>(std::ssize(candidates)), count, function, step);
  return numbers ? choice_of(candidates, *numbers) : interrupted_choice();
}

/// Where all candidates stay: ln |Λ|, and their J_k Λ⁻¹ J_kᵀ.
struct Whole {
  Whole(const LinearModel& model, LinearSolver& solver) {
    check_solver(solver);
    solver.analyze(*model.structure);
    const std::vector<double> ones(model.candidates.size(), 1.0);
    log_determinant = edges::log_determinant(model.information(ones), solver);
    S = candidate_covariances(model, solver);
  }
  double log_determinant;
  std::vector<MatrixXd> S;
};

}  // namespace

EdgeChoice SelectionByPart::choose(const Graph& graph, std::span<const int> candidates,
                                   const Step& step) {
  const auto all = static_cast<int>(std::ssize(candidates));
  const auto count = static_cast<int>(std::lround(part_ * all));
  if (count == 0) return {};
  if (count == all) return {.stay = {candidates.begin(), candidates.end()}};
  return choose(graph, candidates, count, step);
}

EdgeChoice GreedyTreeConnectivity::choose(const Graph& graph, std::span<const int> candidates,
                                          int count, const Step& step) {
  // Of each part that the factors measure, its Laplacian and its dimension.
  struct Part {
    DeterminantGain gain;
    double dimension;
  };
  std::vector<Part> parts;
  const VariableType& type = graph.type(graph.factor_variables(candidates.front())[0]);
  const int positions =
      type.placement() ? std::min(type.placement()->dimension(), type.tangent_size()) : 0;
  for (const auto& [weight, dimension] :
       {std::pair{EdgeWeight::translation, positions},
        std::pair{EdgeWeight::rotation, type.tangent_size() - positions}}) {
    if (dimension == 0) continue;
    parts.push_back({DeterminantGain(laplacian_model(graph, candidates, weight),
                                     *solvers_[static_cast<std::size_t>(weight)]),
                     static_cast<double>(dimension)});
  }
  const Increments function{.gain =
                                [&](int k) {
                                  double sum = 0.0;
                                  for (const Part& part : parts)
                                    sum += part.dimension * part.gain.gain(k);
                                  return sum;
                                },
                            .add =
                                [&](int k) {
                                  for (Part& part : parts) part.gain.add(k);
                                }};
  return greedy_choice(candidates, count, function, step);
}

EdgeChoice GreedyGain::choose(const Graph& graph, std::span<const int> candidates, int count,
                              const Step& step) {
  LinearModel model = linear_model(graph, candidates);
  std::vector<double> trace(candidates.size(), 0.0);
  if (objective_ == GainObjective::divergence) {
    const Whole whole(model, *solver_);
    for (std::size_t k = 0; k < trace.size(); ++k) trace[k] = whole.S[k].trace();
  }
  DeterminantGain gain(std::move(model), *solver_);
  const Increments function{
      .gain = [&](int k) { return 0.5 * (gain.gain(k) - trace[static_cast<std::size_t>(k)]); },
      .add = [&](int k) { gain.add(k); }};
  return greedy_choice(candidates, count, function, step);
}

EdgeChoice SparseWeights::choose(const Graph& graph, std::span<const int> candidates, int count,
                                 const Step& step) {
  const LinearModel model = linear_model(graph, candidates);
  const Whole whole(model, *solver_);
  // −KLD, ½ (ln |Λ(w)| − ln |Λ| + Σ (1 − w_k) tr S_k), as tr(Λ Σ₁) is d.
  double traces = 0.0;
  for (const MatrixXd& S : whole.S) traces += S.trace();
  const ConcaveFunction negative_divergence = [&](std::span<const double> w,
                                                  std::span<double> gradient) {
    const BlockMatrix information = model.information(w);
    double value = log_determinant(information, *solver_) - whole.log_determinant + traces;
    for (std::size_t k = 0; k < w.size(); ++k) value -= w[k] * whole.S[k].trace();
    if (!gradient.empty()) {
      const std::vector<MatrixXd> S = candidate_covariances(model, *solver_);
      for (std::size_t k = 0; k < w.size(); ++k)
        gradient[k] = 0.5 * (S[k].trace() - whole.S[k].trace());
    }
    return 0.5 * value;
  };
  RelaxedChoice found = relaxed_choice(candidates, count, options_, negative_divergence, step);
  if (found.choice.complete) found.choice.kld_bound = std::max(0.0, -found.bound);
  return std::move(found.choice);
}

EdgeChoice RandomEdges::choose(const Graph& /*graph*/, std::span<const int> candidates, int count,
                               const Step& /*step*/) {
  Uniform uniform(static_cast<std::uint64_t>(seed_));
  std::vector<double> keys(candidates.size());
  for (double& key : keys) key = uniform();
  return choice_of(candidates, largest(keys, count));
}

}  // namespace cairn::edges
