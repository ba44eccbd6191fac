// SPDX-License-Identifier: BSD-3-Clause
// Tables of `cairn explore`.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <boost/json/array.hpp>

#include "compared_runs.hpp"
#include "explore_claims.hpp"
#include "json_access.hpp"
#include "tables.hpp"
#include "thesis_exploration.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;
using Cells = std::vector<std::string>;

struct Row {
  std::string_view measure, title;
};

constexpr auto kRows = std::to_array<Row>({{"map_entropy", "map entropy [nats·m²]"},
                                           {"trajectory_entropy", "trajectory entropy [nats]"},
                                           {"seconds", "time of a run [s]"},
                                           {"loops", "loop closures"},
                                           {"coverage", "coverage [m²]"},
                                           {"map_error", "map error [m²]"},
                                           {"seen", "of the floor seen [m²]"},
                                           {"wrong", "wrong cells [m²]"},
                                           {"ate", "ATE [m]"},
                                           {"collisions", "collisions"},
                                           {"distance", "driven [m]"},
                                           {"poses", "poses kept"},
                                           {"decisions", "decisions"},
                                           {"decision_median", "a decision: median [s]"},
                                           {"decision_p95", "95 % [s]"},
                                           {"decision_max", "longest [s]"}});

Cells heading(const std::vector<ExploreMethod>& methods, const char* first) {
  Cells cells{first};
  for (const ExploreMethod& method : methods) cells.push_back(method.name);
  return cells;
}

/// How long the thesis's runs are (5.4.5 and 5.3.3).
constexpr double kThesisDistance = 250.0;  // [m]
constexpr double kThesisMotions = 200.0;

/// "ours ± interval (the thesis's)"
std::string results_table(const std::string& part, const std::vector<ExploreMethod>& methods) {
  MarkdownTable table(heading(methods, "mean ± 95 % (thesis)"));
  for (const Row& row : kRows) {
    Cells cells{std::string(row.title)};
    for (const ExploreMethod& method : methods) {
      std::string cell = interval_text(mean_of(method, row.measure));
      const double thesis = thesis_value(thesis_exploration(part, method.name), row.measure);
      if (std::isfinite(thesis)) cell += fmt::format(" ({:.6g})", thesis);
      cells.push_back(std::move(cell));
    }
    table.add(cells);
  }
  // Runs may be shorter than the thesis's: times are compared per metre, or per motion.
  const bool by_distance = part == "action";
  Cells faster{by_distance ? "the thesis's time per metre over ours"
                           : "the thesis's time per motion over ours"};
  Cells ends{"ends"}, runs{"runs"};
  for (const ExploreMethod& method : methods) {
    const double thesis = thesis_exploration(part, method.name).seconds /
                          (by_distance ? kThesisDistance : kThesisMotions);
    const double length = mean_of(method, by_distance ? "distance" : "motions").mean;
    faster.push_back(times(thesis * length / mean_of(method, "seconds").mean));
    ends.push_back(ends_of(method));
    runs.push_back(fmt::format("{}", method.runs.size()));
  }
  table.add(faster);
  table.add(ends);
  table.add(runs);
  return table.text();
}

std::string differences_table(const std::vector<ExploreMethod>& methods) {
  if (methods.size() < 2) return {};
  const ExploreMethod& reference = methods.front();
  const std::vector<ExploreMethod> others(methods.begin() + 1, methods.end());
  MarkdownTable table(heading(others, "difference from frontier"));
  const auto add = [&](std::string_view title, std::string_view measure) {
    Cells cells{std::string(title)};
    for (const ExploreMethod& method : others) {
      const MeanInterval difference = difference_of(method, reference, measure);
      cells.push_back(interval_text(difference, true) + (difference.excludes_zero() ? " *" : ""));
    }
    table.add(cells);
  };
  for (const Row& row : kRows) {
    const bool of_decisions = row.measure.starts_with("decision");
    if (!of_decisions) add(row.title, row.measure);
  }
  add("map error at equal coverage [m²]", kMapErrorAtCoverage);
  add("wrong cells, as much floor seen [m²]", kWrongAtSeen);
  return table.text();
}

/// A floor and how it was driven on, below the tables.
std::string setting_of(const json::array& entries) {
  for (const json::value& entry : entries) {
    const json::value* report = member(entry, "report");
    if (!report) continue;
    return fmt::format("\nOn `{}`; world `{}`, policy `{}`, registration `{}`, mapper `{}`.\n",
                       text(entry, "name"), text(*report, "world"), text(*report, "policy"),
                       text(*report, "registration"), text(*report, "mapper"));
  }
  return "\nNothing was measured.\n";
}

}  // namespace

std::vector<Section> explore_part_sections(const json::array& entries) {
  if (entries.empty()) return {};
  const std::string part = text(entries.front(), "part");
  // At the other scale the thesis's figures are those of the same table.
  const std::string thesis = part == "scale" ? "action" : part;
  const std::vector<ExploreMethod> methods = explore_methods(entries);
  return {{"explore-" + part, results_table(thesis, methods) + setting_of(entries)},
          {"explore-" + part + "-differences", differences_table(methods)},
          {"explore-" + part + "-claims", claims_table(thesis, methods)}};
}

std::vector<Section> explore_floors_sections(const json::array& entries) {
  MarkdownTable floors({"floor", "explorer", "seed", "end", "why", "driven [m]", "seen [m²]",
                        "loops", "collisions", "ATE [m]", "wrong [m²]", "95 % of decisions [s]"});
  MarkdownTable exact({"floor", "end", "why", "driven [m]", "seen [m²]", "collisions"});
  std::string name;
  for (const json::value& entry : entries) {
    const bool without_noise = text(entry, "part") == "exact";
    const std::vector<ExploreMethod> methods = explore_methods({entry});
    const ExploreMethod& method = methods.front();
    std::string floor = text(entry, "name") == name ? "" : text(entry, "name");
    if (!method.problem.empty() && !without_noise)
      floors.add({floor, method.name, "", method.problem, "", "", "", "", "", "", "", ""});
    for (const ComparedRun& run : method.runs) {
      const ExplorationMeasures& m = run.measures;
      const std::string end = run.done ? std::string(to_string(run.end)) : "failed";
      if (without_noise) {
        exact.add({text(entry, "name"), end, run.why, digits(m.distance), digits(m.seen),
                   whole(m.collisions)});
      } else {
        floors.add({floor, method.name, fmt::format("{}", run.seed), end, run.why,
                    digits(m.distance), digits(m.seen), whole(m.loops), whole(m.collisions),
                    digits(m.ate), digits(m.wrong), digits(m.decision_p95)});
        floor.clear();
      }
    }
    name = text(entry, "name");
  }
  return {{"explore-floors", floors.text()}, {"explore-exact", exact.text()}};
}

std::vector<Section> explore_sensitivity_sections(const json::array& entries) {
  MarkdownTable table({"changed", "method", "map entropy [nats·m²]", "trajectory entropy [nats]",
                       "loop closures", "coverage [m²]", "map error [m²]", "wrong cells [m²]",
                       "time of a run [s]"});
  for (const json::value& entry : entries) {
    const std::vector<ExploreMethod> methods = explore_methods({entry});
    const ExploreMethod& method = methods.front();
    Cells cells{text(entry, "change"), method.name};
    for (const char* measure : {"map_entropy", "trajectory_entropy", "loops", "coverage",
                                "map_error", "wrong", "seconds"})
      cells.push_back(method.problem.empty() ? interval_text(mean_of(method, measure))
                                             : method.problem);
    table.add(cells);
  }
  return {{"explore-sensitivity", table.text()}};
}

}  // namespace cairn::performance
