// SPDX-License-Identifier: BSD-3-Clause
#include "sparsify_runs.hpp"

#include <fmt/format.h>

#include "json_access.hpp"

namespace cairn::performance {
namespace {

namespace fs = std::filesystem;
namespace json = boost::json;
using Words = std::vector<std::string>;

/// What the tables want of a run; of `cairn replay` there is less.
json::object sparsify_summary(const json::value& report) {
  json::object all;
  for (const char* name :
       {"poses", "factors", "problems", "kld", "kld_parts", "rmse", "rmse_aligned", "rmse_full",
        "seconds", "steps", "redirected", "dropped", "loops", "kld_bound", "connectivity"}) {
    if (const json::value* found = member(report, name)) all[name] = *found;
  }
  return all;
}

}  // namespace

Words thesis_experiment(int keep_every, const std::string& scheme, const std::string& compared_at) {
  return {"--online",      "100",
          "--keep-every",  fmt::format("{}", keep_every),
          "--redirect",    "early",
          "--redirect-to", "next",
          "--scheme",      scheme,
          "--compared-at", compared_at,
          "--sparsifier",  "sparsify:linearize=local"};
}

void sparsify_rounds(const Bench& bench, const DataSet& set, std::vector<Contestant>& contestants,
                     int rounds) {
  run_rounds(
      bench.quick ? 1 : rounds, contestants,
      [&](const Contestant& c) {
        Run run = bench.cairn.sparsify(set, c.arguments, 1, c.limit);
        require_report(run);
        return run;
      },
      sparsify_summary);
}

fs::path record_problems(const Bench& bench, const DataSet& set, const std::string& name,
                         const Words& arguments) {
  fs::create_directories(bench.cairn.work());
  const fs::path file = bench.cairn.work() / (name + "_problems.json");
  Words words = arguments;
  words.insert(words.end(), {"--no-kld", "--record", file.string()});
  require_report(bench.cairn.sparsify(set, words, 1, 0.0));
  return file;
}

json::array solve_problems(const Bench& bench, const fs::path& problems, const Words& arguments) {
  const Run run = bench.cairn.solve_problems(problems, arguments, 0.0);
  require_report(run);
  return list(run.report, "rows");
}

}  // namespace cairn::performance
