// SPDX-License-Identifier: BSD-3-Clause
// Tables and picture of `cairn compact`.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string_view>

#include <fmt/format.h>
#include <boost/json/array.hpp>

#include "compact_published.hpp"
#include "contestants.hpp"
#include "json_access.hpp"
#include "statistics.hpp"
#include "tables.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;

/// Also of a graph that is simulated after the paper's: "kitti_00, simulated".
const Published* published(const json::value& entry) {
  const std::string whole_name = text(entry, "name");
  const std::string name = whole_name.substr(0, whole_name.find(','));
  const auto* found = std::ranges::find(kPublished, name, &Published::name);
  return found == kPublished.end() ? nullptr : found;
}

bool is_part(const json::value& entry, const char* part) { return text(entry, "part") == part; }

bool is_true(const json::value& entry, const char* path) {
  const json::value* value = member(entry, path);
  return value && *value == true;
}

/// "2.9 %" of 0.029.
std::string percent_of(double part) {
  return std::isfinite(part) ? fmt::format("{:.1f} %", 100.0 * part) : "-";
}

// Thresholds
// ------------------------------------------------------------------------------------------------

/// Options are kept as they are written on the command line.
double option(const json::value& entry, const std::string& path) {
  const std::string value = text(entry, path);
  return value.empty() ? kNone : std::stod(value);
}

std::string thresholds_table(const json::array& entries) {
  MarkdownTable table({"graph", "thresholds", "range [m]", "angle [rad]", "s",
                       "gain threshold, poses", "gain threshold, loops", "tries", "found in [s]"});
  for (const json::value& entry : entries) {
    std::string name = text(entry, "name");
    if (const Published* paper = published(entry)) {
      table.add({name, "the paper's", digits(paper->range), digits(paper->angle),
                 digits(paper->probability), digits(paper->pose_gain), digits(paper->loop_gain), "",
                 ""});
      name.clear();
    }
    for (const auto& [found, title] : {std::pair{"by_rule", "by the rule"},
                                       {"plain", "without relocation"},
                                       {"refined", "refined"}}) {
      std::vector<std::string> row{name, title};
      for (const char* of : {"range", "angle", "probability", "pose_gain", "loop_gain"})
        row.push_back(digits(option(entry, fmt::format("{}.options.{}", found, of))));
      row.push_back(fmt::format("{}", list(entry, std::string(found) + ".trials").size()));
      row.push_back(digits(number(entry, std::string(found) + ".seconds")));
      table.add(row);
      name.clear();
    }
  }
  return table.text();
}

// Times
// ------------------------------------------------------------------------------------------------

double part_of(const json::value* c, const std::string& what) {
  return median_of(c, what + ".kept") / median_of(c, what + ".in");
}

/// Of one that was given up it is known that it is more.
std::string faster(const json::value* apal, const json::value* fpfl) {
  if (!was_late(apal)) return times(paired_ratio(apal, fpfl));
  return "> " + times(number(*apal, "limit") / median_of(fpfl, "seconds.total"));
}

std::string times_table(const json::array& entries) {
  MarkdownTable table({"graph", "poses", "loops", "thresholds", "APAL [s]", "FPFL [s]", "faster",
                       "loops kept", "poses kept", "99 % of APAL's steps [ms]", "of FPFL's"});
  for (const json::value& entry : entries) {
    const json::value *apal = contestant(entry, "tested"), *fpfl = contestant(entry, "fpfl");
    const auto row = [&](std::vector<std::string> cells, const char* title, const json::value* c) {
      cells.insert(cells.end(),
                   {title, total(apal), total(c), faster(apal, c), percent_of(part_of(c, "loops")),
                    percent_of(part_of(c, "poses")), milliseconds(median_of(apal, "steps.p99")),
                    milliseconds(median_of(c, "steps.p99"))});
      table.add(cells);
    };
    row({text(entry, "name"), whole(median_of(fpfl, "poses.in")),
         whole(median_of(fpfl, "loops.in"))},
        "refined", fpfl);
    row({"", "", ""}, "without relocation", contestant(entry, "plain"));
    row({"", "", ""}, "as published", contestant(entry, "by_rule"));
    if (const Published* paper = published(entry)) {
      table.add({"", "", "", "the paper's", digits(paper->apal_seconds),
                 digits(paper->fpfl_seconds), times(paper->apal_seconds / paper->fpfl_seconds),
                 percent_of(paper->loops), percent_of(paper->poses), "", ""});
    }
  }
  return table.text();
}

// Errors
// ------------------------------------------------------------------------------------------------

constexpr std::array kErrors{"ate.translation", "ate.rotation",        "rpe.translation",
                             "rpe.rotation",    "rpe_all.translation", "rpe_all.rotation"};

/// A strategy with one way of putting poses back.
struct Estimate {
  const char* title;
  const char* contestant;
  const char* recovery;
};

constexpr std::array kEstimates{Estimate{"APAL", "apal", "v2"},
                                Estimate{"APAL, distance test", "tested", "v2"},
                                Estimate{"FPFL", "fpfl", "v2"},
                                Estimate{"FPFL, `likely`", "fpfl", "likely"},
                                Estimate{"FPFL without relocation", "plain", "v2"},
                                Estimate{"FPFL as published", "by_rule", "v2"},
                                Estimate{"RFPFL, loops first", "random", "v2"},
                                Estimate{"RFPFL, poses first", "random_poses", "v2"}};

constexpr double kExact = 1e-4;  // [m]

std::string recovered(const char* recovery, const char* error) {
  return fmt::format("errors.{}.{}", recovery, error);
}

double ate(const json::value* c, const char* recovery = "v2") {
  return median_of(c, recovered(recovery, kErrors.front()));
}

/// Where the truth is what APAL converges to, a ratio to its error has no meaning.
std::string over(double error, double reference) {
  if (!std::isfinite(error) || !std::isfinite(reference)) return "";
  return reference < kExact ? "-" : times(error / reference);
}

/// The paper divides the sum over the n (n - 1) / 2 pairs of all to all by n², so its root mean
/// squares are 1/√2 of what they should be.
std::vector<std::string> published_row(const char* title, const PublishedErrors& errors,
                                       const Published& paper) {
  std::vector<std::string> row{"", title};
  for (std::size_t k = 0; k < errors.size(); ++k)
    row.push_back(digits(k < 4 ? errors[k] : std::sqrt(2.0) * errors[k]));
  const bool is_apal = &errors == &paper.apal, is_random = &errors == &paper.random;
  row.push_back(is_apal ? "" : over(errors[0], paper.apal[0]));
  row.push_back(is_random ? over(errors[0], paper.fpfl[0]) : "");
  return row;
}

std::string errors_table(const json::array& entries) {
  MarkdownTable table({"graph", "strategy", "ATE [m]", "[°]", "RPE [m]", "[°]", "all to all [m]",
                       "[°]", "ATE over APAL's", "over FPFL's"});
  for (const json::value& entry : entries) {
    std::string name = text(entry, "name") + (is_true(entry, "de_facto") ? " †" : "");
    const double apal = ate(contestant(entry, "apal")), fpfl = ate(contestant(entry, "fpfl"));
    for (const Estimate& estimate : kEstimates) {
      const json::value* c = contestant(entry, estimate.contestant);
      const std::string_view who = estimate.contestant;
      const bool control = who.starts_with("random");
      std::vector<std::string> row{name, estimate.title};
      for (const char* error : kErrors)
        row.push_back(digits(median_of(c, recovered(estimate.recovery, error))));
      const double error = ate(c, estimate.recovery);
      row.push_back(who == "apal" ? "" : over(error, apal));
      row.push_back(control ? over(error, fpfl) : "");
      table.add(row);
      name.clear();
    }
    if (const Published* paper = published(entry)) {
      table.add(published_row("the paper's APAL", paper->apal, *paper));
      table.add(published_row("the paper's FPFL", paper->fpfl, *paper));
      if (std::isfinite(paper->random[0]))
        table.add(published_row("the paper's RFPFL", paper->random, *paper));
    }
  }
  return table.text();
}

/// What the control got, which may be fewer loops than asked for where poses are drawn first.
std::string control_table(const json::array& entries) {
  MarkdownTable table({"graph", "drawn first", "poses kept", "loops kept", "FPFL's loops",
                       "converged", "ATE over FPFL's: least", "median", "most"});
  for (const json::value& entry : entries) {
    std::string name = text(entry, "name");
    const json::value* fpfl = contestant(entry, "fpfl");
    for (const auto& [who, title] : {std::pair{"random", "loops"}, {"random_poses", "poses"}}) {
      const json::value* c = contestant(entry, who);
      if (!c) continue;
      std::vector<double> ratios;
      for (const json::value& run : list(*c, "runs"))
        ratios.push_back(number(run, "errors.v2.ate.translation") / ate(fpfl));
      if (ratios.empty()) continue;
      table.add({name, title, whole(median_of(c, "poses.kept")), whole(median_of(c, "loops.kept")),
                 whole(median_of(fpfl, "loops.kept")),
                 fmt::format("{:.0f} of {}", number(*c, "converged"), ratios.size()),
                 times(*std::ranges::min_element(ratios)), times(median(ratios)),
                 times(*std::ranges::max_element(ratios))});
      name.clear();
    }
  }
  return table.text();
}

/// The paper's Table 1, which is of kitti_00.
std::string recovery_table(const json::array& entries) {
  struct Row {
    const char* recovery;
    PublishedErrors paper;
  };
  constexpr std::array kRows{Row{"v0", {3.853, 3.392, 0.076, 0.459, 11.782, 3.374}},
                             Row{"v1", {3.818, 3.598, 0.064, 0.501, 12.363, 3.581}},
                             Row{"v2", {3.093, 2.250, 0.029, 0.119, 7.297, 2.223}},
                             Row{"likely", kNoErrors}};
  MarkdownTable table({"graph", "recovery", "ATE [m]", "[°]", "RPE [m]", "[°]", "all to all [m]",
                       "[°]", "with relocation: ATE [m]", "[°]"});
  for (const json::value& entry : entries) {
    std::string name = text(entry, "name");
    for (const Row& recovery : kRows) {
      std::vector<std::string> row{name, recovery.recovery};
      for (const char* error : kErrors) {
        row.push_back(
            digits(median_of(contestant(entry, "by_rule"), recovered(recovery.recovery, error))));
      }
      for (const char* error : {kErrors[0], kErrors[1]}) {
        row.push_back(
            digits(median_of(contestant(entry, "fpfl"), recovered(recovery.recovery, error))));
      }
      table.add(row);
      name.clear();
    }
    const Published* paper = published(entry);
    if (!paper || paper->name != "kitti_00") continue;
    for (const Row& recovery : kRows) {
      if (!std::isfinite(recovery.paper[0])) continue;
      std::vector<std::string> row{"", fmt::format("the paper's {}", recovery.recovery)};
      for (std::size_t k = 0; k < recovery.paper.size(); ++k)
        row.push_back(digits(k < 4 ? recovery.paper[k] : std::sqrt(2.0) * recovery.paper[k]));
      row.insert(row.end(), {"", ""});
      table.add(row);
    }
  }
  return table.text();
}

// Sensitivity
// ------------------------------------------------------------------------------------------------

/// The top of the paper's Figure 5.
std::string live_table(const json::array& entries) {
  MarkdownTable table({"graph", "poses kept", "of", "loops kept", "pairs asked for per pose",
                       "per loop kept", "memory [MB]", "ATE [m]", "[°]", "all loops [m]", "[°]",
                       "random [m]", "[°]", "odometry [m]", "[°]"});
  for (const json::value& entry : entries) {
    const json::value* kept = contestant(entry, "fpfl");
    const double asked = median_of(kept, "loops.proposed");
    std::vector<std::string> row{text(entry, "name") + (is_true(entry, "de_facto") ? " †" : ""),
                                 whole(median_of(kept, "poses.kept")),
                                 whole(median_of(kept, "poses.in")),
                                 whole(median_of(kept, "loops.kept")),
                                 digits(asked / median_of(kept, "poses.in")),
                                 digits(asked / median_of(kept, "loops.kept")),
                                 megabytes(median_of(kept, "peak_memory_bytes"))};
    for (const char* name : {"fpfl", "apal", "random", "odometry"}) {
      const json::value* c = contestant(entry, name);
      row.push_back(digits(median_of(c, "errors.likely.ate.translation")));
      row.push_back(digits(median_of(c, "errors.likely.ate.rotation")));
    }
    table.add(row);
  }
  return table.text();
}

std::string gain_table(const json::array& entries) {
  MarkdownTable table({"graph", "threshold over the rule's", "gain threshold [nats]", "loops kept",
                       "of all", "ATE [m]", "[°]", "over APAL's"});
  for (const json::value& entry : entries) {
    std::string name = text(entry, "name");
    const double apal = number(entry, "apal.errors.v2.ate.translation");
    for (const json::value& run : list(entry, "runs")) {
      const double error = number(run, "run.errors.v2.ate.translation");
      table.add({name, fmt::format("{:.3g}", number(run, "factor")),
                 digits(number(run, "loop_gain")), whole(number(run, "run.loops.kept")),
                 percent_of(number(run, "run.loops.kept") / number(run, "run.loops.in")),
                 digits(error), digits(number(run, "run.errors.v2.ate.rotation")),
                 over(error, apal)});
      name.clear();
    }
  }
  return table.text();
}

// Growth
// ------------------------------------------------------------------------------------------------

constexpr std::array kStrategies{std::pair{"tested", "APAL"}, std::pair{"fpfl", "FPFL"},
                                 std::pair{"by_rule", "FPFL as published"}};

std::string growth_table(const json::array& entries) {
  MarkdownTable table({"laps", "poses", "loops", "APAL [s]", "FPFL [s]", "poses kept", "loops kept",
                       "FPFL as published [s]", "poses kept", "loops kept"});
  for (const json::value& entry : entries) {
    if (!is_part(entry, "growth")) continue;
    const json::value *fpfl = contestant(entry, "fpfl"), *by_rule = contestant(entry, "by_rule");
    // Whoever was in time: they are fed with the same.
    double poses = kNone, loops = kNone;
    for (const json::value& c : list(entry, "contestants")) {
      if (list(c, "runs").empty()) continue;
      poses = median_of(&c, "poses.in");
      loops = median_of(&c, "loops.in");
    }
    std::vector<std::string> row{whole(number(entry, "laps")), whole(poses), whole(loops),
                                 total(contestant(entry, "tested"))};
    for (const json::value* c : {fpfl, by_rule}) {
      row.insert(row.end(),
                 {total(c), whole(median_of(c, "poses.kept")), whole(median_of(c, "loops.kept"))});
    }
    table.add(row);
  }
  return table.text();
}

std::string nonzeros_table(const json::array& entries) {
  MarkdownTable table({"laps", "H, APAL", "L, APAL", "H, FPFL", "L, FPFL", "H, FPFL as published",
                       "L, FPFL as published"});
  for (const json::value& entry : entries) {
    if (!is_part(entry, "growth")) continue;
    std::vector<std::string> row{whole(number(entry, "laps"))};
    for (const auto& [name, title] : kStrategies) {
      for (const char* of : {"nonzeros.information", "nonzeros.factor"})
        row.push_back(count(median_of(contestant(entry, name), of)));
    }
    table.add(row);
  }
  return table.text();
}

/// By the runs of some laps: the first few are another matter.
std::string laws(const json::array& entries) {
  constexpr double kFewestLaps = 5.0;
  std::string sentence;
  for (const auto& [name, title] : kStrategies) {
    std::vector<double> laps, seconds, nonzeros;
    for (const json::value& entry : entries) {
      const json::value* c = contestant(entry, name);
      const double time = median_of(c, "seconds.total");
      if (!is_part(entry, "growth") || number(entry, "laps") < kFewestLaps || !std::isfinite(time))
        continue;
      laps.push_back(number(entry, "laps"));
      seconds.push_back(time);
      nonzeros.push_back(median_of(c, "nonzeros.factor"));
    }
    if (laps.size() < 2) continue;
    sentence += fmt::format("{}{}: time as N^{:.2f}, nonzeros of L as N^{:.2f}",
                            sentence.empty() ? "" : "; ", title, fitted_exponent(laps, seconds),
                            fitted_exponent(laps, nonzeros));
  }
  return sentence.empty() ? "" : "\nFrom five laps on, " + sentence + ".\n";
}

std::string title_of(const std::string& name) {
  for (const auto& [known, title] : kStrategies) {
    if (name == known) return title;
  }
  return name == "apal" ? "APAL" : name;
}

std::string laps_table(const json::array& entries) {
  MarkdownTable table({"strategy", "laps", "poses kept", "loops kept"});
  MarkdownTable steps({"strategy", "all [s]", "median step, first quarter [ms]", "99 %",
                       "median step, last quarter", "99 %"});
  for (const json::value& entry : entries) {
    if (!is_part(entry, "laps")) continue;
    std::string title = title_of(text(entry, "name"));
    if (!is_true(entry, "in_time")) {
      table.add({title, whole(number(entry, "laps")),
                 fmt::format("not finished after {:.0f} s", number(entry, "limit")), "-"});
      continue;
    }
    steps.add({title, digits(number(entry, "run.seconds.total")),
               milliseconds(number(entry, "first_quarter.median")),
               milliseconds(number(entry, "first_quarter.p99")),
               milliseconds(number(entry, "last_quarter.median")),
               milliseconds(number(entry, "last_quarter.p99"))});
    for (const json::value& after : list(entry, "after")) {
      table.add({title, whole(number(after, "laps")), whole(number(after, "poses")),
                 whole(number(after, "loops"))});
      title.clear();
    }
  }
  return table.text() + "\n" + steps.text();
}

// Honesty
// ------------------------------------------------------------------------------------------------

/// Sums of the runs that knew.
struct Normalized {
  double squared = 0.0, dof = 0.0;
  int runs = 0;
};

Normalized normalized(const json::array& runs) {
  Normalized sum;
  for (const json::value& run : runs) {
    if (!std::isfinite(number(run, "dof"))) continue;
    sum.squared += number(run, "squared");
    sum.dof += number(run, "dof");
    ++sum.runs;
  }
  return sum;
}

std::string nees_table(const json::array& entries) {
  constexpr double kTwoSided = 1.96;  // of a normal distribution, 95 %
  MarkdownTable table(
      {"graph", "strategy", "runs", "DoF in total", "NEES/DoF", "95 % if consistent", "verdict"});
  for (const json::value& entry : entries) {
    if (!is_part(entry, "nees")) continue;
    const Normalized sum = normalized(list(entry, "runs"));
    const double mean = sum.squared / sum.dof;
    const double half = kTwoSided * std::sqrt(2.0 / sum.dof);  // of chi2 / dof, for many DoF
    const char* verdict = mean > 1.0 + half   ? "overconfident"
                          : mean < 1.0 - half ? "conservative"
                                              : "consistent";
    table.add({text(entry, "name"), title_of(text(entry, "strategy")), fmt::format("{}", sum.runs),
               whole(sum.dof), fmt::format("{:.4f}", mean),
               fmt::format("{:.4f} … {:.4f}", 1.0 - half, 1.0 + half), verdict});
  }
  return table.text();
}

std::string compare_table(const json::array& entries) {
  MarkdownTable table({"graph", "steps compared", "marginal covariances: not smaller",
                       "least ratio", "full covariance: not smaller", "least ratio",
                       "least eigenvalue"});
  for (const json::value& entry : entries) {
    if (!is_part(entry, "compare")) continue;
    const auto of = [&](const char* name) { return number(entry, std::string("compare.") + name); };
    const double least = of("least_eigenvalue");
    table.add({text(entry, "name"), whole(of("steps")), percent_of(of("marginal_conservative")),
               digits(of("least_marginal_ratio")), percent_of(of("full_conservative")),
               digits(of("least_full_ratio")),
               std::isfinite(least) ? fmt::format("{:.3g}", least) : "-"});
  }
  return table.text();
}

// False matches
// ------------------------------------------------------------------------------------------------

/// Of how many links the policy said so, as a median; it names no verdict that it never gave.
std::string verdicts(const json::value* c, const std::string& verdict) {
  if (!c) return "-";
  std::vector<double> counts;
  for (const json::value& run : list(*c, "runs")) {
    const double times_given = number(run, "verdicts." + verdict);
    counts.push_back(std::isfinite(times_given) ? times_given : 0.0);
  }
  return whole(median(counts));
}

std::string matches_table(const json::array& entries) {
  MarkdownTable table({"graph", "false matches", "gate", "registered", "of them false",
                       "loops kept", "of them false", "refused", "waiting", "poses kept", "ATE [m]",
                       "over clean"});
  for (const json::value& entry : entries) {
    std::string name = text(entry, "name");
    const double clean = ate(contestant(entry, "open, clean"));
    for (const char* which : {"open, clean", "gated, clean", "open, false", "gated, false"}) {
      const json::value* c = contestant(entry, which);
      const std::string_view kind = which;
      const std::string late = fmt::format("> {:.0f} s", c ? number(*c, "limit") : kNone);
      table.add({name, kind.ends_with("false") ? percent(number(entry, "false_rate")) : "none",
                 kind.starts_with("gated") ? fmt::format("{}", number(entry, "gate")) : "none",
                 was_late(c) ? late : whole(median_of(c, "loops.registered")),
                 whole(median_of(c, "loops.false_registered")), whole(median_of(c, "loops.kept")),
                 whole(median_of(c, "loops.false_kept")), verdicts(c, "inconsistent"),
                 verdicts(c, "waiting"), whole(median_of(c, "poses.kept")), digits(ate(c)),
                 times(ate(c) / clean)});
      name.clear();
    }
  }
  return table.text();
}

}  // namespace

std::vector<Section> compact_sets_sections(const json::array& entries) {
  return {{"compact-thresholds", thresholds_table(entries)},
          {"compact-times", times_table(entries)},
          {"compact-errors", errors_table(entries)},
          {"compact-control", control_table(entries)},
          {"compact-recovery", recovery_table(entries)}};
}

std::vector<Section> compact_gain_sections(const json::array& entries) {
  return {{"compact-gain", gain_table(entries)}};
}

std::vector<Section> compact_live_sections(const json::array& entries) {
  return {{"compact-live", live_table(entries)}};
}

std::vector<Section> compact_growth_sections(const json::array& entries) {
  return {
      {"compact-growth", growth_table(entries) + "\n" + nonzeros_table(entries) + laws(entries)},
      {"compact-laps", laps_table(entries)}};
}

std::vector<Section> compact_consistency_sections(const json::array& entries) {
  return {{"compact-nees", nees_table(entries)}, {"compact-compare", compare_table(entries)}};
}

std::vector<Section> compact_matches_sections(const json::array& entries) {
  return {{"compact-matches", matches_table(entries)}};
}

json::value compact_picture(const json::array& entries) {
  json::array graphs;
  for (const json::value& entry : entries) {
    if (!is_part(entry, "growth")) continue;
    for (const auto& [name, title] : kStrategies) {
      const json::value* c = contestant(entry, name);
      const double seconds = median_of(c, "seconds.total");
      if (!std::isfinite(seconds)) continue;
      json::object strategy{{"optimizer", title},
                            {"seconds", {{"median", seconds}}},
                            {"peak_memory_bytes", median_of(c, "peak_memory_bytes")}};
      graphs.push_back({{"graph", {{"file", title}, {"variables", median_of(c, "poses.in")}}},
                        {"configurations", json::array{std::move(strategy)}}});
    }
  }
  return json::object{{"command", "bench"}, {"graphs", graphs}};
}

}  // namespace cairn::performance
