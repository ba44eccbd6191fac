// SPDX-License-Identifier: BSD-3-Clause
#include "measure.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <boost/json/parse.hpp>

#include "json_access.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;

/// The report on standard output; null if there is none.
json::value parsed(const std::string& output) {
  json::parse_options options;
  options.allow_invalid_utf8 = true;
  json::error_code error;
  json::value report = json::parse(output, error, {}, options);
  return error ? json::value() : report;
}

void append(std::vector<std::string>& words, const std::vector<std::string>& more) {
  words.insert(words.end(), more.begin(), more.end());
}

/// All start from the states that a file gives, where a data set names no start: that is what peers
/// do.
void append_start(std::vector<std::string>& words) {
  if (std::ranges::find(words, "--initial") == words.end())
    append(words, {"--initial", "as_given"});
}

}  // namespace

void require_report(const Run& run) {
  const std::string& complaint = run.outcome.complaint;
  if (run.report.is_null() && run.outcome.in_time)
    throw std::runtime_error(complaint.empty() ? "killed" : complaint);
}

Cairn::Cairn(std::filesystem::path program, std::filesystem::path work)
    : program_(std::move(program)), work_(std::move(work)) {}

json::value Cairn::bench(const DataSet& set, const Contestants& contestants, int threads,
                         int rounds, const std::vector<std::string>& more) const {
  std::vector<std::string> words{program_,    "bench",
                                 set.graph,   "--json",
                                 "-",         "--quiet",
                                 "--threads", fmt::format("{}", threads),
                                 "--repeat",  fmt::format("{}", rounds)};
  append(words, set.arguments);
  append(words, more);
  append_start(words);
  if (!contestants.linear_solvers.empty()) append(words, {"--optimizer", contestants.optimizer});
  for (const std::string& name : contestants.complete) append(words, {"--optimizer", name});
  for (const std::string& name : contestants.linear_solvers)
    append(words, {"--linear-solver", name});
  const Outcome outcome = run_program(words, work_);
  json::value report = parsed(outcome.output);
  if (list(report, "graphs").empty()) throw std::runtime_error(outcome.complaint);
  return report;
}

Run Cairn::run(const std::vector<std::string>& command, const DataSet& set,
               const std::vector<std::string>& arguments, int threads, double limit) const {
  std::vector<std::string> words{program_};
  append(words, command);
  append(words, {set.graph, "--json", "-", "--quiet", "--threads", fmt::format("{}", threads)});
  append(words, set.arguments);
  append(words, arguments);
  Run run{run_program(words, work_, limit), {}};
  run.report = parsed(run.outcome.output);
  return run;
}

Run Cairn::optimize(const DataSet& set, const std::vector<std::string>& arguments, int threads,
                    double limit) const {
  std::vector<std::string> words = set.arguments;
  append(words, arguments);
  append_start(words);
  return run({"optimize"}, {set.name, set.graph, {}}, words, threads, limit);
}

Run Cairn::marginals(const DataSet& set, const std::vector<std::string>& arguments, int threads,
                     double limit) const {
  std::vector<std::string> words{"--as-given"};
  append(words, arguments);
  return run({"marginals"}, set, words, threads, limit);
}

Run Cairn::replay(const DataSet& set, const std::vector<std::string>& arguments, int threads,
                  double limit) const {
  return run({"replay"}, set, arguments, threads, limit);
}

Run Cairn::compact(const DataSet& set, const std::vector<std::string>& arguments, int threads,
                   double limit) const {
  return run({"study", "compact"}, set, arguments, threads, limit);
}

Run Cairn::sparsify(const DataSet& set, const std::vector<std::string>& arguments, int threads,
                    double limit) const {
  return run({"study", "sparsify"}, set, arguments, threads, limit);
}

Run Cairn::solve_problems(const std::filesystem::path& problems,
                          const std::vector<std::string>& arguments, double limit) const {
  std::vector<std::string> words{
      program_, "study", "problems", problems.string(), "--json", "-", "--quiet", "--threads", "1"};
  append(words, arguments);
  Run run{run_program(words, work_, limit), {}};
  run.report = parsed(run.outcome.output);
  return run;
}

Run Cairn::explore(const std::string& floor, const std::vector<std::string>& arguments, int threads,
                   double limit) const {
  return run({"explore"}, {floor, floor, {}}, arguments, threads, limit);
}

std::vector<std::string> Cairn::names(const std::string& kind) const {
  const json::value report =
      parsed(run_program({program_, "plugins", "--json", "-", "--quiet"}, work_).output);
  std::vector<std::string> found;
  for (const json::value& offer : list(report, "offers")) {
    if (text(offer, "kind") == kind) found.push_back(text(offer, "name"));
  }
  return found;
}

std::vector<std::string> Cairn::accepted(const std::string& option,
                                         const std::vector<std::string>& specs) const {
  const DataSet tiny{"tiny", "@manhattan:poses=4", {}};
  std::vector<std::string> all;
  for (const std::string& spec : specs) {
    constexpr int kUsage = 2, kPlugin = 5;
    const int code = optimize(tiny, {option, spec, "--iterations", "1"}, 1, 0.0).outcome.exit_code;
    if (code != kUsage && code != kPlugin) all.push_back(spec);
  }
  return all;
}

std::vector<std::string> Cairn::accepted_solvers(const std::vector<std::string>& specs) const {
  return accepted("--linear-solver", specs);
}

std::vector<std::string> Cairn::accepted_optimizers(const std::vector<std::string>& specs) const {
  return accepted("--optimizer", specs);
}

}  // namespace cairn::performance
