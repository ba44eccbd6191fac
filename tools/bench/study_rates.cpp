// SPDX-License-Identifier: BSD-3-Clause
// How near the factorisation comes to what the machine can do.
#include <algorithm>

#include <fmt/format.h>

#include "dense_rates.hpp"
#include "json_access.hpp"
#include "statistics.hpp"
#include "studies.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;

/// The rate of dgemm, measured again beside every graph: a virtual machine's speed drifts.
json::value dense_rate() {
  const std::optional<double> rate = dgemm_rate();
  return rate ? json::value(*rate) : json::value(nullptr);
}

json::object measure_rate(const Bench& bench, const DataSet& set) {
  const json::value before = dense_rate();
  const json::value report =
      bench.cairn.bench(set, {"gauss_newton", {bench.ours}, {}}, 1, bench.rounds,
                        {"--iterations", "10", "--tolerance", "0", "--no-memory"});
  const json::value after = dense_rate();
  const json::value& ours = list(list(report, "graphs").front(), "configurations").front();
  std::vector<double> factorize;
  for (const json::value& run : list(ours, "runs"))
    factorize.push_back(number(run, "seconds.factorize") / number(run, "iterations"));
  json::object entry{{"name", set.name},
                     {"solver", *member(ours, "solver")},
                     {"factorize", median(factorize)},
                     {"dgemm", nullptr},
                     {"bandwidth", triad_bandwidth()}};
  if (before.is_number() && after.is_number())
    entry["dgemm"] = std::max(before.to_number<double>(), after.to_number<double>());
  return entry;
}

}  // namespace

void study_rates(const Bench& bench, const Keep& keep) {
  for_each_set("rates", rate_sets(bench.data, bench.quick),
               [&](const DataSet& set) { keep(measure_rate(bench, set)); });
}

}  // namespace cairn::performance
