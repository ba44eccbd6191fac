// SPDX-License-Identifier: BSD-3-Clause
#include "edge_selections.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "budget.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/sparsification/loop_closures.hpp"
#include "determinant_gain.hpp"
#include "lazy_greedy.hpp"
#include "linear_model.hpp"

namespace cairn::edges {
namespace {

/// The choice of these of the candidates, by number.
EdgeChoice choice_of(std::span<const int> candidates, std::vector<int> numbers) {
  EdgeChoice choice;
  std::ranges::sort(numbers);
  for (const int k : numbers) choice.stay.push_back(candidates[static_cast<std::size_t>(k)]);
  return choice;
}

EdgeChoice interrupted() { return {.stay = {}, .complete = false}; }

EdgeChoice greedy_choice(std::span<const int> candidates, int count, const Increments& function,
                         const EdgeSelection::Step& step) {
  std::optional<std::vector<int>> numbers =
      lazy_greedy(static_cast<int>(std::ssize(candidates)), count, function, step);
  return numbers ? choice_of(candidates, std::move(*numbers)) : interrupted();
}

/// The covariances of the candidates where all stay, and ln |Λ| there.
CandidateCovariances with_all(const LinearModel& model, LinearSolver& solver) {
  check_solver(solver);
  solver.analyze(*model.structure);
  const std::vector<double> ones(model.candidates.size(), 1.0);
  return candidate_covariances(model, model.information(ones), solver);
}

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
  const Increments function{
      .gain =
          [&](int k) {
            double sum = 0.0;
            for (const Part& part : parts) sum += part.dimension * part.gain.gain(k);
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
    const CandidateCovariances whole = with_all(model, *solver_);
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
  const CandidateCovariances whole = with_all(model, *solver_);
  // −KLD, ½ (ln |Λ(w)| − ln |Λ| + Σ (1 − w_k) tr S_k), as tr(Λ Σ₁) is d.
  const ConcaveFunction negative_divergence = [&](std::span<const double> w,
                                                  std::span<double> gradient) {
    const CandidateCovariances now =
        candidate_covariances(model, model.information(w), *solver_);
    double value = now.log_determinant - whole.log_determinant;
    for (std::size_t k = 0; k < w.size(); ++k) {
      const double trace = whole.S[k].trace();
      value += (1.0 - w[k]) * trace;
      gradient[k] = 0.5 * (now.S[k].trace() - trace);
    }
    return 0.5 * value;
  };
  const std::optional<Relaxed> relaxed = maximize_within_budget(
      negative_divergence, static_cast<int>(std::ssize(candidates)), count, options_.iterations,
      options_.tolerance, step);
  if (!relaxed) return interrupted();
  EdgeChoice choice = choice_of(candidates, largest(relaxed->weights, count));
  choice.kld_bound = std::max(0.0, -relaxed->bound);
  return choice;
}

EdgeChoice RandomEdges::choose(const Graph& /*graph*/, std::span<const int> candidates, int count,
                               const Step& /*step*/) {
  Uniform uniform(static_cast<std::uint64_t>(seed_));
  std::vector<double> keys(candidates.size());
  for (double& key : keys) key = uniform();
  return choice_of(candidates, largest(keys, count));
}

}  // namespace cairn::edges
