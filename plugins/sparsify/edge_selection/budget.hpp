// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "cairn/sparsification/edge_selection.hpp"

namespace cairn::edges {

/// A concave function of weights and a supergradient there.
using ConcaveFunction =
    std::function<double(std::span<const double> weights, std::span<double> gradient)>;

struct Relaxed {
  std::vector<double> weights{};  ///< the best found
  double value = 0.0;             ///< of the function there
  double bound = 0.0;             ///< no weights within the budget have a larger value
  int iterations = 0;
};

/// Maximises f over {0 ≤ w ≤ 1, Σ w = budget}, the convex hull of the choices of `budget` elements
/// of `size`, by the method of Frank and Wolfe (1956): each step goes 2/(t + 2) of the way to the
/// vertex with the largest value of a tangent. A tangent f(w_t) + g_tᵀ(w − w_t) is an upper bound
/// of f, and so is a mean of several: of the tangent at w_t and the mean of all so far (with the
/// weights of the steps) that with the lower bound is taken. The mean makes the method converge
/// where f has kinks, as the algebraic connectivity has where eigenvalues meet; elsewhere the last
/// one is faster. Ends after `iterations`, or where bound − value ≤ tolerance · |value|. None if
/// `step` ends it.
std::optional<Relaxed> maximize_within_budget(const ConcaveFunction& f, int size, int budget,
                                              int iterations, double tolerance,
                                              const EdgeSelection::Step& step);

/// The elements with the largest weights, rising; of equal weights those with smaller numbers.
std::vector<int> largest(std::span<const double> weights, int count);

/// A random choice, rising, of which element k is a part with the probability w_k: systematic
/// sampling (Madow 1949). Σ w, which is rounded to a whole number, elements; 0 ≤ w ≤ 1, 0 ≤ u < 1.
std::vector<int> systematic_sample(std::span<const double> weights, double u);

/// How weights are rounded to choices.
struct Rounding {
  int samples = 20;  ///< random ones, besides the nearest
  std::int64_t seed = 1;
};
using ValueOfChoice = std::function<double(const std::vector<int>& numbers)>;

/// The best of the choice of the `count` largest weights and of systematic samples (Doherty, Rosen
/// and Leonard 2022). None if `step` ends it.
std::optional<std::vector<int>> best_rounding(std::span<const double> weights, int count,
                                              const Rounding& how, const ValueOfChoice& value_of,
                                              const EdgeSelection::Step& step);

/// A portable generator of numbers in [0, 1) (splitmix64): the same on every machine.
class Uniform {
 public:
  explicit Uniform(std::uint64_t seed) : state_(seed) {}
  double operator()();

 private:
  std::uint64_t state_;
};

}  // namespace cairn::edges
