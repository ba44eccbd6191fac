// SPDX-License-Identifier: BSD-3-Clause
// Tables of `cairn sparsify --edges`.
#include <array>
#include <functional>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <boost/json/array.hpp>

#include "contestants.hpp"
#include "json_access.hpp"
#include "tables.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;
using Cells = std::vector<std::string>;

/// The selections, and what the columns are called.
constexpr std::array<std::pair<const char*, const char*>, 6> kSelections{
    {{"mac", "`mac`"},
     {"greedy_tree", "`greedy_tree`"},
     {"greedy_gain", "`greedy_gain`"},
     {"divergence", "`objective=divergence`"},
     {"l1", "`l1`"},
     {"random", "`random`"}}};

using Cell = std::function<std::string(const json::value* contestant)>;

/// One row per graph and part; one cell per selection, and before these what `first` makes of the
/// entry.
std::string table_of(const json::array& entries, const Cells& heading,
                     const std::function<Cells(const json::value& entry)>& first,
                     const Cell& cell) {
  Cells columns{"graph", "loop closures"};
  columns.insert(columns.end(), heading.begin(), heading.end());
  for (const auto& [name, title] : kSelections) columns.emplace_back(title);
  MarkdownTable table(columns);
  std::string before;
  for (const json::value& entry : entries) {
    const std::string graph = text(entry, "name");
    const json::value* any = contestant(entry, "mac");
    Cells cells{graph == before ? "" : graph,
                fmt::format("{} of {}", whole(median_of(any, "loops.kept")),
                            whole(median_of(any, "loops.in")))};
    before = graph;
    for (const std::string& of_entry : first(entry)) cells.push_back(of_entry);
    for (const auto& [name, title] : kSelections) cells.push_back(cell(contestant(entry, name)));
    table.add(cells);
  }
  return table.text();
}

std::string number_table(const json::array& entries, const Cells& heading,
                         const std::function<Cells(const json::value& entry)>& first,
                         const std::string& path) {
  return table_of(entries, heading, first,
                  [&](const json::value* c) { return digits(median_of(c, path)); });
}

Cells none(const json::value& /*entry*/) { return {}; }

std::string connectivity_table(const json::array& entries) {
  const auto bound = [](const json::value& entry) {
    const json::value* mac = contestant(entry, "mac");
    return Cells{percent(median_of(mac, "connectivity.rotation.bound") /
                         median_of(mac, "connectivity.rotation.full"))};
  };
  return table_of(entries, {"bound"}, bound, [](const json::value* c) {
    return percent(median_of(c, "connectivity.rotation.sparse") /
                   median_of(c, "connectivity.rotation.full"));
  });
}

}  // namespace

std::vector<Section> sparsify_edges_sections(const json::array& entries) {
  const auto bound = [](const json::value& entry) {
    return Cells{digits(median_of(contestant(entry, "l1"), "kld_bound"))};
  };
  return {{"sparsify-edges-kld", number_table(entries, {"bound"}, bound, "kld")},
          {"sparsify-edges-rmse", number_table(entries, {}, none, "rmse_aligned")},
          {"sparsify-edges-connectivity", connectivity_table(entries)},
          {"sparsify-edges-time", number_table(entries, {}, none, "seconds.select")}};
}

}  // namespace cairn::performance
