// SPDX-License-Identifier: BSD-3-Clause
// Sparsification that keeps all poses: which loop closures stay.
#include <utility>

#include <fmt/format.h>

#include "sparsify_runs.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;

/// A run is given up after so many seconds; none is repeated, since times are far apart.
constexpr double kLimit = 600.0, kEnough = 1.0;
constexpr int kSeeds = 5;

Contestant contestant(const std::string& name, const std::string& selection) {
  return {.name = name, .arguments = {"--edges", selection}, .limit = kLimit, .enough = kEnough};
}

json::object measure_edges(const Bench& bench, const DataSet& set, const std::string& part) {
  std::vector<Contestant> contestants;
  for (const char* name : {"mac", "greedy_tree", "greedy_gain", "l1"})
    contestants.push_back(contestant(name, fmt::format("{}:part={}", name, part)));
  contestants.push_back(
      contestant("divergence", fmt::format("greedy_gain:part={},objective=divergence", part)));
  // Random choices are repeated with other seeds: the runs of one contestant.
  Contestant random = contestant("random", "");
  for (int seed = 1; seed <= kSeeds; ++seed) {
    std::vector<Contestant> one{
        contestant("random", fmt::format("random:part={},seed={}", part, seed))};
    sparsify_rounds(bench, set, one, 1);
    random.runs.insert(random.runs.end(), one.front().runs.begin(), one.front().runs.end());
  }
  sparsify_rounds(bench, set, contestants, 1);
  contestants.push_back(std::move(random));
  return {{"name", set.name}, {"part", part}, {"contestants", entries_of(contestants)}};
}

}  // namespace

void study_sparsify_edges(const Bench& bench, const Keep& keep) {
  for_each_set("sparsify, edges", edge_sets(bench.data, bench.quick), [&](const DataSet& set) {
    for (const char* part : {"0.1", "0.25", "0.5"}) keep(measure_edges(bench, set, part));
  });
}

}  // namespace cairn::performance
