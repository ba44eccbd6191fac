// SPDX-License-Identifier: BSD-3-Clause
// The page of `cairn explore --html`: tables, and curves as images within it.
#include <algorithm>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "cairn/plugin/registry.hpp"
#include "cairn/program/album.hpp"
#include "cairn/program/picture_files.hpp"
#include "cairn/program/table.hpp"
#include "cairn/report/scene.hpp"
#include "cairn/runtime/error.hpp"
#include "explore_comparison_report.hpp"

namespace cairn::app {
namespace {

std::string escaped(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    if (c == '<') {
      safe += "&lt;";
    } else if (c == '>') {
      safe += "&gt;";
    } else if (c == '&') {
      safe += "&amp;";
    } else if (c == '"') {
      safe += "&quot;";
    } else {
      safe += c;
    }
  }
  return safe;
}

/// RFC 4648. An image within a page has its bytes in this form.
std::string base64(std::string_view bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t k = 0; k < bytes.size(); k += 3) {
    unsigned bits = 0;
    for (std::size_t j = 0; j < 3; ++j)
      bits = bits << 8U | (k + j < bytes.size() ? static_cast<unsigned char>(bytes[k + j]) : 0U);
    for (std::size_t j = 0; j < 4; ++j)
      text += k + j <= bytes.size() ? kDigits[bits >> (18 - 6 * j) & 63U] : '=';
  }
  return text;
}

bool has_numbers(const NumberTable& table, std::string_view quantity) {
  return std::ranges::any_of(table.columns, [&](const NumberTable::Column& column) {
    return column.name.starts_with(quantity) &&
           std::ranges::any_of(column.values, [](double value) { return std::isfinite(value); });
  });
}

/// A quantity of all explorers against `x`, drawn by `cairn plot`; nothing where it is of no run,
/// since none was finished.
std::string chart(const NumberTable& table, const std::string& x, const std::string& quantity,
                  Session& session) {
  if (!has_numbers(table, quantity + " ")) return "";
  Album album = begin_album(quantity, "");
  album.tables.push_back(table);
  const ComponentSpec picture{"svg",
                              {{"what", "columns"},
                               {"x", x},
                               {"y_columns", quantity + " *"},
                               {"width", "760"},
                               {"height", "380"}}};
  return fmt::format("<figure><img alt=\"{}\" src=\"data:image/svg+xml;base64,{}\"></figure>\n",
                     escaped(quantity), base64(draw_picture(album, picture, session)));
}

std::string charts(const ExploreComparison& comparison, Session& session) {
  try {
    session.registry().make<Picture>("svg");
  } catch (
      const Error& error) {  // the runs are done, and the rest of the page says what they found
    return fmt::format("<p>Without curves: {}</p>\n", escaped(error.what()));
  }
  std::string text;
  const NumberTable distance = curves_over_distance(comparison);
  for (const char* quantity : {"map_entropy", "trajectory_entropy", "coverage"})
    text += chart(distance, "distance", quantity, session);
  const NumberTable coverage = curves_over_coverage(comparison);
  text += chart(coverage, "known", "map_error", session);
  const bool against = std::ranges::any_of(comparison.outcomes, [](const ComparedRun& run) {
    return run.done && !run.samples.empty() && run.samples.front().against.has_value();
  });
  if (against) text += chart(coverage, "seen", "wrong", session);
  return text.empty() ? "<p>No run was finished.</p>\n" : text;
}

std::string means_table(const ExploreComparison& comparison) {
  std::string text = "<table><tr><th></th>";
  for (const std::string& explorer : comparison.explorers)
    text += fmt::format("<th>{}</th>", escaped(explorer));
  text += "</tr>\n";
  const std::vector<ResultField>& measures = exploration_measures();
  for (std::size_t k = 0; k < measures.size(); ++k) {
    const ResultField& measure = measures[k];
    text += fmt::format(
        "<tr><td>{}{}</td>", escaped(measure.help),
        measure.unit.empty() ? std::string() : fmt::format(" [{}]", escaped(measure.unit)));
    for (std::size_t e = 0; e < comparison.explorers.size(); ++e) {
      const MeanInterval mean = mean_interval(values_of(comparison.outcomes, e, k));
      text += mean.count > 1 ? fmt::format("<td>{:.4g} ± {:.2g}</td>", mean.mean, mean.half_width)
              : mean.count == 1 ? fmt::format("<td>{:.4g}</td>", mean.mean)
                                : std::string("<td>-</td>");
    }
    text += "</tr>\n";
  }
  return text + "</table>\n";
}

constexpr std::string_view kStyle =
    "body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:60rem;padding:0 1rem}"
    "table{border-collapse:collapse}td,th{padding:.2rem .7rem;border-bottom:1px solid #ddd;"
    "text-align:right}td:first-child,th:first-child{text-align:left}figure{margin:1rem 0}"
    "img{max-width:100%}pre{overflow-x:auto}";

}  // namespace

std::string comparison_page(const ExploreComparison& comparison, Session& session) {
  const ExploreParts& parts = comparison.parts;
  std::string text = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title>"
      "<style>{1}</style></head><body>\n<h1>Explorers on {0}</h1>\n",
      escaped(comparison.floor), kStyle);
  text += fmt::format(
      "<p>World <code>{}</code>, policy <code>{}</code>, registration <code>{}</code>, mapper "
      "<code>{}</code>; {} of each, with the seeds from {} on. Means with 95 % intervals "
      "(Student's t).{}</p>\n",
      escaped(parts.world), escaped(parts.policy), escaped(parts.registration),
      escaped(parts.mapper), plural(comparison.runs, "run"), parts.seed,
      comparison.repeatable ? "" : " The clock decides: the runs can't be repeated exactly.");
  text += means_table(comparison);
  text += fmt::format("<h2>Differences and ends</h2>\n<pre>{}</pre>\n",
                      escaped(comparison_text(comparison, false)));
  text += "<h2>Means of the runs</h2>\n" + charts(comparison, session);
  return text + "</body></html>\n";
}

}  // namespace cairn::app
