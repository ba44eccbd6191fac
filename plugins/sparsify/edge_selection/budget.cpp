// SPDX-License-Identifier: BSD-3-Clause
#include "budget.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <set>
#include <utility>

namespace cairn::edges {

std::vector<int> largest(std::span<const double> weights, int count) {
  std::vector<int> order(weights.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, std::greater{}, [&](int k) { return weights[k]; });
  order.resize(static_cast<std::size_t>(count));
  std::ranges::sort(order);
  return order;
}

std::vector<int> systematic_sample(std::span<const double> weights, double u) {
  const auto count = std::llround(std::accumulate(weights.begin(), weights.end(), 0.0));
  std::vector<int> chosen;
  double sum = 0.0;
  for (std::size_t k = 0; k < weights.size(); ++k) {
    sum += weights[k];
    // Rounding of the sum must not take the last one.
    const bool last = k + 1 == weights.size();
    const double next = u + static_cast<double>(std::ssize(chosen));
    if (std::ssize(chosen) < count && (sum > next || last)) chosen.push_back(static_cast<int>(k));
  }
  return chosen;
}

double Uniform::operator()() {
  state_ += 0x9e3779b97f4a7c15U;
  std::uint64_t z = state_;
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
  return static_cast<double>((z ^ (z >> 31U)) >> 11U) * 0x1p-53;
}

namespace {

/// The tangent c + gᵀw of a concave function at some weights, or a mean of several: no less than
/// the function anywhere.
struct Tangent {
  double constant = 0.0;
  std::vector<double> gradient;

  void average_in(const Tangent& other, double part) {
    constant += part * (other.constant - constant);
    for (std::size_t k = 0; k < gradient.size(); ++k)
      gradient[k] += part * (other.gradient[k] - gradient[k]);
  }
};

/// The choice with the largest value of a tangent, and that value.
struct Vertex {
  Vertex(const Tangent& tangent, int budget)
      : weights(tangent.gradient.size(), 0.0), value(tangent.constant) {
    for (const int k : largest(tangent.gradient, budget)) {
      weights[static_cast<std::size_t>(k)] = 1.0;
      value += tangent.gradient[static_cast<std::size_t>(k)];
    }
  }
  std::vector<double> weights;
  double value;
};

}  // namespace

std::optional<Relaxed> maximize_within_budget(const ConcaveFunction& f, int size, int budget,
                                              int iterations, double tolerance,
                                              const EdgeSelection::Step& step) {
  const auto n = static_cast<std::size_t>(size);
  std::vector<double> w(n, static_cast<double>(budget) / size);
  Tangent here{.gradient = std::vector<double>(n)}, mean = here;
  Relaxed best{.value = -std::numeric_limits<double>::infinity(),
               .bound = std::numeric_limits<double>::infinity()};
  for (int t = 0; t < iterations; ++t) {
    if (step && !step(t, iterations)) return std::nullopt;
    const double value = f(w, here.gradient);
    here.constant = value - std::inner_product(w.begin(), w.end(), here.gradient.begin(), 0.0);
    const double part = 2.0 / (t + 2.0);
    mean.average_in(here, part);
    Vertex toward(here, budget);
    if (Vertex other(mean, budget); other.value < toward.value) toward = std::move(other);
    best.bound = std::min(best.bound, toward.value);
    if (value > best.value) {
      best.value = value;
      best.weights = w;
    }
    best.iterations = t + 1;
    if (best.bound - best.value <= tolerance * std::abs(best.value)) break;
    for (std::size_t k = 0; k < n; ++k) w[k] += part * (toward.weights[k] - w[k]);
  }
  return best;
}

std::optional<std::vector<int>> best_rounding(std::span<const double> weights, int count,
                                              const Rounding& how, const ValueOfChoice& value_of,
                                              const EdgeSelection::Step& step) {
  std::vector<int> best = largest(weights, count);
  double value = value_of(best);
  std::set<std::vector<int>> tried{best};
  Uniform uniform(static_cast<std::uint64_t>(how.seed));
  for (int k = 0; k < how.samples; ++k) {
    if (step && !step(k, how.samples)) return std::nullopt;
    std::vector<int> sample = systematic_sample(weights, uniform());
    if (!tried.insert(sample).second) continue;
    if (const double of_sample = value_of(sample); of_sample > value) {
      value = of_sample;
      best = std::move(sample);
    }
  }
  return best;
}

}  // namespace cairn::edges
