// SPDX-License-Identifier: BSD-3-Clause
#include "compared_runs.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "json_access.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

double number_at(const json::array& list, std::size_t k) {
  return k < list.size() && list[k].is_number() ? list[k].to_number<double>() : kNone;
}

std::vector<MapSample> samples_of(const json::value& run) {
  std::vector<MapSample> samples;
  const json::array& distance = list(run, "samples.distance");
  for (std::size_t k = 0; k < distance.size(); ++k) {
    MapSample sample{.distance = number_at(distance, k),
                     .coverage = number_at(list(run, "samples.coverage"), k),
                     .error = number_at(list(run, "samples.map_error"), k),
                     .against = {}};
    const double seen = number_at(list(run, "samples.seen"), k);
    if (std::isfinite(seen))
      sample.against =
          MapTruth{.floor = 0.0,
                   .seen = seen,
                   .free_wrong = number_at(list(run, "samples.free_wrong"), k),
                   .occupied_wrong = number_at(list(run, "samples.occupied_wrong"), k)};
    samples.push_back(sample);
  }
  return samples;
}

ComparedRun run_of(const json::value& said) {
  ComparedRun run;
  run.seed = static_cast<std::uint64_t>(number(said, "seed"));
  const std::string end = text(said, "end");
  run.why = text(said, "why");
  for (const ExplorationEnd known :
       {ExplorationEnd::finished, ExplorationEnd::limit, ExplorationEnd::stuck}) {
    if (end != to_string(known)) continue;
    run.end = known;
    run.done = true;
  }
  for (const ExplorationMeasure& measure : exploration_measures()) {
    const std::string group = measure.is_time ? "measured_seconds." : "measures.";
    run.measures.*measure.member = number(said, group + std::string(measure.name));
  }
  run.samples = samples_of(said);
  return run;
}

const ExplorationMeasure* measure_named(std::string_view name) {
  const auto all = exploration_measures();
  const auto found = std::ranges::find(all, name, &ExplorationMeasure::name);
  return found == all.end() ? nullptr : &*found;
}

/// The method's measure with that seed.
double value_of(const ExploreMethod& method, std::uint64_t seed,
                const ExplorationMeasure& measure) {
  const auto run = std::ranges::find(method.runs, seed, &ComparedRun::seed);
  return run != method.runs.end() && run->done ? run->measures.*measure.member : kNone;
}

MeanInterval at_equal_coverage(const ExploreMethod& method, const ExploreMethod& reference,
                               MapQuality quality) {
  std::vector<ComparedRun> both = reference.runs;
  for (ComparedRun run : method.runs) {
    run.explorer = 1;
    both.push_back(std::move(run));
  }
  return difference_at_equal_coverage(both, 1, 0, quality);
}

}  // namespace

std::vector<ExploreMethod> explore_methods(const json::array& entries) {
  std::vector<ExploreMethod> methods;
  for (const json::value& entry : entries) {
    ExploreMethod method{
        .name = text(entry, "method"), .problem = text(entry, "error"), .runs = {}};
    if (member(entry, "missing")) method.problem = "not in this build";
    for (const json::value& run : list(entry, "report.runs")) method.runs.push_back(run_of(run));
    methods.push_back(std::move(method));
  }
  return methods;
}

MeanInterval mean_of(const ExploreMethod& method, std::string_view measure) {
  const ExplorationMeasure* of = measure_named(measure);
  if (!of) return mean_interval({});
  return mean_interval(values_of(method.runs, 0, *of));
}

MeanInterval difference_of(const ExploreMethod& method, const ExploreMethod& reference,
                           std::string_view measure, double factor) {
  if (measure == kMapErrorAtCoverage)
    return at_equal_coverage(method, reference, MapQuality::contradicted);
  if (measure == kWrongAtSeen) return at_equal_coverage(method, reference, MapQuality::wrong);
  const ExplorationMeasure* of = measure_named(measure);
  std::vector<double> values, references;
  for (const ComparedRun& run : method.runs) {
    if (!of) break;
    values.push_back(value_of(method, run.seed, *of));
    references.push_back(factor * value_of(reference, run.seed, *of));
  }
  return paired_difference(values, references);
}

std::string ends_of(const ExploreMethod& method) {
  std::map<std::string, int> counts;
  for (const ComparedRun& run : method.runs)
    ++counts[run.done ? std::string(to_string(run.end)) : "failed"];
  std::string text;
  for (const auto& [end, count] : counts)
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, end);
  return text.empty() ? method.problem : text;
}

}  // namespace cairn::performance
