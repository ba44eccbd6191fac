// SPDX-License-Identifier: BSD-3-Clause
#include "tables.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <stdexcept>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "json_access.hpp"
#include "statistics.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;

// Machine
// ------------------------------------------------------------------------------------------------

/// "Measured on …", below each study's tables: they need not be of one day.
std::string provenance(const json::value& report) {
  const json::value* quick = member(report, "quick");
  const std::string commit = text(report, "commit");
  return fmt::format("\n*{}{}, {:.0f} cores, {}; {}, `{}`; {}.*\n",
                     quick && *quick == true ? "Quick run, not a measurement. " : "",
                     text(report, "machine.cpu"), number(report, "machine.cores"),
                     text(report, "build.simd"), text(report, "build.compiler"),
                     text(report, "build.flags"),
                     commit.empty() ? "cairn " + text(report, "cairn") : "commit " + commit);
}

// Rates
// --------------------------------------------------------------------------------------------------

double median_of(const json::array& entries, const char* path) {
  std::vector<double> values;
  for (const json::value& entry : entries) {
    if (std::isfinite(number(entry, path))) values.push_back(number(entry, path));
  }
  return median(values);
}

/// Every entry of L is written once and read once: what must cross the bus if L does not stay in a
/// cache, so a lower bound of the traffic and an upper bound of the intensity.
double flops_per_byte(const json::value& entry) {
  return number(entry, "solver.factor_flops") /
         (2.0 * sizeof(double) * number(entry, "solver.factor_nonzeros"));
}

std::vector<Section> rates_sections(const json::array& entries) {
  const double dgemm = median_of(entries, "dgemm"), bandwidth = median_of(entries, "bandwidth");
  std::string lines =
      std::isfinite(dgemm)
          ? fmt::format("`dgemm` (n = 1024): {} GFLOP/s; triad: {} GB/s.\n\n", digits(1e-9 * dgemm),
                        digits(1e-9 * bandwidth))
          : fmt::format("No OpenBLAS to open here, so no `dgemm`; triad: {} GB/s.\n\n",
                        digits(1e-9 * bandwidth));
  MarkdownTable table({"graph", "ordering", "nonzeros of L", "flops", "factorise [ms]", "GFLOP/s",
                       "of `dgemm`", "flops per byte", "roof [GFLOP/s]", "of the roof"});
  for (const json::value& entry : entries) {
    const double rate = number(entry, "solver.factor_flops") / number(entry, "factorize");
    const double peak = number(entry, "dgemm"), intensity = flops_per_byte(entry);
    const double roof = std::min(peak, intensity * number(entry, "bandwidth"));
    table.add({text(entry, "name"), text(entry, "solver.ordering"),
               count(number(entry, "solver.factor_nonzeros")),
               count(number(entry, "solver.factor_flops")),
               milliseconds(number(entry, "factorize")), digits(1e-9 * rate), percent(rate / peak),
               digits(intensity), digits(1e-9 * roof), percent(rate / roof)});
  }
  return {{"rates", lines + table.text()}};
}

// Threads
// ------------------------------------------------------------------------------------------------

std::vector<Section> threads_sections(const json::array& entries) {
  MarkdownTable table({"graph", "factorise, 1 thread [ms]", "2 threads", "faster",
                       "iteration, 1 thread [ms]", "2 threads", "faster"});
  for (const json::value& entry : entries) {
    std::vector<std::string> row{text(entry, "name")};
    for (const char* part : {"factorize", "iteration"}) {
      const double one = number(entry, std::string("one.") + part);
      const double two = number(entry, std::string("two.") + part);
      row.insert(row.end(), {milliseconds(one), milliseconds(two), times(one / two)});
    }
    table.add(row);
  }
  return {{"threads", table.text()}};
}

// Scaling
// ------------------------------------------------------------------------------------------------

constexpr double kSmallestFitted = 10'000;

std::string scaling_table(const json::array& entries) {
  MarkdownTable table({"family", "poses", "factors", "ordering", "nonzeros of L",
                       "ten iterations [s]", "µs per pose and iteration", "peak memory [MB]",
                       "kB per pose"});
  for (const json::value& entry : entries) {
    if (text(entry, "study") == "convergence") continue;
    const double poses = number(entry, "poses"), seconds = number(entry, "seconds");
    const std::string left_out = text(entry, "left_out");
    if (!left_out.empty()) {
      table.add(
          {text(entry, "family"), count(poses), "", "", "", "left out: " + left_out, "", "", ""});
      continue;
    }
    const double variables = number(entry, "graph.variables");
    const double memory = number(entry, "peak_memory_bytes");
    table.add({text(entry, "family"), fmt::format("{:.0f}", variables),
               fmt::format("{:.0f}", number(entry, "graph.factors")),
               text(entry, "solver.ordering"), count(number(entry, "solver.factor_nonzeros")),
               digits(seconds), digits(1e6 * seconds / number(entry, "iterations") / variables),
               megabytes(memory), digits(1e-3 * memory / variables)});
  }
  return table.text();
}

std::string growth_table(const json::array& entries) {
  struct Points {
    std::vector<double> variables, seconds, memory;
  };
  std::map<std::string, Points> families;
  for (const json::value& entry : entries) {
    const double variables = number(entry, "graph.variables");
    // A cube of whole sides is never quite the size asked for.
    if (text(entry, "study") == "convergence" || !text(entry, "left_out").empty() ||
        number(entry, "poses") < kSmallestFitted)
      continue;
    Points& points = families[text(entry, "family")];
    points.variables.push_back(variables);
    points.seconds.push_back(number(entry, "seconds"));
    points.memory.push_back(number(entry, "peak_memory_bytes"));
  }
  MarkdownTable table({"family", "poses", "sizes", "time grows as", "memory grows as"});
  for (const auto& family : families) {
    const Points& points = family.second;  // clang lets no lambda use a structured binding
    const auto law = [&](const std::vector<double>& y) {
      return points.variables.size() < 2
                 ? std::string("-")
                 : fmt::format("n^{:.2f}", fitted_exponent(points.variables, y));
    };
    table.add({family.first,
               fmt::format("{:.0f} … {:.0f}", points.variables.front(), points.variables.back()),
               fmt::format("{}", points.variables.size()), law(points.seconds),
               law(points.memory)});
  }
  return table.text();
}

std::string convergence_table(const json::array& entries) {
  MarkdownTable table({"graph", "poses", "factors", "time [s]", "whole process [s]", "iterations",
                       "status", "chi2 at the start", "chi2 at the end", "peak memory [MB]"});
  for (const json::value& entry : entries) {
    if (text(entry, "study") != "convergence") continue;
    if (!text(entry, "left_out").empty()) {
      table.add({text(entry, "family"), count(number(entry, "poses")), "", "", "", "",
                 text(entry, "left_out"), "", "", ""});
      continue;
    }
    table.add({text(entry, "family"), fmt::format("{:.0f}", number(entry, "graph.variables")),
               fmt::format("{:.0f}", number(entry, "graph.factors")),
               digits(number(entry, "seconds")), digits(number(entry, "process_seconds")),
               fmt::format("{:.0f}", number(entry, "iterations")), text(entry, "status"),
               fmt::format("{:.6g}", number(entry, "chi2.initial")),
               fmt::format("{:.8g}", number(entry, "chi2.final")),
               megabytes(number(entry, "peak_memory_bytes"))});
  }
  return table.text();
}

std::vector<Section> scaling_sections(const json::array& entries) {
  return {{"scaling", scaling_table(entries)},
          {"growth", growth_table(entries)},
          {"convergence", convergence_table(entries)}};
}

// Solvers
// ------------------------------------------------------------------------------------------------

// Of chi2 at the start: what a sum of squares that goes to zero keeps of it.
constexpr double kRounding = 1e-12;

/// How a run ended, and whether elsewhere than the first.
std::string solver_result(const json::value& entry, double chi2, double rounding) {
  constexpr double kSame = 1e-6;
  const double difference = std::abs(number(entry, "chi2.final") - chi2) / std::max(chi2, rounding);
  const json::value* finished = member(entry, "finished");
  const bool ended = finished && finished->is_bool() && finished->get_bool();
  return text(entry, "result") + (ended && difference > kSame ? ", **another chi2**" : "");
}

/// A table a graph, in the order in which they were measured; the first row is what the others are
/// compared with.
std::vector<Section> solvers_sections(const json::array& entries) {
  std::string all;
  std::set<std::string> done;
  for (const json::value& first : entries) {
    const std::string name = text(first, "name");
    if (!done.insert(name).second) continue;
    const double chi2 = number(first, "chi2.final"), seconds = number(first, "seconds");
    const double rounding = kRounding * number(first, "chi2.initial");
    MarkdownTable table({"solver", "chi2", "apart", "iterations", "inner iterations", "time [ms]",
                         "against the first", "peak memory [MB]", "result"});
    for (const json::value& entry : entries) {
      if (text(entry, "name") != name) continue;
      const double found = number(entry, "chi2.final");
      const double inner = number(entry, "solver.iterations");
      table.add(
          {"`" + text(entry, "setting") + "`",
           std::isfinite(found) ? fmt::format("{:.8g}", found) : "-", apart(found, chi2, rounding),
           std::isfinite(found) ? fmt::format("{:.0f}", number(entry, "iterations")) : "-",
           std::isfinite(inner) ? count(inner) : "", milliseconds(number(entry, "seconds")),
           times(number(entry, "seconds") / seconds), megabytes(number(entry, "peak_memory_bytes")),
           solver_result(entry, chi2, rounding)});
    }
    const std::string title = fmt::format("{}**{}**", all.empty() ? "" : "\n", name);
    all += member(first, "graph") ? fmt::format("{} ({:.0f} variables, {:.0f} factors)\n\n{}",
                                                title, number(first, "graph.variables"),
                                                number(first, "graph.factors"), table.text())
                                  : fmt::format("{}: {}\n", title, text(first, "result"));
  }
  return {{"solvers", all}};
}

// Marginals
// ------------------------------------------------------------------------------------------------

std::vector<Section> marginals_sections(const json::array& entries) {
  MarkdownTable table({"graph", "variables", "nonzeros of L", "analyse, factorise [ms]",
                       "diagonal [ms]", "last column [ms]", "both [ms]", "both, 2 threads [ms]",
                       "both by `cholmod`'s solves [ms]", "faster"});
  for (const json::value& entry : entries) {
    const double both = number(entry, "both"), solves = number(entry, "solves");
    table.add({text(entry, "name"), fmt::format("{:.0f}", number(entry, "graph.variables")),
               count(number(entry, "solver.factor_nonzeros")),
               milliseconds(number(entry, "factorize")), milliseconds(number(entry, "diagonal")),
               milliseconds(number(entry, "column")), milliseconds(both),
               milliseconds(number(entry, "two_threads")), milliseconds(solves),
               times(solves / both)});
  }
  return {{"marginals", table.text()}};
}

// --------------------------------------------------------------------------------------------------

struct StudySections {
  std::string_view study;
  std::vector<Section> (*sections)(const json::array& entries);
};

constexpr StudySections kSections[] = {{"graphs", graphs_sections},
                                       {"rates", rates_sections},
                                       {"threads", threads_sections},
                                       {"scaling", scaling_sections},
                                       {"solvers", solvers_sections},
                                       {"marginals", marginals_sections},
                                       {"online", online_sections},
                                       {"compact_sets", compact_sets_sections},
                                       {"compact_growth", compact_growth_sections},
                                       {"compact_consistency", compact_consistency_sections},
                                       {"compact_gain", compact_gain_sections},
                                       {"compact_figures", compact_figures_sections},
                                       {"compact_live", compact_live_sections},
                                       {"compact_matches", compact_matches_sections},
                                       {"compact_million", compact_million_sections},
                                       {"sparsify_sets", sparsify_sets_sections},
                                       {"sparsify_topology", sparsify_topology_sections},
                                       {"sparsify_problems", sparsify_problems_sections},
                                       {"sparsify_whole", sparsify_whole_sections},
                                       {"sparsify_online", sparsify_online_sections},
                                       {"sparsify_selection", sparsify_selection_sections},
                                       {"sparsify_edges", sparsify_edges_sections},
                                       {"explore_cave", explore_part_sections},
                                       {"explore_freiburg", explore_part_sections},
                                       {"explore_action", explore_part_sections},
                                       {"explore_scale", explore_part_sections},
                                       {"explore_floors", explore_floors_sections},
                                       {"explore_sensitivity", explore_sensitivity_sections}};

}  // namespace

std::string digits(double value) {
  if (!std::isfinite(value)) return "-";
  return std::abs(value) >= 99.95 ? fmt::format("{:.0f}", value) : fmt::format("{:#.3g}", value);
}

std::string whole(double value) {
  return std::isfinite(value) ? fmt::format("{:.0f}", value) : "-";
}

std::string times(double ratio) { return std::isfinite(ratio) ? digits(ratio) + " ×" : "-"; }

std::string percent(double part) {
  return std::isfinite(part) ? fmt::format("{:.0f} %", 100.0 * part) : "-";
}

std::string milliseconds(double seconds) { return digits(1e3 * seconds); }

std::string megabytes(double bytes) {
  return std::isfinite(bytes) && bytes > 0.0 ? fmt::format("{:.0f}", 1e-6 * bytes) : "-";
}

std::string count(double value) {
  if (!std::isfinite(value)) return "-";
  for (const auto& [unit, name] : {std::pair{1e12, "T"}, {1e9, "G"}, {1e6, "M"}, {1e3, "k"}}) {
    if (value >= unit) return fmt::format("{:.3g} {}", value / unit, name);
  }
  return fmt::format("{:.0f}", value);
}

std::string apart(double value, double reference, double rounding) {
  if (!std::isfinite(value) || !std::isfinite(reference)) return "-";
  if (value == reference) return "0";
  return fmt::format("{:.0e}",
                     std::abs(value - reference) / std::max(std::abs(reference), rounding));
}

json::value scaling_picture(const json::array& entries) {
  json::array graphs;
  for (const json::value& entry : entries) {
    if (text(entry, "study") == "convergence" || !text(entry, "left_out").empty()) continue;
    json::object family{{"optimizer", text(entry, "family")},
                        {"seconds", {{"median", number(entry, "seconds")}}},
                        {"peak_memory_bytes", number(entry, "peak_memory_bytes")}};
    graphs.push_back(
        {{"graph",
          {{"file", text(entry, "family")}, {"variables", number(entry, "graph.variables")}}},
         {"configurations", json::array{std::move(family)}}});
  }
  return json::object{{"command", "bench"}, {"graphs", graphs}};
}

MarkdownTable::MarkdownTable(const std::vector<std::string>& heading) {
  add(heading);
  text_ += "| ---";
  for (std::size_t k = 1; k < heading.size(); ++k) text_ += " | ---:";
  text_ += " |\n";
}

void MarkdownTable::add(const std::vector<std::string>& row) {
  text_ += fmt::format("| {} |\n", fmt::join(row, " | "));
}

std::vector<Section> sections(const json::value& report) {
  const std::string study = text(report, "study");
  const auto* of_study = std::ranges::find(kSections, study, &StudySections::study);
  if (of_study == std::end(kSections))
    throw std::runtime_error("no table for a study named '" + study + "'");
  std::vector<Section> all = of_study->sections(list(report, "entries"));
  for (Section& section : all) section.markdown += provenance(report);
  return all;
}

}  // namespace cairn::performance
