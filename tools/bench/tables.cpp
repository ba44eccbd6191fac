// SPDX-License-Identifier: BSD-3-Clause
#include "tables.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <stdexcept>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "json_access.hpp"

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

struct StudySections {
  std::string_view study;
  std::vector<Section> (*sections)(const json::array& entries);
};

constexpr StudySections kSections[] = {{"sparsify_sets", sparsify_sets_sections},
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
