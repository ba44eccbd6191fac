// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/text/spelling.hpp"

#include <algorithm>
#include <cctype>
#include <tuple>
#include <vector>

#include <fmt/format.h>

namespace cairn {
namespace {

/// Longer words are no slips of the pen; comparing them takes time in proportion to their length.
constexpr std::size_t kLongestWord = 100;

char lower(char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); }

/// Optimal string alignment distance: insert, delete, replace, swap of neighbours.
int edit_distance(std::string_view a, std::string_view b) {
  const std::size_t columns = b.size() + 1;
  std::vector<int> before_last(columns), last(columns), current(columns);
  for (std::size_t j = 0; j < columns; ++j) last[j] = static_cast<int>(j);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    current[0] = static_cast<int>(i);
    for (std::size_t j = 1; j < columns; ++j) {
      const bool same = lower(a[i - 1]) == lower(b[j - 1]);
      current[j] = std::min({last[j] + 1, current[j - 1] + 1, last[j - 1] + (same ? 0 : 1)});
      if (i > 1 && j > 1 && lower(a[i - 1]) == lower(b[j - 2]) &&
          lower(a[i - 2]) == lower(b[j - 1]))
        current[j] = std::min(current[j], before_last[j - 2] + 1);
    }
    std::swap(before_last, last);
    std::swap(last, current);
  }
  return last[b.size()];
}

/// "lm" of levenberg_marquardt, "cholesky" of block_cholesky, "solver" of linear-solver.
bool abbreviates(std::string_view word, std::string_view candidate) {
  const auto parts = [](char c) { return c == '_' || c == '-'; };
  std::string initials;
  for (std::size_t k = 0; k < candidate.size(); ++k)
    if (!parts(candidate[k]) && (k == 0 || parts(candidate[k - 1]))) initials += candidate[k];
  while (word.starts_with('-')) word.remove_prefix(1);
  return word.size() > 1 &&
         (word == initials || (word.size() > 3 && candidate.find(word) != std::string_view::npos));
}

}  // namespace

std::string nearest_spelling(std::string_view word, std::span<const std::string> candidates) {
  std::string best;
  if (word.size() > kLongestWord) return best;
  for (const std::string& candidate : candidates)  // EDGE_SE3 is EDGE_SE3:QUAT, not EDGE_SE2
    if (candidate.starts_with(word) && candidate[word.size()] == ':') return candidate;
  int best_distance = static_cast<int>(std::max<std::size_t>(2, word.size() / 3)) + 1;
  for (const std::string& candidate : candidates) {
    const int distance = edit_distance(word, candidate);
    if (distance < best_distance) std::tie(best_distance, best) = std::tie(distance, candidate);
  }
  if (!best.empty()) return best;
  for (const std::string& candidate : candidates)
    if (abbreviates(word, candidate)) return candidate;
  while (!word.empty()) {  // "num_iterations" is max_iterations
    const std::string_view part = word.substr(0, word.find_first_of("_-"));
    const auto has = [part](const std::string& s) { return s.find(part) != std::string::npos; };
    if (part.size() > 3 && std::ranges::count_if(candidates, has) == 1)
      return *std::ranges::find_if(candidates, has);
    word.remove_prefix(std::min(part.size() + 1, word.size()));
  }
  return best;
}

std::string what_is_on_offer(std::string_view word, std::span<const std::string> candidates) {
  if (candidates.empty()) return "; none is on offer";
  const std::string near = nearest_spelling(word, candidates);
  const std::string offer = fmt::format("on offer: {}", fmt::join(candidates, ", "));
  return near.empty() ? "; " + offer : fmt::format("; did you mean '{}'? ({})", near, offer);
}

}  // namespace cairn
