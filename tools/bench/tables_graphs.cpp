// SPDX-License-Identifier: BSD-3-Clause
// Tables and picture of the main comparison.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include <fmt/format.h>
#include <boost/json/array.hpp>

#include "json_access.hpp"
#include "statistics.hpp"
#include "tables.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;

constexpr int kIterations = 10;  // asked of each

bool is_ceres(const json::value& c) { return text(c, "optimizer").starts_with("ceres"); }
bool is_cholmod(const json::value& c) { return text(c, "linear_solver").starts_with("cholmod"); }

double per_iteration(const json::value& c) { return number(c, "seconds.per_iteration"); }

/// The fastest configuration of a family; nullptr if none ran.
template <class Belongs>
const json::value* best(const json::value& entry, const Belongs& belongs) {
  const json::value* found = nullptr;
  for (const json::value& c : list(entry, "measured.configurations")) {
    if (!belongs(c) || !std::isfinite(per_iteration(c))) continue;
    if (!found || per_iteration(c) < per_iteration(*found)) found = &c;
  }
  return found;
}

/// Median over the rounds of the ratio of the time of an iteration, peer to ours.
double paired_ratio(const json::value& peer, const json::value& ours) {
  const json::array &theirs = list(peer, "runs"), &mine = list(ours, "runs");
  std::vector<double> ratios;
  for (std::size_t k = 0; k < std::min(theirs.size(), mine.size()); ++k) {
    const auto seconds = [](const json::value& run) {
      return number(run, "seconds.total") / number(run, "iterations");
    };
    ratios.push_back(seconds(theirs[k]) / seconds(mine[k]));
  }
  return median(ratios);
}

/// "mode=supernodal,ordering=amd" as "supernodal, amd"; Ceres' radius is the same everywhere.
std::string setting(const json::value& c) {
  std::string spec = is_ceres(c) ? text(c, "optimizer") : text(c, "linear_solver");
  std::string values;
  std::size_t at = spec.find(':');
  while (at != std::string::npos) {
    const std::size_t next = spec.find(',', at + 1);
    const std::string pair = spec.substr(at + 1, next == std::string::npos ? next : next - at - 1);
    if (!pair.starts_with("initial_radius"))
      values += (values.empty() ? "" : ", ") + pair.substr(pair.find('=') + 1);
    at = next;
  }
  return values;
}

/// Ceres does not take steps that raise chi2, and does not linearise again then.
std::string steps_refused(const json::value& c) {
  const json::array& history = list(c, "history");
  const auto taken = std::count_if(history.begin(), history.end(), [](const json::value& it) {
    const json::value* accepted = member(it, "accepted");
    return accepted && accepted->is_bool() && accepted->get_bool();
  });
  return taken == kIterations ? "" : fmt::format("; {} of {} steps taken", taken, history.size());
}

struct Row {
  std::vector<std::string> cells;
  double cholmod = 0.0, ceres = 0.0;  ///< ratios
};

/// A peer's time with its setting, its ratio, how far its chi2 is from ours.
double add_peer(const json::value* peer, const json::value& ours, Row& row) {
  if (!peer) {
    row.cells.insert(row.cells.end(), {"-", "-"});
    return std::nan("");
  }
  const double ratio = paired_ratio(*peer, ours);
  row.cells.push_back(fmt::format("{} ({}{})", milliseconds(per_iteration(*peer)), setting(*peer),
                                  steps_refused(*peer)));
  row.cells.push_back(times(ratio));
  return ratio;
}

Row graph_row(const json::value& entry) {
  const json::value& ours = list(entry, "measured.configurations").front();
  const json::value *cholmod = best(entry, is_cholmod), *ceres = best(entry, is_ceres);
  Row row{{text(entry, "name"), fmt::format("{:.0f}", number(entry, "measured.graph.variables")),
           fmt::format("{:.0f}", number(entry, "measured.graph.factors")),
           milliseconds(per_iteration(ours))}};
  row.cholmod = add_peer(cholmod, ours, row);
  row.ceres = add_peer(ceres, ours, row);
  const double chi2 = number(ours, "chi2.final");
  row.cells.push_back(cholmod ? apart(number(*cholmod, "chi2.final"), chi2) : "-");
  row.cells.push_back(ceres ? apart(number(*ceres, "chi2.final"), chi2) : "-");
  const auto memory = [](const json::value* c) {
    return c ? megabytes(number(*c, "peak_memory_bytes")) : std::string("-");
  };
  row.cells.push_back(fmt::format("{} / {} / {}", memory(&ours), memory(cholmod), memory(ceres)));
  return row;
}

bool is_generated(const json::value& entry) {
  const json::value* generated = member(entry, "generated");
  return generated && generated->is_bool() && generated->get_bool();
}

void add_mean(const std::string& name, const std::vector<double>& cholmod,
              const std::vector<double>& ceres, MarkdownTable& table) {
  if (cholmod.empty() && ceres.empty()) return;
  const auto mean = [](const std::vector<double>& ratios) {
    return ratios.empty() ? std::string("-") : fmt::format("**{}**", times(geometric_mean(ratios)));
  };
  table.add({"**" + name + ", geometric mean**", "", "", "", "", mean(cholmod), "", mean(ceres), "",
             "", ""});
}

std::string comparison(const json::array& entries, int threads) {
  MarkdownTable table({"graph", "variables", "factors", "ours [ms]", "best `cholmod` [ms]",
                       "slower", "best `ceres` [ms]", "slower", "chi2 apart: cholmod", "ceres",
                       "peak memory [MB]"});
  for (const bool generated : {false, true}) {
    std::vector<double> cholmod, ceres;
    for (const json::value& entry : entries) {
      if (number(entry, "threads") != threads || is_generated(entry) != generated) continue;
      const Row row = graph_row(entry);
      table.add(row.cells);
      if (std::isfinite(row.cholmod)) cholmod.push_back(row.cholmod);
      if (std::isfinite(row.ceres)) ceres.push_back(row.ceres);
    }
    add_mean(generated ? "generated" : "published", cholmod, ceres, table);
  }
  return table.text();
}

/// Where an iteration's time goes, with one thread.
std::string parts(const json::array& entries) {
  MarkdownTable table({"graph", "linearise [ms]", "factorise", "solve", "update", "analyse, once",
                       "nonzeros of L", "flops", "ordering"});
  for (const json::value& entry : entries) {
    if (number(entry, "threads") != 1) continue;
    const json::value& ours = list(entry, "measured.configurations").front();
    std::vector<std::string> row{text(entry, "name")};
    for (const char* part : {"linearize", "factorize", "solve", "update", "analyze"}) {
      std::vector<double> seconds;
      for (const json::value& run : list(ours, "runs")) {
        const bool once = std::string_view(part) == "analyze";
        seconds.push_back(number(run, std::string("seconds.") + part) /
                          (once ? 1.0 : number(run, "iterations")));
      }
      row.push_back(milliseconds(median(seconds)));
    }
    row.insert(row.end(),
               {count(number(ours, "solver.factor_nonzeros")),
                count(number(ours, "solver.factor_flops")), text(ours, "solver.ordering")});
    table.add(row);
  }
  return table.text();
}

}  // namespace

std::vector<Section> graphs_sections(const json::array& entries) {
  return {{"graphs-1", comparison(entries, 1)},
          {"graphs-2", comparison(entries, 2)},
          {"parts", parts(entries)}};
}

json::value graphs_picture(const json::array& entries) {
  json::array graphs;
  for (const json::value& entry : entries) {
    if (number(entry, "threads") != 1) continue;
    json::array shown{list(entry, "measured.configurations").front()};
    for (const json::value* peer : {best(entry, is_cholmod), best(entry, is_ceres)}) {
      if (peer) shown.push_back(*peer);
    }
    for (json::value& c : shown) {
      json::object& bar = c.get_object();
      const bool ceres = is_ceres(c), cholmod = is_cholmod(c);
      bar["optimizer"] = ceres ? "ceres" : cholmod ? "cholmod" : "block_cholesky";
      bar["linear_solver"] = "-";
      // Of ten iterations, though Ceres may have ended before.
      const double scale = kIterations * per_iteration(c) / number(c, "seconds.median");
      if (!std::isfinite(scale)) continue;  // it did not run
      json::object& seconds = bar["seconds"].as_object();
      for (const char* name : {"median", "min", "max"})
        seconds[name] = scale * number(seconds, name);
    }
    graphs.push_back({{"graph", {{"file", text(entry, "name")}}}, {"configurations", shown}});
  }
  return json::object{{"command", "bench"}, {"graphs", graphs}};
}

}  // namespace cairn::performance
