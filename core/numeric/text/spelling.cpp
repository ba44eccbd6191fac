// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/text/spelling.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <numeric>
#include <tuple>

#include <fmt/format.h>

namespace cairn {
namespace {

/// Longer words are no slips of the pen; comparing them takes time in proportion to their length.
constexpr std::size_t kLongestWord = 100;

char lower(char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); }

/// Optimal string alignment distance: insert, delete, replace, swap of neighbours; `limit` if it is
/// that or more, which most pairs show after a few letters. `word` is lower case.
int edit_distance(std::string_view word, std::string_view candidate, int limit) {
  const auto columns = static_cast<int>(word.size()), size = static_cast<int>(candidate.size());
  if (std::abs(columns - size) >= limit) return limit;
  std::array<std::array<int, kLongestWord + 1>, 3> rows;  // the last three
  std::iota(rows[0].begin(), rows[0].begin() + columns + 1, 0);
  char letter_before = '\0';
  for (int i = 1; i <= size; ++i) {
    const auto &before_last = rows[(i + 1) % 3], &last = rows[(i + 2) % 3];
    auto& current = rows[i % 3];
    const char letter = lower(candidate[i - 1]);
    int least = current[0] = i;
    for (int j = 1; j <= columns; ++j) {
      const bool same = letter == word[j - 1];
      current[j] = std::min({last[j] + 1, current[j - 1] + 1, last[j - 1] + (same ? 0 : 1)});
      if (i > 1 && j > 1 && letter == word[j - 2] && letter_before == word[j - 1])
        current[j] = std::min(current[j], before_last[j - 2] + 1);
      least = std::min(least, current[j]);
    }
    if (least >= limit) return limit;  // nor will a swap, which looks two rows back and costs 1
    letter_before = letter;
  }
  return std::min(rows[size % 3][columns], limit);
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
  std::string lower_word(word);
  std::ranges::transform(lower_word, lower_word.begin(), lower);
  for (const std::string& candidate : candidates) {
    const int distance = edit_distance(lower_word, candidate, best_distance);
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
