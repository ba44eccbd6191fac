// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/rejected_factors.hpp"

#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/graph/factor_selector.hpp"

namespace cairn {
namespace {

constexpr double kRejected = 0.01;  // of the weight without a loss

/// "3 of 120 loop closures"
std::string counted(std::int64_t rejected, std::int64_t all, std::string_view what) {
  return fmt::format("{} of {} {}{}", rejected, all, what, all == 1 ? "" : "s");
}

}  // namespace

std::vector<double> loss_weights(const Graph& graph) {
  std::vector<double> weights(static_cast<std::size_t>(graph.factor_count()), 1.0);
  if (!graph.has_losses()) return weights;
  const std::vector<double> norms = squared_norms(graph);
  for (std::size_t f = 0; f < weights.size(); ++f) {
    if (const Loss* loss = graph.loss(static_cast<int>(f)))
      loss->evaluate({&norms[f], 1}, {}, {&weights[f], 1});
  }
  return weights;
}

RejectedFactors rejected_factors(const Graph& graph) {
  RejectedFactors result;
  if (!graph.has_losses()) return result;
  const std::vector<double> weights = loss_weights(graph);
  const std::vector<bool> loops = loop_closures(graph);
  for (int f = 0; f < graph.factor_count(); ++f) {
    if (!graph.loss(f)) continue;
    const bool rejected = weights[f] < kRejected;
    if (rejected) result.positions.push_back(f);
    ++(loops[f] ? result.loops : result.others);
    (loops[f] ? result.rejected_loops : result.rejected_others) += rejected;
  }
  return result;
}

std::string in_words(const RejectedFactors& of) {
  if (of.rejected_loops + of.rejected_others == 0) return {};
  std::string text;
  if (of.rejected_loops > 0) text = counted(of.rejected_loops, of.loops, "loop closure");
  if (of.rejected_others > 0) {
    const char* what = of.loops > 0 ? "other factor" : "factor";
    text += (text.empty() ? "" : " and ") + counted(of.rejected_others, of.others, what);
  }
  text = fmt::format("the loss leaves {} less than 1 % of their weight", text);
  if (!of.nearly_all_loops()) return text;
  return text +
         ": the estimate is nearly that without loop closures, which is hardly the right one if "
         "most "
         "of them are right; a larger scale of the loss, or one that grows (cauchy), uses them";
}

void note_rejected(const Graph& graph, UpdateReport& report) {
  const RejectedFactors rejected = rejected_factors(graph);
  std::string sentence = in_words(rejected);
  if (rejected.nearly_all_loops()) {
    report.doubt(std::move(sentence));
  } else if (!sentence.empty()) {
    report.notes.push_back(std::move(sentence));
  }
}

}  // namespace cairn
