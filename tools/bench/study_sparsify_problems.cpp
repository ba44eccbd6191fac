// SPDX-License-Identifier: BSD-3-Clause
// Single sparsification problems, as in Figures 4.5 to 4.9 of Vallvé (2018): those that come up in
// the thesis's experiment, and those of the whole graph, which are larger.
#include <fmt/format.h>

#include "sparsify_runs.hpp"

namespace cairn::performance {
namespace {

namespace fs = std::filesystem;
namespace json = boost::json;
using Words = std::vector<std::string>;

/// The option once for each of its values.
Words each(const std::string& option, const Words& values) {
  Words words;
  for (const std::string& value : values) words.insert(words.end(), {option, value});
  return words;
}

Words joined(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

struct Recording {
  std::string name;
  Words arguments;
  /// `best` tries no more topologies than this: all of six nodes with a part of 0.75, or of five.
  int most = 0;
};

std::vector<Recording> recordings(bool quick) {
  const Words by_information{"--topology", "mi"};
  return {{"online", joined(thesis_experiment(5, "single"), by_information), quick ? 100 : 1000},
          {"whole", joined({"--keep-every", "5"}, by_information), 100}};
}

/// The curves of Figures 4.6 (against iterations, from several beginnings) and 4.7 (against time),
/// as CSV, which ./dev bench draws.
void draw_convergence(const Bench& bench, const fs::path& problems) {
  const auto curves = [&](const char* file, const char* against, const Words& recoveries) {
    Words words{"--topology", "mi", "--population", "tree:2"};
    words = joined(std::move(words), each("--recovery", recoveries));
    solve_problems(bench, problems,
                   joined(std::move(words), {"--curves", (bench.cairn.work() / file).string(),
                                             "--against", against}));
  };
  curves("sparsify_iterations.csv", "iterations",
         {"ip:initial=identity", "pqn:initial=identity", "pqn:initial=odb", "fd:initial=identity",
          "fd:initial=odb", "fd:initial=ffd"});
  curves("sparsify_times.csv", "time", {"ip:initial=odb", "fd", "ncfd"});
}

void measure_problems(const Bench& bench, const DataSet& set, const Recording& recording,
                      const Keep& keep) {
  const fs::path problems = record_problems(bench, set, recording.name, recording.arguments);
  const auto part = [&](const char* name, const Words& arguments) {
    keep({{"part", name},
          {"name", set.name},
          {"recording", recording.name},
          {"rows", solve_problems(bench, problems, arguments)}});
  };
  const Words same_factors{"--topology", "mi", "--population", "tree:2"};
  part("recovery", joined(same_factors, each("--recovery", {"fd", "ncfd", "ip", "pqn"})));
  part("tight",
       joined(same_factors, each("--recovery", {"fd:tolerance=1e-6", "ncfd:tolerance=1e-6",
                                                "ip:tolerance=1e-6", "pqn:tolerance=1e-6"})));
  part("initial",
       joined(same_factors,
              each("--recovery",
                   {"fd:initial=identity,iterations=0", "fd:initial=odb,iterations=0",
                    "fd:initial=ffd,iterations=0", "fd:initial=scaled,iterations=0", "ncfd"})));
  if (recording.name == "online") draw_convergence(bench, problems);
  part("topology",
       joined({"--population", "fill:0.75", "--recovery", "ncfd"},
              each("--topology", {"mi", "dmi", "ekld", "odd", "l1",
                                  fmt::format("best:most={},beyond=refuse", recording.most)})));
}

}  // namespace

void study_sparsify_problems(const Bench& bench, const Keep& keep) {
  const std::vector<DataSet> sets = thesis_sets(bench.data, bench.quick);
  if (sets.empty()) return;
  for (const Recording& recording : recordings(bench.quick)) {
    attempt("sparsify, problems: " + recording.name,
            [&] { measure_problems(bench, sets.front(), recording, keep); });
  }
}

}  // namespace cairn::performance
