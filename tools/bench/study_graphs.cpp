// SPDX-License-Identifier: BSD-3-Clause
// The main comparison, and one thread against two.
#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <boost/json/array.hpp>

#include "json_access.hpp"
#include "statistics.hpp"
#include "studies.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;

const std::vector<std::string> kTenIterations{"--iterations", "10", "--tolerance", "0"};

// Settings that were this much slower than the best of their family when scouting are not measured.
constexpr double kNearlyBest = 1.25;
constexpr std::size_t kMostOfAFamily = 2;

/// Ceres has no Gauss-Newton: its Levenberg-Marquardt with next to no damping is that, except that
/// it refuses steps that raise chi2.
Contestants all_settings(const Bench& bench) {
  std::vector<std::string> solvers{bench.ours};
  for (const char* mode : {"simplicial", "supernodal"}) {
    for (const char* ordering : {"amd", "metis", "nesdis"})
      solvers.push_back(fmt::format("cholmod:mode={},ordering={}", mode, ordering));
  }
  std::vector<std::string> ceres;
  for (const char* library : {"suite_sparse", "cx_sparse", "eigen_sparse"})
    ceres.push_back(fmt::format("ceres:sparse_library={},initial_radius=1e16", library));
  return {"gauss_newton", bench.cairn.accepted_solvers(solvers),
          bench.cairn.accepted_optimizers(ceres)};
}

/// "cholmod" of "cholmod:mode=simplicial".
std::string family(const std::string& spec) { return spec.substr(0, spec.find(':')); }

/// A configuration as it was asked for.
std::string spec_of(const json::value& configuration) {
  const std::string optimizer = text(configuration, "optimizer");
  return family(optimizer) == "ceres" ? optimizer : text(configuration, "linear_solver");
}

/// One round over all settings tells which of each family are worth measuring.
Contestants nearly_best(const json::value& scouted, const Contestants& all) {
  std::map<std::string, std::vector<std::pair<double, std::string>>> families;
  for (const json::value& c : list(scouted, "configurations")) {
    const double seconds = number(c, "seconds.per_iteration");
    const std::string spec = spec_of(c);
    if (std::isfinite(seconds) && spec != all.linear_solvers.front())
      families[family(spec)].emplace_back(seconds, spec);
  }
  // Ours first: it is what the others are compared with.
  Contestants chosen{all.optimizer, {all.linear_solvers.front()}, {}};
  for (auto& [name, settings] : families) {
    std::sort(settings.begin(), settings.end());
    for (std::size_t k = 0; k < std::min(settings.size(), kMostOfAFamily); ++k) {
      if (settings[k].first > kNearlyBest * settings.front().first) break;
      (name == "ceres" ? chosen.complete : chosen.linear_solvers).push_back(settings[k].second);
    }
  }
  return chosen;
}

/// What scouting found, in short.
json::array scouting_notes(const json::value& scouted) {
  json::array notes;
  for (const json::value& c : list(scouted, "configurations")) {
    json::object note{
        {"setting", spec_of(c)}, {"seconds_per_iteration", nullptr}, {"error", text(c, "error")}};
    if (const json::value* seconds = member(c, "seconds.per_iteration"))
      note["seconds_per_iteration"] = *seconds;
    notes.push_back(std::move(note));
  }
  return notes;
}

json::object measure_graph(const Bench& bench, const DataSet& set, const Contestants& all,
                           int threads) {
  std::vector<std::string> scouting = kTenIterations;
  scouting.emplace_back("--no-memory");
  tell(fmt::format("  scouting, threads: {}", threads));
  const json::value scouted = bench.cairn.bench(set, all, threads, 1, scouting);
  const json::value& first = list(scouted, "graphs").front();
  tell(fmt::format("  measuring, threads: {}", threads));
  const json::value report =
      bench.cairn.bench(set, nearly_best(first, all), threads, bench.rounds, kTenIterations);
  return {{"name", set.name},
          {"generated", set.generated()},
          {"threads", threads},
          {"machine", *member(report, "machine")},
          {"build", *member(report, "build")},
          {"scouted", scouting_notes(first)},
          {"measured", list(report, "graphs").front()}};
}

/// Seconds of one iteration, and of its factorisation, in every run of a report.
struct Samples {
  std::vector<double> iteration, factorize;

  void add(const json::value& report) {
    const json::value& configuration =
        list(list(report, "graphs").front(), "configurations").front();
    for (const json::value& run : list(configuration, "runs")) {
      const double iterations = number(run, "iterations");
      iteration.push_back(number(run, "seconds.total") / iterations);
      factorize.push_back(number(run, "seconds.factorize") / iterations);
    }
  }
  json::object medians() const {
    return {{"iteration", median(iteration)}, {"factorize", median(factorize)}};
  }
};

}  // namespace

void study_graphs(const Bench& bench, const Keep& keep) {
  const Contestants all = all_settings(bench);
  for_each_set("graphs", pose_graphs(bench.data, bench.quick), [&](const DataSet& set) {
    for (const int threads : {1, 2}) keep(measure_graph(bench, set, all, threads));
  });
}

void study_threads(const Bench& bench, const Keep& keep) {
  std::vector<std::string> arguments = kTenIterations;
  arguments.emplace_back("--no-memory");
  constexpr int kRunsAProcess = 2;  // the first is colder
  for_each_set("threads", thread_sets(bench.data, bench.quick), [&](const DataSet& set) {
    Samples one, two;
    // In turn, so that what the machine does besides meets both alike.
    for (int round = 0; round < bench.rounds; ++round) {
      for (const int threads : {1, 2}) {
        (threads == 1 ? one : two)
            .add(bench.cairn.bench(set, {"gauss_newton", {bench.ours}, {}}, threads, kRunsAProcess,
                                   arguments));
      }
    }
    keep({{"name", set.name}, {"one", one.medians()}, {"two", two.medians()}});
  });
}

}  // namespace cairn::performance
