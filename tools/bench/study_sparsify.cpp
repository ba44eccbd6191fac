// SPDX-License-Identifier: BSD-3-Clause
// Sparsification of whole graphs, as in Tables 4.1 to 4.3 of Vallvé (2018) and beyond.
#include <algorithm>
#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "json_access.hpp"
#include "sparsify_runs.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;
using Words = std::vector<std::string>;

/// A run is given up after so many seconds; the longer ones are not repeated that often, so that
/// all studies of `cairn sparsify` take a quarter of an hour.
constexpr double kLimit = 300.0, kEnough = 10.0;
constexpr int kFewRounds = 3;

Words joined(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

Contestant contestant(const std::string& name, const Words& arguments) {
  return {.name = name, .arguments = arguments, .limit = kLimit, .enough = kEnough};
}

json::object entry_of(const DataSet& set, const std::vector<Contestant>& contestants) {
  return {{"name", set.name}, {"contestants", entries_of(contestants)}};
}

// --- Tables 4.1 and 4.2 ---

/// ε of the mutual information is in Λ's units, and is 1 in the program of Mazuran et al. (2016),
/// from which the thesis takes it.
constexpr std::string_view kEpsilon = ":epsilon=1,absolute=true";
const std::string kTree = fmt::format("clt{}", kEpsilon), kPairs = fmt::format("mi{}", kEpsilon);

/// As many factors as twice a tree has, by one recovery; or the tree in closed form.
Contestant by(const std::string& recovery, const Words& experiment) {
  if (recovery == "clt") return contestant("clt", joined(experiment, {"--topology", kTree}));
  return contestant(recovery, joined(experiment, {"--topology", kPairs, "--population", "tree:2",
                                                  "--recovery", recovery}));
}

/// Those of the thesis, and without their options what `cairn sparsify` does by itself: each KLD
/// with both graphs linearised at the same states.
std::vector<Contestant> at_common_states(int keep_every, const std::string& scheme) {
  const Words thesis = thesis_experiment(keep_every, scheme, "common");
  Contestant tree = by("clt", thesis), pairs = by("ncfd", thesis);
  tree.name = "common clt";
  pairs.name = "common ncfd";
  return {tree, pairs,
          contestant("default", {"--online", "100", "--keep-every", fmt::format("{}", keep_every),
                                 "--scheme", scheme})};
}

json::object measure_recoveries(const Bench& bench, const DataSet& set, int keep_every,
                                const std::string& scheme) {
  std::vector<Contestant> contestants = at_common_states(keep_every, scheme);
  for (const char* recovery : {"clt", "ip", "fd", "ncfd"})
    contestants.push_back(by(recovery, thesis_experiment(keep_every, scheme)));
  sparsify_rounds(bench, set, contestants, bench.rounds);
  json::object entry = entry_of(set, contestants);
  entry["keep_every"] = keep_every;
  entry["scheme"] = scheme;
  return entry;
}

// --- Table 4.3 ---

json::object measure_topologies(const Bench& bench, const DataSet& set) {
  const Words experiment = thesis_experiment(5, "single");
  std::vector<Contestant> contestants{by("clt", experiment)};
  for (const char* population : {"tree:1.5", "tree:2", "fill:0.75", "fill:0.85"}) {
    for (const char* topology : {"mi", "dmi", "odd", "ekld"}) {
      const std::string topology_text =
          fmt::format("{}{}", topology, topology == std::string("odd") ? "" : kEpsilon);
      contestants.push_back(
          contestant(fmt::format("{} {}", population, topology),
                     joined(experiment, {"--topology", topology_text, "--population", population,
                                         "--recovery", "fd:initial=odb"})));
    }
  }
  sparsify_rounds(bench, set, contestants, kFewRounds);
  json::object entry = entry_of(set, contestants);
  entry["part"] = "topologies";
  return entry;
}

/// The regularisation of mutual information, of which the thesis does not say how much it is; ε as
/// a fraction of Λ's mean diagonal.
json::object measure_regularization(const Bench& bench, const DataSet& set) {
  std::vector<Contestant> contestants;
  for (const char* topology : {"clt", "mi"}) {
    for (const char* epsilon : {"1,absolute=true", "1", "0.1", "0.01", "0.0001"}) {
      const std::string name = fmt::format("{}:epsilon={}", topology, epsilon);
      contestants.push_back(
          contestant(name, joined(thesis_experiment(5, "single"), {"--topology", name})));
    }
  }
  sparsify_rounds(bench, set, contestants, 1);
  json::object entry = entry_of(set, contestants);
  entry["part"] = "regularization";
  return entry;
}

// --- whole graphs at once ---

json::object measure_whole(const Bench& bench, const std::string& part, const DataSet& set,
                           int keep_every, bool with_tree) {
  const Words keep{"--keep-every", fmt::format("{}", keep_every)};
  std::vector<Contestant> contestants{contestant("default", keep)};
  if (with_tree) contestants.push_back(contestant("clt", joined(keep, {"--topology", "clt"})));
  sparsify_rounds(bench, set, contestants, kFewRounds);
  json::object entry = entry_of(set, contestants);
  entry["part"] = part;
  entry["keep_every"] = keep_every;
  return entry;
}

json::object measure_growing(const Bench& bench, const DataSet& set) {
  const Words online{"--online", "100", "--keep-every", "5"};
  std::vector<Contestant> contestants{contestant("late", online)};
  sparsify_rounds(bench, set, contestants, kFewRounds);
  json::object entry = entry_of(set, contestants);
  entry["part"] = "large";
  entry["keep_every"] = 5;
  return entry;
}

// --- pose by pose ---

json::object measure_online(const Bench& bench, const DataSet& set) {
  const Words online{"--online", "100", "--keep-every", "5"};
  std::vector<Contestant> contestants{
      contestant("late", online), contestant("place", joined(online, {"--redirect-to", "place"})),
      contestant("order", joined(online, {"--redirect-to", "order"})),
      contestant("early", joined(online, {"--redirect", "early"}))};
  sparsify_rounds(bench, set, contestants, kFewRounds);
  json::object entry = entry_of(set, contestants);
  const Run all = bench.cairn.replay(set, {}, 1, kLimit);
  require_report(all);
  entry["steps_of_all"] = *member(all.report, "steps");
  return entry;
}

// --- which nodes leave ---

/// The distance is the one at which nearly half of the nodes of M3500 leave.
constexpr const char* kSelections[] = {"keep_every:every=2", "least_loss:part=0.5",
                                       "smallest_blanket:part=0.5", "oldest:part=0.5",
                                       "coverage:distance=0.5"};

json::object measure_selections(const Bench& bench, const DataSet& set) {
  std::vector<Contestant> contestants;
  for (const char* selection : kSelections)
    contestants.push_back(contestant(selection, {"--select", selection}));
  sparsify_rounds(bench, set, contestants, kFewRounds);
  return entry_of(set, contestants);
}

/// The first few sets.
std::vector<DataSet> first(std::vector<DataSet> sets, std::size_t most) {
  sets.resize(std::min(most, sets.size()));
  return sets;
}

}  // namespace

void study_sparsify_sets(const Bench& bench, const Keep& keep) {
  for_each_set("sparsify", thesis_sets(bench.data, bench.quick), [&](const DataSet& set) {
    for (const char* scheme : {"single", "multi"}) {
      for (const int keep_every : {3, 4, 5, 10})
        keep(measure_recoveries(bench, set, keep_every, scheme));
    }
  });
}

void study_sparsify_topology(const Bench& bench, const Keep& keep) {
  const std::vector<DataSet> sets = thesis_sets(bench.data, bench.quick);
  for_each_set("sparsify, topologies", first(sets, 2),
               [&](const DataSet& set) { keep(measure_topologies(bench, set)); });
  for_each_set("sparsify, regularisation", sets,
               [&](const DataSet& set) { keep(measure_regularization(bench, set)); });
}

void study_sparsify_whole(const Bench& bench, const Keep& keep) {
  for_each_set("sparsify in space", space_sets(bench.data, bench.quick), [&](const DataSet& set) {
    for (const int keep_every : {2, 4}) keep(measure_whole(bench, "space", set, keep_every, true));
  });
  for_each_set("sparsify, large", large_sets(bench.data, bench.quick), [&](const DataSet& set) {
    keep(measure_whole(bench, "large", set, 5, false));
    keep(measure_growing(bench, set));
  });
}

void study_sparsify_online(const Bench& bench, const Keep& keep) {
  for_each_set("sparsify online", sparsify_online_sets(bench.data, bench.quick),
               [&](const DataSet& set) { keep(measure_online(bench, set)); });
}

void study_sparsify_selection(const Bench& bench, const Keep& keep) {
  for_each_set("sparsify, selections", first(thesis_sets(bench.data, bench.quick), 1),
               [&](const DataSet& set) { keep(measure_selections(bench, set)); });
}

}  // namespace cairn::performance
