// SPDX-License-Identifier: BSD-3-Clause
#include "explore_claims.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "tables.hpp"

namespace cairn::performance {
namespace {

/// `less` has less of a measure than `factor` times what `more` has, on average.
struct Inequality {
  std::string_view measure, less, more;
  double factor = 1.0;
};

struct Claim {
  std::string_view part, text;
  std::vector<Inequality> holds;
};

/// Neither has `factor` times what the other has.
std::vector<Inequality> similar(std::string_view measure, std::vector<std::string_view> methods,
                                double factor) {
  std::vector<Inequality> all;
  for (const std::string_view a : methods) {
    for (const std::string_view b : methods)
      if (a != b) all.push_back({measure, a, b, factor});
  }
  return all;
}

std::vector<Claim> all_claims() {
  constexpr std::string_view kFrontier = "frontier", kGradient = "ede_gradient",
                             kEde = "ede_rrt_star", kHeuristic = "heuristic", kD = "drrt_star",
                             kE = "errt_star";
  constexpr std::string_view kMap = "map_entropy", kTrajectory = "trajectory_entropy",
                             kTime = "seconds", kLoops = "loops", kCoverage = "coverage";
  return {{"cave", "all three end with similar map entropy (within 10 %)",
           similar(kMap, {kFrontier, kGradient, kEde}, 1.1)},
          {"cave",
           "both EDE have a lower trajectory entropy",
           {{kTrajectory, kGradient, kFrontier}, {kTrajectory, kEde, kFrontier}}},
          {"cave", "all three close a similar number of loops (within 50 %)",
           similar(kLoops, {kFrontier, kGradient, kEde}, 1.5)},
          {"cave",
           "frontier-based exploration collides most",
           {{"collisions", kGradient, kFrontier}, {"collisions", kEde, kFrontier}}},
          {"cave",
           "both EDE take less time",
           {{kTime, kGradient, kFrontier}, {kTime, kEde, kFrontier}}},
          {"freiburg",
           "gradient descent is trapped at doors (covers less than 70 %)",
           {{kCoverage, kGradient, kFrontier, 0.7}, {kCoverage, kGradient, kEde, 0.7}}},
          {"freiburg",
           "EDE with RRT* has lower entropies of map and trajectory than frontier",
           {{kMap, kEde, kFrontier}, {kTrajectory, kEde, kFrontier}}},
          {"freiburg",
           "EDE with RRT* takes longest",
           {{kTime, kFrontier, kEde}, {kTime, kGradient, kEde}}},
          {"action",
           "dRRT* and frontier have the lowest map entropy",
           {{kMap, kD, kE}, {kMap, kD, kEde}, {kMap, kFrontier, kE}, {kMap, kFrontier, kEde}}},
          {"action",
           "the heuristic has the highest map entropy and covers least",
           {{kMap, kFrontier, kHeuristic},
            {kMap, kEde, kHeuristic},
            {kMap, kD, kHeuristic},
            {kMap, kE, kHeuristic},
            {kCoverage, kHeuristic, kE},
            {kCoverage, kHeuristic, kEde}}},
          {"action",
           "the heuristic has the lowest trajectory entropy",
           {{kTrajectory, kHeuristic, kFrontier},
            {kTrajectory, kHeuristic, kEde},
            {kTrajectory, kHeuristic, kD},
            {kTrajectory, kHeuristic, kE}}},
          {"action",
           "frontier has the highest trajectory entropy",
           {{kTrajectory, kEde, kFrontier},
            {kTrajectory, kD, kFrontier},
            {kTrajectory, kE, kFrontier}}},
          {"action",
           "the heuristic closes most loops, eRRT* nearly twice as many as dRRT* (1.5 times)",
           {{kLoops, kE, kHeuristic}, {kLoops, kD, kE, 1.0 / 1.5}}},
          {"action", "EDE takes as long as frontier (within 50 %)",
           similar(kTime, {kFrontier, kEde}, 1.5)},
          {"action",
           "dRRT* takes longer than frontier, eRRT* than dRRT*, the heuristic longest",
           {{kTime, kFrontier, kD}, {kTime, kD, kE}, {kTime, kE, kHeuristic}}},
          {"action",
           "at equal coverage dRRT* and eRRT* have less map error than frontier",
           {{kMapErrorAtCoverage, kD, kFrontier}, {kMapErrorAtCoverage, kE, kFrontier}}},
          {"action",
           "eRRT* has less map error than dRRT*, dRRT* covers more",
           {{"map_error", kE, kD}, {kCoverage, kE, kD}}},
          {"action",
           "not the thesis's: one of dRRT* and eRRT*, dRRT*, has fewer wrong cells than "
           "frontier at equal parts seen",
           {{kWrongAtSeen, kD, kFrontier}}},
          {"action", "and the other, eRRT*", {{kWrongAtSeen, kE, kFrontier}}}};
}

struct Verdict {
  bool known = true, seen = true, clear = true;
  std::string against, differences;
};

Verdict verdict_on(const Claim& claim, const std::vector<ExploreMethod>& methods) {
  Verdict verdict;
  const auto find = [&](std::string_view name) {
    return std::ranges::find(methods, name, &ExploreMethod::name);
  };
  for (const Inequality& one : claim.holds) {
    const auto less = find(one.less), more = find(one.more);
    const MeanInterval difference = less == methods.end() || more == methods.end()
                                        ? mean_interval({})
                                        : difference_of(*less, *more, one.measure, one.factor);
    if (difference.count == 0) {
      verdict.known = false;
      continue;
    }
    const std::string line =
        fmt::format("{}: {} − {}{} = {}", one.measure, one.less,
                    one.factor == 1.0 ? "" : fmt::format("{:.2f} · ", one.factor), one.more,
                    interval_text(difference, true));
    std::string& list = difference.mean < 0.0 ? verdict.differences : verdict.against;
    list += (list.empty() ? "" : "; ") + line;
    verdict.seen = verdict.seen && difference.mean < 0.0;
    verdict.clear = verdict.clear && difference.high() < 0.0;
  }
  return verdict;
}

}  // namespace

std::string claims_table(std::string_view part, const std::vector<ExploreMethod>& methods) {
  MarkdownTable table({"claim", "seen?", "differences that speak against it", "and for it"});
  for (const Claim& claim : all_claims()) {
    if (claim.part != part) continue;
    const Verdict verdict = verdict_on(claim, methods);
    const char* seen = !verdict.seen    ? "not seen"
                       : !verdict.known ? "not measured"
                       : verdict.clear  ? "seen, clear of zero"
                                        : "seen";
    table.add({std::string(claim.text), seen, verdict.against, verdict.differences});
  }
  return table.text();
}

}  // namespace cairn::performance
