// SPDX-License-Identifier: BSD-3-Clause
#include "lazy_greedy.hpp"

#include <queue>

namespace cairn::edges {
namespace {

struct Bound {
  double gain;
  int element;
  int added;  ///< how many had been added when it was computed

  /// Of equal gains the smaller number comes first.
  bool operator<(const Bound& other) const {
    return gain != other.gain ? gain < other.gain : element > other.element;
  }
};

}  // namespace

std::optional<std::vector<int>> lazy_greedy(int size, int count, const Increments& function,
                                            const EdgeSelection::Step& step) {
  std::priority_queue<Bound> queue;
  for (int k = 0; k < size; ++k) {
    if (step && !step(0, count)) return std::nullopt;
    queue.push({function.gain(k), k, 0});
  }
  std::vector<int> chosen;
  while (static_cast<int>(std::ssize(chosen)) < count && !queue.empty()) {
    const int added = static_cast<int>(std::ssize(chosen));
    if (step && !step(added, count)) return std::nullopt;
    Bound best = queue.top();
    queue.pop();
    if (best.added < added) {
      queue.push({function.gain(best.element), best.element, added});
      continue;
    }
    function.add(best.element);
    chosen.push_back(best.element);
  }
  return chosen;
}

}  // namespace cairn::edges
