// SPDX-License-Identifier: BSD-3-Clause
// Tables and picture of the replays.
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <boost/json/array.hpp>

#include "contestants.hpp"
#include "json_access.hpp"
#include "tables.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

bool is_part(const json::value& entry, const char* part) { return text(entry, "part") == part; }

const json::value* ours(const json::value& entry) {
  return contestant(entry, "incremental_cholesky");
}

std::string memory(const json::value* c) { return megabytes(median_of(c, "peak_memory_bytes")); }

/// "0.012 %" of 0.00012; "-" for what is not a number.
std::string above(double excess) {
  if (!std::isfinite(excess)) return "-";
  const double percents = 100.0 * excess;
  if (percents >= 99.5) return fmt::format("{:.0f} %", percents);
  // Never "-0.000".
  return fmt::format("{:.3f} %", std::abs(percents) < 5e-4 ? 0.0 : percents);
}

// The lower of what batch reaches from a fresh guess and from the estimate at hand.
double best(const json::value& check) {
  return std::min(number(check, "batch"), number(check, "polished"));
}

/// The last of the checks; null if there is none.
const json::value* last_check(const json::value& entry) {
  const json::array& checks = list(entry, "checks");
  return checks.empty() ? nullptr : &checks.back();
}

/// By how much the final chi2 of a contestant is above the best that is known.
double final_excess(const json::value* c, const json::value* check) {
  return c && check ? median_of(c, "chi2") / best(*check) - 1.0 : kNone;
}

/// The largest excess at the samples, of which the last is that of the timed runs: the checked run
/// has finished there. Before the first loop closes, chi2 is nothing but rounding, whose ratios say
/// nothing.
double worst(const json::value& entry) {
  const json::value* last = last_check(entry);
  if (!last) return kNone;
  constexpr double kRounding = 1e-9;
  double largest = final_excess(ours(entry), last);
  for (const json::value& check : list(entry, "checks")) {
    if (best(check) > kRounding * best(*last))
      largest = std::max(largest, number(check, "chi2") / best(check) - 1.0);
  }
  return largest;
}

std::vector<std::string> step_times(const json::value* c) {
  return {milliseconds(median_of(c, "steps.median")), milliseconds(median_of(c, "steps.p95")),
          milliseconds(median_of(c, "steps.p99")), milliseconds(median_of(c, "steps.max"))};
}

void append(std::vector<std::string>& row, const std::vector<std::string>& cells) {
  row.insert(row.end(), cells.begin(), cells.end());
}

std::string times_table(const json::array& entries) {
  MarkdownTable table({"graph", "steps", "ours [s]", "median step [ms]", "95 %", "99 %", "longest",
                       "`periodic_batch` [s]", "slower", "its longest step [ms]", "`batch` [s]",
                       "slower", "peak memory [MB]"});
  for (const json::value& entry : entries) {
    if (!is_part(entry, "times")) continue;
    const json::value *mine = ours(entry), *periodic = contestant(entry, "periodic_batch"),
                      *batch = contestant(entry, "batch");
    std::vector<std::string> row{
        text(entry, "name"), fmt::format("{:.0f}", median_of(mine, "steps.count")), total(mine)};
    append(row, step_times(mine));
    append(row, {total(periodic), times(paired_ratio(periodic, mine)),
                 milliseconds(median_of(periodic, "steps.max")), total(batch),
                 times(paired_ratio(batch, mine)),
                 fmt::format("{} / {}", memory(mine), memory(periodic))});
    table.add(row);
  }
  return table.text();
}

std::string chi2_table(const json::array& entries) {
  MarkdownTable table({"graph", "chi2", "batch, from the initial estimate",
                       "batch, from the estimate", "above batch", "at most, at the samples",
                       "finished", "`periodic_batch` above batch"});
  for (const json::value& entry : entries) {
    if (!is_part(entry, "times")) continue;
    const json::value *mine = ours(entry), *check = last_check(entry);
    if (!check) continue;
    table.add({text(entry, "name"), fmt::format("{:.8g}", median_of(mine, "chi2")),
               fmt::format("{:.8g}", number(*check, "batch")),
               fmt::format("{:.8g}", number(*check, "polished")), above(final_excess(mine, check)),
               above(worst(entry)), above(number(*check, "chi2") / best(*check) - 1.0),
               above(final_excess(contestant(entry, "periodic_batch"), check))});
  }
  return table.text();
}

/// The entry of the same graph without covariances; null if there is none.
const json::value* times_of(const json::array& entries, const std::string& name) {
  for (const json::value& entry : entries) {
    if (is_part(entry, "times") && text(entry, "name") == name) return &entry;
  }
  return nullptr;
}

std::string marginals_table(const json::array& entries) {
  MarkdownTable table({"graph", "steps", "all [s]", "without [s]", "covariances",
                       "median step [ms]", "95 %", "99 %", "longest", "downdated", "recomputed",
                       "unchanged", "peak memory [MB]"});
  for (const json::value& entry : entries) {
    if (!is_part(entry, "marginals")) continue;
    const json::value *mine = ours(entry), *plain = times_of(entries, text(entry, "name"));
    std::vector<std::string> row{
        text(entry, "name"), fmt::format("{:.0f}", median_of(mine, "steps.count")), total(mine),
        plain ? total(ours(*plain)) : "-",
        percent(median_of(mine, "seconds.marginals") / median_of(mine, "seconds.total"))};
    append(row, step_times(mine));
    for (const char* by : {"downdate", "recomputation", "unchanged"}) {
      const double steps = median_of(mine, std::string("marginals_by.") + by);
      row.push_back(std::isfinite(steps) ? fmt::format("{:.0f}", steps) : "0");
    }
    row.push_back(memory(mine));
    table.add(row);
  }
  return table.text();
}

std::string budget_table(const json::array& entries) {
  MarkdownTable table({"graph", "limit [ms]", "all [s]", "median step [ms]", "95 %", "99 %",
                       "longest", "chi2", "above batch", "deferred at the end"});
  for (const json::value& entry : entries) {
    if (!is_part(entry, "budget")) continue;
    // All of them go for the same minimum: the best of it is what they are compared with.
    double lowest = std::numeric_limits<double>::infinity();
    for (const json::value& c : list(entry, "contestants")) {
      for (const json::value& run : list(c, "runs")) {
        if (const json::value* check = last_check(run)) lowest = std::min(lowest, best(*check));
      }
    }
    for (const json::value& c : list(entry, "contestants")) {
      const double chi2 = median_of(&c, "chi2");
      std::vector<std::string> row{
          text(entry, "name"),
          text(c, "name") == "budget" ? digits(1e3 * number(entry, "budget")) : "none", total(&c)};
      append(row, step_times(&c));
      append(row, {fmt::format("{:.8g}", chi2), above(chi2 / lowest - 1.0),
                   count(median_of(&c, "owed"))});
      table.add(row);
    }
  }
  return table.text();
}

/// A curve with a point at every so many steps.
json::object curve(const std::string& name, const json::array& values, double every) {
  json::array history;
  for (const json::value& value : values) {
    for (int k = 1; k < static_cast<int>(every); ++k)
      history.push_back({{"chi2", nullptr}, {"seconds", nullptr}});
    history.push_back({{"chi2", nullptr}, {"seconds", value}});
  }
  return {{"optimizer", name}, {"linear_solver", "-"}, {"history", std::move(history)}};
}

}  // namespace

std::vector<Section> online_sections(const json::array& entries) {
  return {{"online-times", times_table(entries)},
          {"online-chi2", chi2_table(entries)},
          {"online-marginals", marginals_table(entries)},
          {"online-budget", budget_table(entries)}};
}

json::value online_picture(const json::array& entries) {
  json::array graphs;
  std::string before;
  for (const json::value& entry : entries) {
    if (!is_part(entry, "steps")) continue;
    const double every = number(entry, "every");
    const std::string setting = text(entry, "setting");
    if (text(entry, "name") != before) {
      before = text(entry, "name");
      graphs.push_back({{"graph", {{"file", before}}}, {"configurations", json::array()}});
    }
    json::array& curves = graphs.back().at("configurations").as_array();
    curves.push_back(
        curve(fmt::format("{}, longest of {:.0f}", setting, every), list(entry, "longest"), every));
  }
  return json::object{{"command", "bench"}, {"graphs", graphs}};
}

}  // namespace cairn::performance
