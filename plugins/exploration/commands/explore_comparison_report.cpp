// SPDX-License-Identifier: BSD-3-Clause
#include "explore_comparison_report.hpp"

#include <algorithm>
#include <array>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "cairn/program/figures.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/table.hpp"
#include "floors.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

// Tables in the terminal --------------------------------------------------------------------------

/// The measures that have a row, with their titles.
void for_shown(const std::function<void(const std::string& title, std::size_t measure)>& use) {
  const std::vector<ResultField>& measures = exploration_measures();
  for (std::size_t k = 0; k < measures.size(); ++k)
    if (!measures[k].is_detail) use(title_of(measures[k]), k);
}

MeanInterval mean_of(const ExploreComparison& comparison, std::size_t explorer,
                     std::size_t measure) {
  return mean_interval(values_of(comparison.outcomes, explorer, measure));
}

MeanInterval difference_of(const ExploreComparison& comparison, std::size_t explorer,
                           std::size_t measure) {
  return paired_difference(values_of(comparison.outcomes, explorer, measure),
                           values_of(comparison.outcomes, 0, measure));
}

/// A table with a column for each explorer but the first ones.
Table table_of(const ExploreComparison& comparison, std::size_t first) {
  std::vector<Table::Column> columns{{"", Table::Align::left}};
  for (std::size_t e = first; e < comparison.explorers.size(); ++e)
    columns.push_back({comparison.explorers[e], Table::Align::right});
  return Table(std::move(columns));
}

/// A row of such a table.
void add_row(Table& table, const ExploreComparison& comparison, std::size_t first,
             std::string_view title, const std::function<std::string(std::size_t)>& cell) {
  std::vector<std::string> row{std::string(title)};
  for (std::size_t e = first; e < comparison.explorers.size(); ++e) row.push_back(cell(e));
  table.add(std::move(row));
}

Table means_table(const ExploreComparison& comparison) {
  Table table = table_of(comparison, 0);
  add_row(table, comparison, 0, "runs", [&](std::size_t e) {
    return fmt::format("{}",
                       std::ranges::count_if(comparison.outcomes, [&](const ComparedRun& run) {
                         return run.explorer == e && run.done;
                       }));
  });
  for_shown([&](const std::string& title, std::size_t measure) {
    add_row(table, comparison, 0, title,
            [&](std::size_t e) { return interval_text(mean_of(comparison, e, measure)); });
  });
  return table;
}

/// "-3.2 ± 1.1 *", the star where the interval is clear of zero.
std::string difference_text(const MeanInterval& difference) {
  return interval_text(difference, true) + (difference.excludes_zero() ? " *" : "");
}

Table differences_table(const ExploreComparison& comparison) {
  Table table = table_of(comparison, 1);
  for_shown([&](const std::string& title, std::size_t measure) {
    add_row(table, comparison, 1, title,
            [&](std::size_t e) { return difference_text(difference_of(comparison, e, measure)); });
  });
  const auto add_map_error = [&](const char* title, MapQuality quality) {
    add_row(table, comparison, 1, title, [&](std::size_t e) {
      return difference_text(difference_at_equal_coverage(comparison.outcomes, e, 0, quality));
    });
  };
  add_map_error("map error at equal coverage [m²]", MapQuality::contradicted);
  add_map_error("wrong cells, as much floor seen [m²]", MapQuality::wrong);
  return table;
}

/// How many runs of an explorer ended in each way.
std::map<std::string, int> ends_of(const ExploreComparison& comparison, std::size_t explorer) {
  std::map<std::string, int> ends;
  for (const ComparedRun& run : comparison.outcomes) {
    if (run.explorer != explorer) continue;
    const bool known = run.done || run.end == ExplorationEnd::interrupted;
    ++ends[known ? std::string(to_string(run.end)) : "failed"];
  }
  return ends;
}

std::string ends_text(const ExploreComparison& comparison) {
  Table table({{"", Table::Align::left}, {"", Table::Align::left}});
  for (std::size_t e = 0; e < comparison.explorers.size(); ++e) {
    std::vector<std::string> counts;
    for (const auto& [end, count] : ends_of(comparison, e))
      counts.push_back(fmt::format("{} {}", count, end));
    table.add({comparison.explorers[e], joined(counts, ", ")});
  }
  std::string text = table.text(false);
  for (const ComparedRun& run : comparison.outcomes) {
    if (run.done || run.end == ExplorationEnd::interrupted) continue;
    text += fmt::format("failed: {}, seed {}: {}\n", comparison.explorers[run.explorer], run.seed,
                        run.why);
  }
  return text;
}

/// A run in the table of `--csv`.
struct RunRow {
  const std::string& explorer;
  const ComparedRun& run;

  static ResultFields<RunRow> fields() {
    using R = RunRow;
    return ResultFields<R>()
        .figure(
            "explorer", [](const R& r) { return r.explorer; }, "as it was named")
        .figure(
            "seed", [](const R& r) { return r.run.seed; }, "of the run")
        .figure(
            "end", [](const R& r) { return r.run.done ? to_string(r.run.end) : "failed"; },
            "how it ended")
        .figure(
            "why", [](const R& r) { return r.run.why; }, "a sentence")
        .part([](const R& r) { return r.run.done ? &r.run.measures : nullptr; });
  }
};

// JSON --------------------------------------------------------------------------------------------

json::object interval_json(const MeanInterval& interval) {
  return {{"mean", number_json(interval.mean)},
          {"low", number_json(interval.low())},
          {"high", number_json(interval.high())},
          {"deviation", number_json(interval.deviation)},
          {"count", interval.count}};
}

/// {"measures": …, "measured_seconds": …} of intervals.
void put_intervals(json::object& report,
                   const std::function<MeanInterval(std::size_t measure)>& of) {
  json::object numbers, seconds;
  const std::vector<ResultField>& measures = exploration_measures();
  for (std::size_t k = 0; k < measures.size(); ++k)
    (is_time(measures[k]) ? seconds : numbers)[measures[k].name] = interval_json(of(k));
  report["measures"] = std::move(numbers);
  report["measured_seconds"] = std::move(seconds);
}

json::object explorer_json(const ExploreComparison& comparison, std::size_t e) {
  json::object report{{"explorer", comparison.explorers[e]}};
  json::object ends;
  for (const auto& [end, count] : ends_of(comparison, e)) ends[end] = count;
  report["ends"] = std::move(ends);
  put_intervals(report, [&](std::size_t measure) { return mean_of(comparison, e, measure); });
  if (e == 0) return report;
  json::object difference;
  put_intervals(difference,
                [&](std::size_t measure) { return difference_of(comparison, e, measure); });
  difference["map_error_at_equal_coverage"] = interval_json(
      difference_at_equal_coverage(comparison.outcomes, e, 0, MapQuality::contradicted));
  difference["wrong_at_equal_seen"] =
      interval_json(difference_at_equal_coverage(comparison.outcomes, e, 0, MapQuality::wrong));
  report["difference"] = std::move(difference);
  return report;
}

/// The error of the map along a run: as many numbers in each list.
json::object samples_json(const std::vector<MapSample>& samples) {
  json::object report;
  const auto add = [&](const char* name, const auto& number) {
    json::array& values = report[name].emplace_array();
    for (const MapSample& sample : samples) values.push_back(number_json(number(sample)));
  };
  const auto beside_truth = [](double MapTruth::*member) {
    return [member](const MapSample& sample) {
      return sample.against ? (*sample.against).*member : std::numeric_limits<double>::quiet_NaN();
    };
  };
  add("distance", [](const MapSample& sample) { return sample.distance; });
  add("coverage", [](const MapSample& sample) { return sample.coverage; });
  add("map_error", [](const MapSample& sample) { return sample.error; });
  add("seen", beside_truth(&MapTruth::seen));
  add("free_wrong", beside_truth(&MapTruth::free_wrong));
  add("occupied_wrong", beside_truth(&MapTruth::occupied_wrong));
  return report;
}

json::object run_json(const ExploreComparison& comparison, const ComparedRun& run) {
  json::object report{{"explorer", comparison.explorers[run.explorer]},
                      {"seed", run.seed},
                      {"end", run.done ? to_string(run.end) : "failed"},
                      {"why", run.why}};
  if (!run.done) return report;
  put_measures(report, run.measures);
  report["samples"] = samples_json(run.samples);
  report["notes"] = strings_json(run.notes);
  return report;
}

json::object table_json(const NumberTable& table) {
  json::object report;
  for (const NumberTable::Column& column : table.columns) {
    json::array values;
    for (const double value : column.values) values.push_back(number_json(value));
    report[column.name] = std::move(values);
  }
  return report;
}

// Curves ------------------------------------------------------------------------------------------

constexpr std::size_t kPlaces = 101;  // of a curve

std::vector<double> places_up_to(double largest) {
  std::vector<double> places(kPlaces);
  for (std::size_t k = 0; k < kPlaces; ++k)
    places[k] = largest * static_cast<double>(k) / static_cast<double>(kPlaces - 1);
  return places;
}

using CurveOf = std::function<RunCurve(const ComparedRun&)>;

double largest_x(const ExploreComparison& comparison, const CurveOf& of) {
  double largest = 0.0;
  for (const ComparedRun& run : comparison.outcomes) {
    if (!run.done) continue;
    for (const double x : of(run).x) largest = std::max(largest, x);
  }
  return largest;
}

/// The mean of each explorer's runs, where at least half of them are.
void add_means(NumberTable& table, const ExploreComparison& comparison, const std::string& name,
               const std::vector<double>& places, const CurveOf& of, BeyondEnd beyond) {
  for (std::size_t e = 0; e < comparison.explorers.size(); ++e) {
    std::vector<RunCurve> curves;
    for (const ComparedRun& run : comparison.outcomes)
      if (run.explorer == e && run.done) curves.push_back(of(run));
    NumberTable::Column column{fmt::format("{} {}", name, comparison.explorers[e]), {}};
    for (const MeanInterval& mean : mean_curve(curves, places, beyond)) {
      const bool enough = 2 * static_cast<std::size_t>(mean.count) >= curves.size();
      column.values.push_back(enough ? mean.mean : std::numeric_limits<double>::quiet_NaN());
    }
    table.columns.push_back(std::move(column));
  }
}

constexpr auto kQuantities = std::to_array<std::pair<StepQuantity, const char*>>(
    {{StepQuantity::map_entropy, "map_entropy"},
     {StepQuantity::trajectory_entropy, "trajectory_entropy"},
     {StepQuantity::coverage, "coverage"}});

using OverSteps = RunCurve (*)(const ComparedRun&, StepQuantity, double);

NumberTable curves_over(const ExploreComparison& comparison, const char* x, const char* suffix,
                        OverSteps over) {
  const auto of = [&](StepQuantity quantity) {
    return [&comparison, quantity, over](const ComparedRun& run) {
      return over(run, quantity, comparison.floor_area());
    };
  };
  const auto places = places_up_to(largest_x(comparison, of(StepQuantity::coverage)));
  NumberTable table{.name = x, .columns = {{x, places}}};
  for (const auto& [quantity, name] : kQuantities)
    add_means(table, comparison, fmt::format("{}{}", name, suffix), places, of(quantity),
              BeyondEnd::keep);
  return table;
}

}  // namespace

std::string comparison_text(const ExploreComparison& comparison, bool colour) {
  std::string text = means_table(comparison).text(colour);
  if (comparison.explorers.size() > 1)
    text += fmt::format("\nDifference from {}, seed by seed (* clear of zero):\n{}",
                        comparison.explorers.front(), differences_table(comparison).text(colour));
  text += "\nEnds:\n" + ends_text(comparison);
  if (comparison.runs > 1) text += "Means with 95 % intervals (Student's t).\n";
  return text;
}

std::string comparison_latex(const ExploreComparison& comparison) {
  std::string text = means_table(comparison).latex();
  if (comparison.explorers.size() > 1) {
    text += fmt::format("\n% difference from {}, seed by seed\n{}", comparison.explorers.front(),
                        differences_table(comparison).latex());
  }
  return text;
}

std::string comparison_csv(const ExploreComparison& comparison) {
  CsvText csv(result_fields<RunRow>().all());
  for (const ComparedRun& run : comparison.outcomes)
    csv.add(result_record(RunRow{comparison.explorers[run.explorer], run}));
  return csv.text();
}

json::object comparison_json(const ExploreComparison& comparison) {
  json::object report = begin_report("explore");
  report["floor"] = frame_json(comparison.floor, comparison.frame);
  report["world"] = comparison.parts.world;
  report["policy"] = comparison.parts.policy;
  report["registration"] = comparison.parts.registration;
  report["mapper"] = comparison.parts.mapper;
  report["loss"] = comparison.parts.loss;
  report["seed"] = comparison.parts.seed;
  report["runs_of_each"] = comparison.runs;
  report["repeatable"] = comparison.repeatable;
  json::array explorers, runs;
  for (std::size_t e = 0; e < comparison.explorers.size(); ++e)
    explorers.push_back(explorer_json(comparison, e));
  for (const ComparedRun& run : comparison.outcomes) runs.push_back(run_json(comparison, run));
  report["explorers"] = std::move(explorers);
  report["runs"] = std::move(runs);
  report["curves"] = {{"distance", table_json(curves_over_distance(comparison))},
                      {"motions", table_json(curves_over_motions(comparison))},
                      {"coverage", table_json(curves_over_coverage(comparison))}};
  end_report(report);
  return report;
}

NumberTable curves_over_distance(const ExploreComparison& comparison) {
  return curves_over(comparison, "distance", "", over_distance);
}

NumberTable curves_over_motions(const ExploreComparison& comparison) {
  return curves_over(comparison, "motions", "_by_motion", over_motions);
}

NumberTable curves_over_coverage(const ExploreComparison& comparison) {
  const auto contradicted = [](const ComparedRun& run) {
    return error_over_coverage(run, MapQuality::contradicted);
  };
  const auto wrong = [](const ComparedRun& run) {
    return error_over_coverage(run, MapQuality::wrong);
  };
  const auto known = places_up_to(largest_x(comparison, contradicted));
  const auto seen = places_up_to(largest_x(comparison, wrong));
  NumberTable table{.name = "coverage", .columns = {{"known", known}}};
  add_means(table, comparison, "map_error", known, contradicted, BeyondEnd::unknown);
  table.columns.push_back({"seen", seen});
  add_means(table, comparison, "wrong", seen, wrong, BeyondEnd::unknown);
  return table;
}

NumberTable all_curves(const ExploreComparison& comparison) {
  NumberTable all = curves_over_distance(comparison);
  for (NumberTable more : {curves_over_motions(comparison), curves_over_coverage(comparison)})
    std::ranges::move(more.columns, std::back_inserter(all.columns));
  all.name = comparison.floor;
  return all;
}

}  // namespace cairn::app
