// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/undetermined.hpp"

#include <algorithm>
#include <utility>

#include "cairn/graph/free_directions.hpp"

namespace cairn {

void note_what_is_free(const Graph& graph, std::vector<std::string>& notes) {
  std::string sentence = find_free_directions(graph).describe(graph);
  const auto has_it = [&](const std::string& note) {
    return note.find(sentence) != std::string::npos;
  };
  if (!sentence.empty() && std::ranges::none_of(notes, has_it))
    notes.push_back(std::move(sentence));
}

}  // namespace cairn
