// SPDX-License-Identifier: BSD-3-Clause
// How long covariances take, beyond the factorisation that they need.
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "json_access.hpp"
#include "statistics.hpp"
#include "studies.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;

/// Solves for every column take seconds beyond so many variables; they are measured up to here.
constexpr double kMostSolved = 2000.0;

using Words = std::vector<std::string>;

/// Medians over fresh processes, so that no page of memory is there already.
struct Times {
  double factorize = NAN, marginals = NAN;
  json::value report;
};

Times measure(const Bench& bench, const DataSet& set, const Words& asked, int threads) {
  Times times;
  std::vector<double> factorize, marginals;
  for (int round = 0; round < bench.rounds; ++round) {
    Run run = bench.cairn.marginals(set, asked, threads, 0.0);
    if (run.report.is_null()) throw std::runtime_error(run.outcome.complaint);
    factorize.push_back(number(run.report, "seconds.factorize"));
    marginals.push_back(number(run.report, "seconds.marginals"));
    times.report = std::move(run.report);
  }
  times.factorize = median(factorize);
  times.marginals = median(marginals);
  return times;
}

json::object measure(const Bench& bench, const DataSet& set) {
  const auto with = [&](const std::string& solver, Words asked) {
    asked.insert(asked.end(), {"--linear-solver", solver});
    return asked;
  };
  const Words diagonal{"--diagonal"}, column{"--column", "last"};
  const Words both{"--diagonal", "--column", "last"};
  const Times one = measure(bench, set, with(bench.ours, both), 1);
  json::object entry{{"name", set.name},
                     {"graph", *member(one.report, "graph")},
                     {"solver", *member(one.report, "solver")},
                     {"factorize", one.factorize},
                     {"both", one.marginals},
                     {"diagonal", measure(bench, set, with(bench.ours, diagonal), 1).marginals},
                     {"column", measure(bench, set, with(bench.ours, column), 1).marginals},
                     {"two_threads", measure(bench, set, with(bench.ours, both), 2).marginals},
                     {"solves", nullptr}};
  const Words solvers = bench.cairn.accepted_solvers({"cholmod"});
  if (!solvers.empty() && number(one.report, "graph.variables") <= kMostSolved)
    entry["solves"] = measure(bench, set, with("cholmod", both), 1).marginals;
  return entry;
}

}  // namespace

void study_marginals(const Bench& bench, const Keep& keep) {
  for_each_set("marginals", marginals_sets(bench.data, bench.quick),
               [&](const DataSet& set) { keep(measure(bench, set)); });
}

}  // namespace cairn::performance
