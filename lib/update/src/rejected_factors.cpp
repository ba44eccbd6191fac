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

RejectedFactors rejected_factors(const Graph& graph) {
  RejectedFactors result;
  if (!graph.has_losses()) return result;
  const std::vector<double> norms = squared_norms(graph);
  const std::vector<bool> loops = loop_closures(graph);
  for (int f = 0; f < graph.factor_count(); ++f) {
    const Loss* loss = graph.loss(f);
    if (!loss) continue;
    double weight = 1.0;
    loss->evaluate({&norms[f], 1}, {}, {&weight, 1});
    const bool rejected = weight < kRejected;
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
