// SPDX-License-Identifier: BSD-3-Clause
#include "relaxed_choice.hpp"

#include <algorithm>
#include <cstddef>
#include <optional>

namespace cairn::edges {

EdgeChoice choice_of(std::span<const int> candidates, const std::vector<int>& numbers) {
  EdgeChoice choice;
  for (const int k : numbers) choice.stay.push_back(candidates[static_cast<std::size_t>(k)]);
  std::ranges::sort(choice.stay);
  return choice;
}

EdgeChoice interrupted_choice() { return {.complete = false}; }

RelaxedChoice relaxed_choice(std::span<const int> candidates, int count,
                             const RelaxationOptions& options, const ConcaveFunction& f,
                             const EdgeSelection::Step& step) {
  const int total = options.iterations + options.rounding.samples;
  const auto from = [&](int begin) {
    return [&step, begin, total](int done, int) { return !step || step(begin + done, total); };
  };
  const std::optional<Relaxed> relaxed =
      maximize_within_budget(f, static_cast<int>(std::ssize(candidates)), count, options.iterations,
                             options.tolerance, from(0));
  if (!relaxed) return {interrupted_choice(), 0.0};
  const auto value_of = [&](const std::vector<int>& numbers) {
    std::vector<double> w(candidates.size(), 0.0);
    for (const int k : numbers) w[static_cast<std::size_t>(k)] = 1.0;
    return f(w, {});
  };
  const std::optional<std::vector<int>> numbers =
      best_rounding(relaxed->weights, count, options.rounding, value_of, from(options.iterations));
  if (!numbers) return {interrupted_choice(), 0.0};
  return {choice_of(candidates, *numbers), relaxed->bound};
}

}  // namespace cairn::edges
