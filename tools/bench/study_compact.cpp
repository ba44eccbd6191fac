// SPDX-License-Identifier: BSD-3-Clause
// Compact pose SLAM on published and generated graphs, as in the tables of Ila et al. (2017).
#include <fmt/format.h>

#include "compact_runs.hpp"
#include "json_access.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;
using Words = std::vector<std::string>;

/// A run is given up after so many seconds, and repeated as long as all together take less than
/// this: the studies of `cairn compact` are to take half an hour.
constexpr double kLimit = 300.0, kEnough = 60.0;

json::object measure_set(const Bench& bench, const TruthfulSet& truthful) {
  const DataSet set = with_truth(bench, truthful);
  const CompactThresholds thresholds = find_compact_thresholds(bench, set);
  std::vector<Contestant> contestants = compact_contestants(thresholds, kLimit, kEnough);
  run_rounds(
      bench.quick ? 1 : bench.rounds, contestants,
      [&](const Contestant& c) { return run_compact(bench, set, c.arguments, c.limit); },
      compact_summary);
  const Contestant control{
      .name = "random",
      .arguments = {"--strategy", "rfpfl", "--thresholds", thresholds.refined.file.string()},
      .limit = kLimit};
  contestants.push_back(run_seeds(bench, set, control, bench.quick ? 2 : 5, [](int seed) {
    return Words{"--seed", fmt::format("{}", seed)};
  }));
  return {{"name", set.name},
          {"de_facto", truthful.truth == Truth::de_facto},
          {"refined", thresholds.refined.found},
          {"plain", thresholds.plain.found},
          {"by_rule", thresholds.by_rule.found},
          {"contestants", entries_of(contestants)}};
}

}  // namespace

void study_compact_sets(const Bench& bench, const Keep& keep) {
  for (const TruthfulSet& set : compact_sets(bench.data, bench.quick))
    attempt("compact: " + set.set.name, [&] { keep(measure_set(bench, set)); });
}

}  // namespace cairn::performance
