// SPDX-License-Identifier: BSD-3-Clause
// Every way to solve the step, to convergence.
#include <fmt/format.h>

#include "json_access.hpp"
#include "statistics.hpp"
#include "studies.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;

// Runs shorter than this are repeated: their times vary more, and cost less.
constexpr double kShort = 5.0;
constexpr int kRepeats = 3;

/// A way to solve: the option of `cairn optimize` and its value.
struct Way {
  const char* option;
  std::string spec;
};

/// What is worth trying of a name besides its defaults. A name that is not here is run with those.
std::vector<std::string> variants(const std::string& name) {
  if (name == "block_cholesky") return {"ordering=amd"};
  if (name == "cholmod") {
    return {"mode=simplicial", "mode=supernodal", "mode=supernodal,ordering=metis",
            "mode=supernodal,ordering=nesdis"};
  }
  if (name == "pcg")
    return {"preconditioner=block_jacobi", "preconditioner=incomplete_cholesky",
            "preconditioner=subgraph"};
  if (name == "schur") return {"linear_solver=cholmod", "linear_solver=pcg"};
  if (name == "spqr") return {"ordering=metis"};
  return {};
}

/// Cairn's own first: it is what the others are compared with.
std::vector<Way> all_ways(const Bench& bench) {
  std::vector<Way> ways{{"--linear-solver", bench.ours}};
  for (const std::string& name : bench.cairn.names("linear_solver")) {
    std::vector<std::string> specs;
    for (const std::string& options : variants(name)) specs.push_back(name + ":" + options);
    specs = bench.cairn.accepted_solvers(specs);
    // Where all of its choices are spelled out, the default is one of them.
    if (name != "pcg") specs.insert(specs.begin(), name);
    for (const std::string& spec : specs) {
      if (spec != bench.ours) ways.push_back({"--linear-solver", spec});
    }
  }
  std::vector<std::string> ceres;
  for (const char* type : {"sparse_normal_cholesky", "sparse_schur", "dense_schur",
                           "iterative_schur", "cgnr", "dense_normal_cholesky", "dense_qr"})
    ceres.push_back(fmt::format("ceres:linear_solver_type={}", type));
  for (const std::string& spec : bench.cairn.accepted_optimizers(ceres))
    ways.push_back({"--optimizer", spec});
  return ways;
}

/// The program's complaint, without the folder in which the graph lies here.
std::string complaint_of(const Run& run, const DataSet& set) {
  std::string complaint = run.outcome.complaint;
  if (complaint.empty()) return "stopped by a signal";
  if (complaint.starts_with("cairn: ")) complaint.erase(0, 7);
  if (const std::size_t at = complaint.find(set.graph); at != std::string::npos)
    complaint.replace(at, set.graph.size(), set.name);
  return complaint;
}

std::string result_of(const Run& run, const DataSet& set, double limit) {
  if (!run.outcome.in_time) return fmt::format("not finished after {:.0f} s", limit);
  return run.report.is_null() ? complaint_of(run, set) : text(run.report, "status");
}

json::object measure(const Bench& bench, const DataSet& set, const Way& way, double limit) {
  json::object entry{{"name", set.name}, {"setting", way.spec}};
  std::vector<double> seconds;
  do {
    const Run run = bench.cairn.optimize(set, {way.option, way.spec}, 1, limit);
    entry["result"] = result_of(run, set, limit);
    entry["finished"] = run.outcome.in_time && !run.report.is_null();
    if (run.report.is_null()) break;
    seconds.push_back(number(run.report, "seconds.total"));
    for (const char* name : {"graph", "chi2", "solver", "peak_memory_bytes"})
      entry[name] = *member(run.report, name);
    entry["iterations"] = list(run.report, "iterations").size();
  } while (seconds.back() < kShort && seconds.size() < kRepeats && !bench.quick);
  if (!seconds.empty()) entry["seconds"] = median(seconds);
  return entry;
}

}  // namespace

void study_solvers(const Bench& bench, const Keep& keep) {
  const double limit = bench.quick ? 5.0 : 20.0;
  const std::vector<Way> ways = all_ways(bench);
  for (const DataSet& set : solver_sets(bench.data, bench.quick)) {
    for (const Way& way : ways) {
      tell(fmt::format("solvers: {}, {}", set.name, way.spec));
      json::object entry = measure(bench, set, way, limit);
      const bool read = entry.contains("graph");
      keep(std::move(entry));
      // What cairn's own solver does not even begin, such as a file that this build does not read,
      // the others do not either.
      if (!read && way.spec == bench.ours) break;
    }
  }
}

}  // namespace cairn::performance
