// SPDX-License-Identifier: BSD-3-Clause
// Tables of single sparsification problems.
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <boost/json/array.hpp>

#include "json_access.hpp"
#include "tables.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;
using Cells = std::vector<std::string>;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

std::string title(const std::string& recording) {
  return recording == "online" ? "every 100 poses" : "whole graph";
}

/// The entry of a part; null if there is none.
const json::value* part(const json::array& entries, std::string_view name,
                        const std::string& recording) {
  for (const json::value& entry : entries) {
    if (text(entry, "part") == name && text(entry, "recording") == recording) return &entry;
  }
  return nullptr;
}

/// 0 stands for problems of all sizes.
int nodes_of(const json::value& row) {
  const double nodes = number(row, "nodes");
  return std::isfinite(nodes) ? static_cast<int>(nodes) : 0;
}

std::set<int> sizes(const json::value& entry) {
  std::set<int> all;
  for (const json::value& row : list(entry, "rows")) all.insert(nodes_of(row));
  return all;
}

/// `which` is a topology ("mi") or a recovery ("ncfd"), as it begins before its options, or "mi"
/// and "ncfd:initial=odb" with the options that matter.
double of(const json::value* entry, const char* member_name, const std::string& which, int nodes,
          const char* path) {
  if (!entry) return kNone;
  for (const json::value& row : list(*entry, "rows")) {
    const std::string name = text(row, member_name);
    const bool is_it =
        name == which || name.starts_with(which + ":") || name.starts_with(which + ",");
    if (is_it && nodes_of(row) == nodes) return number(row, path);
  }
  return kNone;
}

/// KLD that is nothing but rounding is 0.
std::string nats(double kld) {
  constexpr double kRounding = 1e-12;
  return std::abs(kld) < kRounding ? "0" : digits(kld);
}

std::string size_of(int nodes) { return nodes == 0 ? "all" : fmt::format("{}", nodes); }

constexpr std::array kRecordings{"online", "whole"};
constexpr std::array kMethods{"fd", "ncfd", "ip", "pqn"};

// Recovery
// ------------------------------------------------------------------------------------------------

std::string small(double value) {
  if (!std::isfinite(value)) return "-";
  return value < 1e-12 ? "0" : fmt::format("{:.0e}", value);
}

/// Who did not do what it should, over all problems of a recording.
class Failures {
 public:
  void add(const json::value& entry, const char* tolerance) {
    for (const json::value& row : list(entry, "rows")) {
      if (nodes_of(row) != 0) continue;
      runs_ += number(row, "problems") + number(row, "refused");
      const std::string recovery = text(row, "recovery");
      const std::string who = recovery.substr(0, recovery.find(':'));
      for (const auto& [what, title] : {std::pair{"not_converged", "did not converge"},
                                        {"not_positive", "gave no positive definite matrix"},
                                        {"refused", "were refused"}}) {
        if (number(row, what) > 0.0) {
          text_ +=
              fmt::format("; {:.0f} {} (`{}`, to {})", number(row, what), title, who, tolerance);
        }
      }
    }
  }
  std::string sentence() const {
    return fmt::format("{:.0f} recoveries{}.\n", runs_,
                       text_.empty() ? ": all converged to positive definite matrices" : text_);
  }

 private:
  double runs_ = 0.0;
  std::string text_;
};

std::string recovery_tables(const json::array& entries) {
  Cells heading{"recorded", "nodes", "problems", "factors", "KLD"};
  for (const char* tolerance : {"1e-3", "1e-6"}) {
    for (const char* method : kMethods)
      heading.push_back(method == kMethods.front()
                            ? fmt::format("above the least, to {}: `{}`", tolerance, method)
                            : fmt::format("`{}`", method));
  }
  MarkdownTable excess(heading);
  MarkdownTable work({"recorded", "nodes", "iterations, `fd`", "`ncfd`", "`ip`", "`pqn`",
                      "median time [µs], `fd`", "`ncfd`", "`ip`", "`pqn`"});
  Failures failures;
  for (const char* recording : kRecordings) {
    const json::value* loose = part(entries, "recovery", recording);
    const json::value* tight = part(entries, "tight", recording);
    if (!loose) continue;
    std::string name = title(recording);
    for (const int nodes : sizes(*loose)) {
      const auto get = [&](const json::value* entry, const char* method, const char* path) {
        return of(entry, "recovery", method, nodes, path);
      };
      Cells losses{name, size_of(nodes), whole(get(loose, "ip", "problems")),
                   digits(get(loose, "ip", "factors")), nats(get(loose, "ip", "kld"))};
      Cells efforts{name, size_of(nodes)};
      for (const json::value* entry : {loose, tight}) {
        for (const char* method : kMethods)
          losses.push_back(small(get(entry, method, "largest_excess")));
      }
      for (const char* method : kMethods)
        efforts.push_back(digits(get(loose, method, "iterations")));
      for (const char* method : kMethods)
        efforts.push_back(digits(1e6 * get(loose, method, "seconds.recovery_median")));
      excess.add(losses);
      work.add(efforts);
      name.clear();
    }
    failures.add(*loose, "1e-3");
    if (tight) failures.add(*tight, "1e-6");
  }
  return excess.text() + "\n" + work.text() + "\n" + failures.sentence();
}

// Initial guesses
// ------------------------------------------------------------------------------------------------

std::string initial_table(const json::array& entries) {
  constexpr std::array kGuesses{"identity", "odb", "ffd", "scaled"};
  MarkdownTable table(
      {"recorded", "nodes", "problems", "identity", "`odb`", "`ffd`", "`scaled`", "minimum"});
  for (const char* recording : kRecordings) {
    const json::value* entry = part(entries, "initial", recording);
    if (!entry) continue;
    std::string name = title(recording);
    for (const int nodes : sizes(*entry)) {
      if (nodes == 2) continue;  // one factor, which any of them finds
      const auto kld = [&](const std::string& method) {
        const auto get = [&](const char* path) {
          return of(entry, "recovery", method, nodes, path);
        };
        return fmt::format("{} ± {}", nats(get("kld")), nats(get("kld_deviation")));
      };
      Cells cells{name, size_of(nodes), whole(of(entry, "recovery", "ncfd", nodes, "problems"))};
      for (const char* guess : kGuesses) cells.push_back(kld(fmt::format("fd:initial={}", guess)));
      cells.push_back(kld("ncfd"));
      table.add(cells);
      name.clear();
    }
  }
  return table.text();
}

// Topologies
// ------------------------------------------------------------------------------------------------

std::string topologies_table(const json::array& entries) {
  constexpr std::array kTopologies{"mi", "dmi", "ekld", "odd", "l1", "best"};
  Cells heading{"recorded", "nodes", "problems", "factors"};
  for (const char* what : {"KLD, ", "time [µs], "}) {
    for (const char* topology : kTopologies)
      heading.push_back(
          fmt::format("{}`{}`", topology == kTopologies.front() ? what : "", topology));
  }
  MarkdownTable table(heading);
  for (const char* recording : kRecordings) {
    const json::value* entry = part(entries, "topology", recording);
    if (!entry) continue;
    std::string name = title(recording);
    for (const int nodes : sizes(*entry)) {
      if (nodes == 2) continue;
      const auto get = [&](const char* topology, const char* path) {
        // A mean over those that it did is no mean over all.
        if (of(entry, "topology", topology, nodes, "refused") > 0.0) return kNone;
        return of(entry, "topology", topology, nodes, path);
      };
      Cells cells{name, size_of(nodes), whole(get("mi", "problems")), digits(get("mi", "factors"))};
      for (const char* topology : kTopologies) cells.push_back(nats(get(topology, "kld")));
      for (const char* topology : kTopologies)
        cells.push_back(digits(1e6 * get(topology, "seconds.topology")));
      table.add(cells);
      name.clear();
    }
  }
  return table.text();
}

}  // namespace

std::vector<Section> sparsify_problems_sections(const json::array& entries) {
  return {{"sparsify-problems", recovery_tables(entries)},
          {"sparsify-initial", initial_table(entries)},
          {"sparsify-topologies", topologies_table(entries)}};
}

}  // namespace cairn::performance
