// SPDX-License-Identifier: BSD-3-Clause
// Maps and covariances of compact pose SLAM, as files that `cairn plot` draws: after Figures 3, 4,
// 6 and 7 of Ila et al. (2017).
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include <fmt/format.h>
#include <boost/json/serialize.hpp>

#include "compact_runs.hpp"
#include "json_access.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;
using Words = std::vector<std::string>;

/// The files of a set: work/figure_NAME_WHAT.
class Files {
 public:
  Files(const Bench& bench, std::string name)
      : folder_(bench.cairn.work()), name_(std::move(name)) {
    std::ranges::replace_if(
        name_, [](char c) { return c == ' ' || c == ','; }, '_');
  }
  std::string operator()(const char* what) const {
    return (folder_ / fmt::format("figure_{}_{}", name_, what)).string();
  }

 private:
  std::filesystem::path folder_;
  std::string name_;
};

/// The covariances of the poses kept, as the report of an optimisation has them for `cairn plot`.
void write_covariances(const Bench& bench, const DataSet& set, const Files& file) {
  const Run run =
      bench.cairn.optimize({set.name, file("fpfl.g2o"), set.arguments},
                           {"--covariance", "blocks", "-o", file("fpfl_optimized.g2o")}, 1, 0.0);
  require_report(run);
  std::ofstream(file("fpfl.json")) << json::serialize(run.report) << '\n';
}

/// Thresholds by the rule and Algorithm 1 as it was published: what the paper's figures show.
json::object draw_set(const Bench& bench, const FigureSet& figure) {
  const DataSet set = with_truth(bench, figure.set);
  const Files file(bench, set.name);
  const Thresholds rule =
      find_thresholds(bench, set, "figures", {"--error-ratio", "0", "--policy", kAsPublished});
  json::object entry{{"name", set.name}};
  const auto run = [&](const char* strategy, const char* policy, const Words& more) {
    Words words{"--strategy", strategy, "--policy", policy, "--thresholds", rule.file.string()};
    words.insert(words.end(), more.begin(), more.end());
    entry[strategy] = compact_summary(run_compact(bench, set, words).report);
  };
  run("apal", kAllLoops, {"-o", file("apal.g2o")});
  run("apfl", kAsPublished, {"-o", file("apfl.g2o")});
  Words outputs{"-o", file("fpfl.g2o"), "--trajectory", file("trajectory.g2o")};
  if (figure.norms) outputs.insert(outputs.end(), {"--compare", file("norms.csv")});
  run("fpfl", kAsPublished, outputs);
  write_covariances(bench, figure.set.set, file);
  return entry;
}

}  // namespace

void study_compact_figures(const Bench& bench, const Keep& keep) {
  for (const FigureSet& figure : figure_sets(bench.data, bench.quick))
    attempt("compact, figures: " + figure.set.set.name, [&] { keep(draw_set(bench, figure)); });
}

}  // namespace cairn::performance
