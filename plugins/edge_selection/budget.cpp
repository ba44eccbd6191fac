// SPDX-License-Identifier: BSD-3-Clause
#include "budget.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>

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

std::optional<Relaxed> maximize_within_budget(const ConcaveFunction& f, int size, int budget,
                                              int iterations, double tolerance,
                                              const EdgeSelection::Step& step) {
  const auto n = static_cast<std::size_t>(size);
  std::vector<double> w(n, static_cast<double>(budget) / size), gradient(n);
  Relaxed best{.value = -std::numeric_limits<double>::infinity(),
               .bound = std::numeric_limits<double>::infinity()};
  for (int t = 0; t < iterations; ++t) {
    if (step && !step(t, iterations)) return std::nullopt;
    const double value = f(w, gradient);
    std::vector<double> toward(n, 0.0);
    for (const int k : largest(gradient, budget)) toward[static_cast<std::size_t>(k)] = 1.0;
    double gap = 0.0;
    for (std::size_t k = 0; k < n; ++k) gap += gradient[k] * (toward[k] - w[k]);
    best.bound = std::min(best.bound, value + gap);
    if (value > best.value) {
      best.value = value;
      best.weights = w;
    }
    best.iterations = t + 1;
    if (best.bound - best.value <= tolerance * std::abs(best.value)) break;
    const double part = 2.0 / (t + 2.0);
    for (std::size_t k = 0; k < n; ++k) w[k] += part * (toward[k] - w[k]);
  }
  return best;
}

}  // namespace cairn::edges
