// SPDX-License-Identifier: BSD-3-Clause
// Tables of `cairn sparsify` on whole graphs.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>
#include <boost/json/array.hpp>

#include "contestants.hpp"
#include "json_access.hpp"
#include "statistics.hpp"
#include "tables.hpp"
#include "thesis_figures.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;
using Cells = std::vector<std::string>;

Cells joined(Cells cells, const Cells& more) {
  cells.insert(cells.end(), more.begin(), more.end());
  return cells;
}

/// As it was printed; nothing where nothing was.
std::string said(double value) {
  return std::isfinite(value) ? fmt::format("{}", value) : std::string();
}

/// "1.02 ×", or nothing without a figure to compare with.
std::string ratio(double ours, double theirs) {
  return std::isfinite(theirs) ? times(ours / theirs) : std::string();
}

int keep_every(const json::value& entry) { return static_cast<int>(number(entry, "keep_every")); }

std::string name_of(const json::value* contestant) {
  return contestant ? text(*contestant, "name") : std::string();
}

// Table 4.1
// ------------------------------------------------------------------------------------------------

constexpr std::array kKeepEvery{3, 4, 5, 10};

/// "2332 / 2332", or ours alone.
std::string beside(const std::string& ours, double theirs) {
  return std::isfinite(theirs) ? ours + " / " + said(theirs) : ours;
}

std::string counts_table(const json::array& entries) {
  Cells heading{"graph", "scheme", "topology"};
  for (const char* what : {"problems, N = ", "nodes of a blanket, N = "}) {
    for (const int k : kKeepEvery)
      heading.push_back(fmt::format("{}{}", k == kKeepEvery.front() ? what : "", k));
  }
  MarkdownTable table(heading);
  // The entries of a graph and a scheme are neighbours.
  for (std::size_t first = 0, last = 0; first < entries.size(); first = last) {
    const std::string graph = text(entries[first], "name"), scheme = text(entries[first], "scheme");
    std::map<int, const json::value*> of;
    for (; last < entries.size() && text(entries[last], "name") == graph &&
           text(entries[last], "scheme") == scheme;
         ++last)
      of[keep_every(entries[last])] = &entries[last];
    for (const auto& [topology, by] : {std::pair{"clt", "clt"}, {"mi", "ncfd"}}) {
      if (!contestant(entries[first], by)) continue;
      Cells problems, blankets;
      for (const int k : kKeepEvery) {
        const json::value* c = of.contains(k) ? contestant(*of[k], by) : nullptr;
        const ThesisCounts thesis = thesis_counts(graph, scheme, topology, k);
        problems.push_back(beside(whole(median_of(c, "problems.count")), thesis.problems));
        blankets.push_back(
            beside(fmt::format("{:.2f}", median_of(c, "problems.mean_blanket")), thesis.blanket));
      }
      table.add(joined(joined({graph, scheme, topology}, problems), blankets));
    }
  }
  return table.text();
}

// Table 4.2
// ------------------------------------------------------------------------------------------------

constexpr std::array kRecoveries{"clt", "ip", "fd", "ncfd"};

std::string recovery_table(const json::array& entries) {
  MarkdownTable table({"graph", "scheme", "N", "by", "KLD", "thesis's", "ratio", "RMSE [m]",
                       "thesis's", "time [s]", "thesis's"});
  for (const json::value& entry : entries) {
    const std::string graph = text(entry, "name"), scheme = text(entry, "scheme");
    Cells cells{graph, scheme, fmt::format("{}", keep_every(entry))};
    for (const char* by : kRecoveries) {
      const json::value* c = contestant(entry, by);
      if (!c) continue;
      const ThesisLoss thesis = thesis_loss(graph, scheme, by, keep_every(entry));
      const double kld = median_of(c, "kld");
      table.add(joined(cells, {by, digits(kld), said(thesis.kld), ratio(kld, thesis.kld),
                               digits(median_of(c, "rmse")), said(thesis.rmse), total(c),
                               said(thesis.seconds)}));
      cells = {"", "", ""};
    }
  }
  return table.text();
}

/// Ratios to the thesis's figures over all graphs.
struct Ratios {
  std::vector<double> kld, rmse, time;
};

void add_ratio(std::vector<double>& ratios, double a, double b) {
  if (std::isfinite(a) && std::isfinite(b) && b > 0.0) ratios.push_back(a / b);
}

std::string ratios_table(const json::array& entries) {
  MarkdownTable table({"by", "compared", "KLD, ours over the thesis's: median", "least", "largest",
                       "RMSE: median", "least", "largest", "time, the thesis's over ours: median"});
  for (const char* by : kRecoveries) {
    Ratios of;
    for (const json::value& entry : entries) {
      const json::value* c = contestant(entry, by);
      const ThesisLoss thesis =
          thesis_loss(text(entry, "name"), text(entry, "scheme"), by, keep_every(entry));
      add_ratio(of.kld, median_of(c, "kld"), thesis.kld);
      add_ratio(of.rmse, median_of(c, "rmse"), thesis.rmse);
      add_ratio(of.time, thesis.seconds, median_of(c, "seconds.total"));
    }
    if (of.kld.empty()) continue;
    Cells cells{by, fmt::format("{}", of.kld.size())};
    for (const std::vector<double>* ratios : {&of.kld, &of.rmse}) {
      cells = joined(cells, {times(median(*ratios)), times(std::ranges::min(*ratios)),
                             times(std::ranges::max(*ratios))});
    }
    table.add(joined(cells, {times(median(of.time))}));
  }
  return table.text();
}

/// The losses at common states: the thesis's tree and pairs, and what there is without options.
std::string common_table(const json::array& entries) {
  constexpr std::array kNames{"common clt", "common ncfd", "default"};
  MarkdownTable table({"graph", "scheme", "N", "`clt`: KLD", "aligned RMSE [m]",
                       "`mi`, `ncfd`: KLD", "aligned RMSE [m]", "default: KLD", "aligned RMSE [m]",
                       "RMSE from all measurements [m]"});
  for (const json::value& entry : entries) {
    Cells cells{text(entry, "name"), text(entry, "scheme"), fmt::format("{}", keep_every(entry))};
    bool any = false;
    for (const char* name : kNames) {
      const json::value* c = contestant(entry, name);
      any = any || c;
      cells = joined(cells, {digits(median_of(c, "kld")), digits(median_of(c, "rmse_aligned"))});
    }
    cells.push_back(digits(median_of(contestant(entry, "default"), "rmse_full")));
    if (any) table.add(cells);
  }
  return table.text();
}

// Table 4.3
// ------------------------------------------------------------------------------------------------

std::string topology_table(const json::array& entries) {
  MarkdownTable table({"graph", "population and topology", "KLD", "thesis's", "ratio", "RMSE [m]",
                       "thesis's", "time [s]", "thesis's", "of that topology [s]", "thesis's",
                       "factors", "thesis's"});
  for (const json::value& entry : entries) {
    if (text(entry, "part") != "topologies") continue;
    std::string graph = text(entry, "name");
    for (const json::value& each : list(entry, "contestants")) {
      const json::value* c = &each;
      const ThesisTopology thesis = thesis_topology(text(entry, "name"), name_of(c));
      const double kld = median_of(c, "kld");
      table.add({graph, "`" + name_of(c) + "`", digits(kld), said(thesis.kld),
                 ratio(kld, thesis.kld), digits(median_of(c, "rmse")), said(thesis.rmse), total(c),
                 said(thesis.seconds), digits(median_of(c, "seconds.topology")),
                 said(thesis.topology_seconds), whole(median_of(c, "factors.out")),
                 said(thesis.factors)});
      graph.clear();
    }
  }
  return table.text();
}

/// A row a graph and a topology, a column an ε.
std::string regularization_table(const json::array& entries) {
  constexpr std::array kEpsilons{"1,absolute=true", "1", "0.1", "0.01", "0.0001"};
  MarkdownTable table({"graph", "topology", "KLD with ε = 1 in Λ's units",
                       "of its mean diagonal: 1", "0.1", "0.01", "0.0001", "thesis's"});
  for (const json::value& entry : entries) {
    if (text(entry, "part") != "regularization") continue;
    const std::string graph = text(entry, "name");
    for (const auto& [topology, by] : {std::pair{"clt", "clt"}, {"mi", "ncfd"}}) {
      Cells cells{graph, fmt::format("`{}`", topology)};
      for (const char* epsilon : kEpsilons) {
        const std::string name = fmt::format("{}:epsilon={}", topology, epsilon);
        cells.push_back(digits(median_of(contestant(entry, name), "kld")));
      }
      cells.push_back(said(thesis_loss(graph, "single", by, 5).kld));
      table.add(cells);
    }
  }
  return table.text();
}

// Beyond the thesis
// ------------------------------------------------------------------------------------------------

/// "701 of 3500"
std::string kept(const json::value* c, const char* of, const char* which) {
  const std::string name = of;
  return fmt::format("{} of {}", whole(median_of(c, name + "." + which)),
                     whole(median_of(c, name + ".in")));
}

Cells poses_and_factors(const json::value* c) {
  return {kept(c, "poses", "kept"), kept(c, "factors", "out")};
}

Cells blankets(const json::value* c) {
  return {digits(median_of(c, "problems.mean_blanket")),
          whole(median_of(c, "problems.largest_blanket"))};
}

/// How far all estimates are from where they would be; of that, the means.
Cells loss(const json::value* c) {
  return {digits(median_of(c, "kld")), digits(median_of(c, "kld_parts.mean"))};
}

std::string whole_table(const json::array& entries) {
  MarkdownTable table({"graph", "N", "topology", "poses", "factors", "blanket", "largest", "KLD",
                       "of that means", "aligned RMSE [m]", "time [s]"});
  for (const json::value& entry : entries) {
    if (text(entry, "part") != "space") continue;
    Cells cells{text(entry, "name"), fmt::format("{}", keep_every(entry))};
    for (const json::value& each : list(entry, "contestants")) {
      const json::value* c = &each;
      cells.push_back(name_of(c) == "clt" ? "`clt`" : "default");
      cells = joined(joined(cells, poses_and_factors(c)), blankets(c));
      table.add(joined(joined(cells, loss(c)), {digits(median_of(c, "rmse_aligned")), total(c)}));
      cells = {"", ""};
    }
  }
  return table.text();
}

std::string large_table(const json::array& entries) {
  MarkdownTable table({"graph", "removed", "poses", "factors", "blanket", "largest", "KLD",
                       "of that means", "KLD per node removed", "aligned RMSE [m]", "time [s]",
                       "per node removed [ms]"});
  for (const json::value& entry : entries) {
    if (text(entry, "part") != "large") continue;
    for (const json::value& each : list(entry, "contestants")) {
      const json::value* c = &each;
      const double removed = median_of(c, "poses.in") - median_of(c, "poses.kept");
      Cells cells{text(entry, "name"), name_of(c) == "late" ? "every 100 poses" : "at the end"};
      cells = joined(joined(joined(cells, poses_and_factors(c)), blankets(c)), loss(c));
      table.add(joined(cells,
                       {digits(median_of(c, "kld") / removed), digits(median_of(c, "rmse_aligned")),
                        total(c), milliseconds(median_of(c, "seconds.total") / removed)}));
    }
  }
  return table.text();
}

constexpr std::array<std::pair<const char*, const char*>, 4> kRedirections{
    {{"late", "by the most certain path"},
     {"place", "to the nearest in space, as exact"},
     {"order", "to the nearest by id, as exact"},
     {"early", "early, to the nearest by id, as exact"}}};

std::string online_table(const json::array& entries) {
  MarkdownTable table({"graph", "late factors are redirected", "poses", "factors", "KLD",
                       "of that means", "aligned RMSE [m]", "RMSE from all measurements [m]",
                       "median step [ms]", "99 %", "longest", "removal, all [s]"});
  for (const json::value& entry : entries) {
    const json::value* late = contestant(entry, "late");
    const auto step = [&](const char* which) {
      return milliseconds(number(entry, std::string("steps_of_all.") + which));
    };
    table.add({text(entry, "name"), "all nodes stay", whole(median_of(late, "poses.in")),
               whole(median_of(late, "factors.in")), "", "", "", "", step("median"), step("p99"),
               step("max"), ""});
    for (const auto& [name, how] : kRedirections) {
      const json::value* c = contestant(entry, name);
      if (!c) continue;
      Cells cells{"", how};
      cells = joined(joined(cells, poses_and_factors(c)), loss(c));
      table.add(joined(
          cells,
          {digits(median_of(c, "rmse_aligned")), digits(median_of(c, "rmse_full")),
           milliseconds(median_of(c, "steps.median")), milliseconds(median_of(c, "steps.p99")),
           milliseconds(median_of(c, "steps.max")), total(c)}));
    }
  }
  return table.text();
}

std::string selection_table(const json::array& entries) {
  MarkdownTable table({"graph", "selection", "poses", "factors", "blanket", "largest", "KLD",
                       "of that means", "aligned RMSE [m]", "selecting [s]", "removal [s]"});
  for (const json::value& entry : entries) {
    std::string graph = text(entry, "name");
    for (const json::value& each : list(entry, "contestants")) {
      const json::value* c = &each;
      Cells cells{graph, "`" + name_of(c) + "`"};
      cells = joined(joined(joined(cells, poses_and_factors(c)), blankets(c)), loss(c));
      table.add(joined(cells, {digits(median_of(c, "rmse_aligned")),
                               digits(median_of(c, "seconds.select")), total(c)}));
      graph.clear();
    }
  }
  return table.text();
}

}  // namespace

std::vector<Section> sparsify_sets_sections(const json::array& entries) {
  return {{"sparsify-counts", counts_table(entries)},
          {"sparsify-ratios", ratios_table(entries)},
          {"sparsify-recovery", recovery_table(entries)},
          {"sparsify-common", common_table(entries)}};
}

std::vector<Section> sparsify_topology_sections(const json::array& entries) {
  return {{"sparsify-topology", topology_table(entries)},
          {"sparsify-regularization", regularization_table(entries)}};
}

std::vector<Section> sparsify_whole_sections(const json::array& entries) {
  return {{"sparsify-space", whole_table(entries)}, {"sparsify-large", large_table(entries)}};
}

std::vector<Section> sparsify_online_sections(const json::array& entries) {
  return {{"sparsify-online", online_table(entries)}};
}

std::vector<Section> sparsify_selection_sections(const json::array& entries) {
  return {{"sparsify-selection", selection_table(entries)}};
}

}  // namespace cairn::performance
