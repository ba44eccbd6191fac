// SPDX-License-Identifier: BSD-3-Clause
// What stands beside the figures of compact pose SLAM, and the curves of its sensitivity.
#include <utility>

#include <fmt/format.h>
#include <boost/json/array.hpp>

#include "cairn/report/number_table.hpp"
#include "json_access.hpp"
#include "tables.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;

std::string part(double kept, double of) { return fmt::format("{:.1f} %", 100.0 * kept / of); }

}  // namespace

std::vector<Section> compact_figures_sections(const json::array& entries) {
  MarkdownTable table(
      {"graph", "strategy", "poses", "of all", "loop closures", "of all", "ATE [m]", "[°]"});
  for (const json::value& entry : entries) {
    std::string name = text(entry, "name");
    for (const auto& [key, title] : {std::pair{"apal", "(a) all poses, all loop closures"},
                                     {"apfl", "(b) all poses, few loop closures"},
                                     {"fpfl", "(c) few of both"}}) {
      const auto of = [&entry, strategy = key](const char* path) {
        return number(entry, fmt::format("{}.{}", strategy, path));
      };
      table.add({name, title, whole(of("poses.kept")), part(of("poses.kept"), of("poses.in")),
                 whole(of("loops.kept")), part(of("loops.kept"), of("loops.in")),
                 digits(of("errors.v2.ate.translation")), digits(of("errors.v2.ate.rotation"))});
      name.clear();
    }
  }
  return {{"compact-figures", table.text()}};
}

std::string gain_curves(const json::array& entries) {
  NumberTable curves;
  curves.columns.push_back({"threshold over the rule's", {}});
  for (const json::value& entry : entries) {
    const std::string name = text(entry, "name");
    NumberTable::Column loops{"loop closures kept [%], " + name, {}},
        error{"ATE over that of APAL, " + name, {}};
    std::vector<double> factors;
    const double apal = number(entry, "apal.errors.v2.ate.translation");
    for (const json::value& run : list(entry, "runs")) {
      factors.push_back(number(run, "factor"));
      loops.values.push_back(100.0 * number(run, "run.loops.kept") / number(run, "run.loops.in"));
      error.values.push_back(number(run, "run.errors.v2.ate.translation") / apal);
    }
    std::vector<double>& all = curves.columns.front().values;
    if (all.empty()) all = factors;
    if (all != factors) continue;  // of another version of the study
    curves.columns.push_back(std::move(loops));
    curves.columns.push_back(std::move(error));
  }
  return csv_text(curves);
}

}  // namespace cairn::performance
