// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/sparsifier.hpp"

#include <algorithm>

#include <fmt/core.h>

#include "cairn/runtime/result_fields.hpp"
#include "cairn/sparsification/selection.hpp"

namespace cairn {

Sparsifier::~Sparsifier() = default;
NodeSelection::~NodeSelection() = default;

std::vector<int> NodeSelection::choose(const Graph& graph, std::span<const int> nodes,
                                       Sparsifier& sparsifier, int count) {
  std::vector<int> chosen = select(graph, nodes, sparsifier);
  chosen.resize(std::min(chosen.size(), static_cast<std::size_t>(std::max(count, 0))));
  return chosen;
}

SparsificationSeconds& SparsificationSeconds::operator+=(const SparsificationSeconds& other) {
  total += other.total;
  marginalize += other.marginalize;
  covariance += other.covariance;
  topology += other.topology;
  recovery += other.recovery;
  return *this;
}

void Sparsification::note(const std::string& text, int applies) {
  if (text.empty()) return;
  const auto at = std::ranges::find(notes, text, &SparsificationNote::text);
  if (at == notes.end()) {
    notes.push_back({text, applies});
  } else {
    at->problems += applies;
  }
}

std::vector<std::string> Sparsification::note_lines() const {
  std::vector<std::string> lines;
  for (const SparsificationNote& note : notes)
    lines.push_back(fmt::format("{} of {} blankets: {}", note.problems, problems, note.text));
  return lines;
}

void Sparsification::add(const Sparsification& later) {
  const int all = problems + later.problems;
  if (all > 0) mean_blanket = (problems * mean_blanket + later.problems * later.mean_blanket) / all;
  problems = all;
  largest_blanket = std::max(largest_blanket, later.largest_blanket);
  refused.insert(refused.end(), later.refused.begin(), later.refused.end());
  kld += later.kld;
  not_converged += later.not_converged;
  for (const SparsificationNote& later_note : later.notes)
    note(later_note.text, later_note.problems);
  seconds += later.seconds;
}

void apply(const Sparsification& change, Graph& graph) {
  std::vector<bool> factors(graph.factor_count()), variables(graph.variable_count());
  for (const int f : change.removed_factors) factors[f] = true;
  for (const int v : change.removed_variables) variables[v] = true;
  graph.remove(factors, variables);
  for (const Factor& factor : change.factors) {
    std::vector<int> on;
    for (const Id id : factor.variables) on.push_back(graph.find(id).value());
    graph.add_factor(factor.type, on, factor.measurement, factor.information);
  }
}

ResultFields<SparsificationSeconds> SparsificationSeconds::fields() {
  using S = SparsificationSeconds;
  return ResultFields<S>()
      .figure("total", &S::total, "s", "of taking nodes out")
      .figure("marginalize", &S::marginalize, "s", "solving and marginalising local problems")
      .figure("covariance", &S::covariance, "s", "of neighbours in the whole graph, for fit")
      .label("covariance in the graph")
      .figure("topology", &S::topology, "s", "choosing factors")
      .figure("recovery", &S::recovery, "s", "computing them")
      .details();
}

ResultFields<RefusedNode> RefusedNode::fields() {
  return ResultFields<RefusedNode>()
      .figure("node", &RefusedNode::node, "its id")
      .figure("reason", &RefusedNode::reason, "why it could not leave");
}

ResultFields<SparsificationNote> SparsificationNote::fields() {
  return ResultFields<SparsificationNote>()
      .figure("text", &SparsificationNote::text, "a sentence")
      .figure("problems", &SparsificationNote::problems, "how many problems it is about");
}

ResultFields<Sparsification> Sparsification::fields() {
  using S = Sparsification;
  return ResultFields<S>()
      .figure("problems.count", &S::problems, "sets of neighbours that got new factors")
      .attribute("problems")
      .figure("problems.mean_blanket", &S::mean_blanket, "neighbours in a set, on average")
      .round("{:.2f}")
      .attribute("mean_blanket")
      .figure("problems.largest_blanket", &S::largest_blanket, "neighbours in a set, at most")
      .attribute("largest_blanket")
      .figure("problems.kld", &S::kld, "nats", "divergences of all sets, added up")
      .attribute("kld_of_problems")
      .figure("problems.not_converged", &S::not_converged, "sets whose factors have not converged")
      .attribute("not_converged")
      .figure("problems.notes", &S::notes, "what should be known of some of the sets")
      .attribute("notes_on_problems")
      .figure("refused", &S::refused, "chosen variables that could not leave")
      .part("seconds", &S::seconds)
      .details();
}

}  // namespace cairn
