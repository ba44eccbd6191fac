// SPDX-License-Identifier: BSD-3-Clause
#include "bench_run.hpp"

#include <algorithm>
#include <functional>
#include <limits>
#include <utility>

#include <fmt/core.h>
#include <boost/json/parse.hpp>

#include "cairn/evaluation/plausibility.hpp"
#include "cairn/linear/iterative_solver.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/graph_labels.hpp"
#include "cairn/program/interrupt.hpp"
#include "cairn/program/option_words.hpp"
#include "cairn/program/peak_memory.hpp"
#include "cairn/program/progress.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"

namespace cairn::app {
namespace {

constexpr double kAgreement = 1e-6;  // of the lowest chi2
// Of the chi2 at the start: what cancels where chi2 goes to zero.
constexpr double kRounding = 1e-12;
constexpr int kBarWidth = 20;

std::vector<std::string> split_all(const std::vector<std::string>& lists) {
  std::vector<std::string> all;
  for (const std::string& list : lists) {
    for (std::string& name : split_components(list)) all.push_back(std::move(name));
  }
  return all;
}

/// The direct linear solvers on offer, cairn's own first: it is what the others are compared with.
/// `left_out` gets the iterative ones. One that cannot be made is left out with a note: nobody
/// asked for it by name.
std::vector<std::string> direct_linear_solvers(Session& session,
                                               std::vector<std::string>& left_out) {
  std::vector<std::string> direct;
  for (const std::string& name : session.registry().names(LinearSolver::kKind)) {
    try {
      const auto solver = session.registry().make<LinearSolver>(name);
      (query<IterativeSolver>(*solver) ? left_out : direct).push_back(name);
    } catch (const Error& error) {
      session.note(fmt::format("left out: {}", error.what()));
    }
  }
  // clang 14 does not compile std::ranges::stable_partition of libstdc++ 12.
  std::stable_partition(direct.begin(), direct.end(),
                        [](const std::string& name) { return name == kDefaultLinearSolver; });
  return direct;
}

/// The command line with which `cairn optimize` does what one run of a bench does.
std::vector<std::string> optimize_arguments(const BenchOptions& options, const std::string& graph,
                                            const Configuration& configuration,
                                            const CommonOptions& common) {
  std::vector<std::string> words{"optimize", graph, "--json", "-", "--quiet"};
  const auto add = [&](const char* option, const std::string& value) {
    if (!value.empty()) words.insert(words.end(), {option, value});
  };
  add("--optimizer", configuration.optimizer);
  add("--linear-solver", configuration.linear_solver);
  add("--initial", options.problem.initial);
  add("--loss", options.problem.loss);
  if (!options.problem.loss.empty()) add("--loss-on", options.problem.loss_on);
  add("--iterations", fmt::format("{}", options.problem.stop.max_iterations));
  add("--tolerance", fmt::format("{}", options.problem.stop.tolerance));
  add("--max-seconds", fmt::format("{}", options.problem.stop.max_seconds));
  add("--from", options.input.format);
  add("--threads", fmt::format("{}", common.threads));
  if (options.input.read.skip_unknown) words.push_back("--skip-unknown");
  if (options.input.read.repair_information) words.push_back("--repair-information");
  if (options.input.read.unit_information) words.push_back("--unit-information");
  if (options.input.read.skip_dangling) words.push_back("--skip-dangling");
  for (const std::string& file : common.plugins) add("--plugin", file);
  for (const std::string& types : common.types) add("--types", types);
  return words;
}

/// Peak memory can only be told for a whole process: one of its own for each configuration.
std::int64_t measure_memory(const BenchOptions& options, const std::string& graph,
                            const Configuration& configuration, const CommonOptions& common,
                            const InterruptGuard& guard) {
  const auto text =
      output_of_self(optimize_arguments(options, graph, configuration, common), guard.flag());
  if (!text) return 0;
  boost::json::error_code error;
  const boost::json::value report = boost::json::parse(*text, error);
  if (error || !report.is_object()) return 0;
  const boost::json::value* bytes = report.get_object().if_contains("peak_memory_bytes");
  return bytes && bytes->is_int64() ? bytes->get_int64() : 0;
}

/// "optimizer 'dogleg' with linear solver 'eigen'"
std::string in_words(const Configuration& configuration) {
  return fmt::format("optimizer '{}'{}", configuration.optimizer,
                     configuration.linear_solver.empty()
                         ? ""
                         : fmt::format(" with linear solver '{}'", configuration.linear_solver));
}

/// Throws `Error` (plugin), with what is on offer, if that name is not.
void check_on_offer(std::string_view kind, const std::string& name, Registry& registry) {
  if (!registry.has(kind, name)) registry.options(kind, name);
}

/// What `work` throws as the fault of a plugin; empty if it throws nothing.
template <class Work>
std::string fault_of_plugin(const Work& work) {
  try {
    work();
  } catch (const Error& error) {
    if (error.code() != ErrorCode::plugin) throw;
    return error.what();
  }
  return {};
}

/// One graph's runs, and the progress that is shown meanwhile.
class GraphBench {
 public:
  GraphBench(const BenchOptions& options, GraphResult& graph, Session& session,
             const InterruptGuard& guard)
      : options_(options),
        graph_(graph),
        session_(session),
        guard_(guard),
        line_(session.common.quiet) {}

  void run() {
    if (!options_.no_memory && graph_.loaded.name != "-") measure_all_memory();
    for (int round = 0; round < options_.repeat && !guard_.interrupted(); ++round) run_round(round);
  }

 private:
  std::size_t size() const { return graph_.results.size(); }

  void show(double part, const std::string& what, const Configuration& configuration) {
    const std::string text = fmt::format(
        "{}: {}, {}{}{}", graph_.loaded.label, what, configuration.optimizer,
        configuration.linear_solver.empty() ? "" : " with ", configuration.linear_solver);
    line_.show(line_.on_terminal() ? bar(part, kBarWidth) + " " + text : text);
  }

  void measure_all_memory() {
    for (ConfigurationResult& result : graph_.results) {
      if (guard_.interrupted()) return;
      if (!result.error.empty()) continue;
      show(0.0, "memory", result.configuration);
      result.peak_memory = measure_memory(options_, graph_.loaded.name, result.configuration,
                                          session_.common, guard_);
    }
  }

  void run_round(int round) {
    for (std::size_t k = 0; k < size() && !guard_.interrupted(); ++k) {
      ConfigurationResult& result = graph_.results[(k + static_cast<std::size_t>(round)) % size()];
      if (!result.error.empty()) continue;
      show((round + static_cast<double>(k) / static_cast<double>(size())) / options_.repeat,
           fmt::format("round {} of {}", round + 1, options_.repeat), result.configuration);
      try {
        call_plugin([&] { return in_words(result.configuration); }, [&] { run_once(result); });
      } catch (const Error& error) {
        result.error = in_command_line_words(error.what());
        result.plugin_fault = error.code() == ErrorCode::plugin;
      }
    }
  }

  void run_once(ConfigurationResult& result) {
    const auto optimizer = session_.registry().make<Optimizer>(result.configuration.spec());
    Graph graph = graph_.loaded.graph.clone();
    Stop stop = options_.problem.stop;
    stop.interrupt = &guard_.flag();
    Summary summary = optimizer->optimize(graph, stop);
    if (summary.status == Status::interrupted) return;
    if (result.runs.empty()) {
      result.doubts = reasons_for_doubt(graph, summary.final_chi2);
      if (!options_.html.empty()) result.states = graph.values();
    }
    result.runs.push_back(std::move(summary));
  }

  const BenchOptions& options_;
  GraphResult& graph_;
  Session& session_;
  const InterruptGuard& guard_;
  StatusLine line_;
};

GraphResult prepare(const std::string& name, const BenchOptions& options, const ProblemSetup& setup,
                    const Comparison& compared, const InterruptGuard& guard, Session& session) {
  GraphResult result;
  result.loaded = load_graph(name, options.input, session);
  GuessProgress progress(session.common.quiet, guard.flag());
  for (const std::string& note : setup.apply(result.loaded.graph, std::ref(progress))) {
    session.note(fmt::format("{}: initial guess {}: {}", name, options.problem.initial, note));
  }
  for (const Configuration& configuration : compared.configurations) {
    ConfigurationResult& row = result.results.emplace_back();
    row.configuration = configuration;
    row.error = configuration.broken;
    row.plugin_fault = !configuration.broken.empty();
  }
  return result;
}

const ConfigurationResult* first_that_ran(const GraphResult& graph) {
  for (const ConfigurationResult& result : graph.results) {
    if (!result.runs.empty()) return &result;
  }
  return nullptr;
}

double lowest_chi2(const GraphResult& graph) {
  double lowest = std::numeric_limits<double>::infinity();
  for (const ConfigurationResult& result : graph.results) {
    if (!result.runs.empty()) lowest = std::min(lowest, result.runs.front().final_chi2);
  }
  return lowest;
}

}  // namespace

ComponentSpec Configuration::spec() const {
  ComponentSpec spec = parse_component(optimizer);
  if (!linear_solver.empty()) spec.values[kLinearSolverOption] = linear_solver;
  return spec;
}

Comparison comparison(const BenchOptions& options, Session& session) {
  Registry& registry = session.registry();
  Comparison compared;
  const std::vector<std::string> given = split_all(options.linear_solvers);
  const std::vector<std::string> solvers =
      given.empty() ? direct_linear_solvers(session, compared.left_out) : given;
  for (const std::string& solver : solvers)
    check_on_offer(LinearSolver::kKind, parse_component(solver).name, registry);
  std::vector<Configuration>& all = compared.configurations;
  bool solvers_used = false;
  ComponentSpec refusing;
  for (const std::string& optimizer : split_all(options.optimizers)) {
    const ComponentSpec spec = parse_component(optimizer);
    check_on_offer(Optimizer::kKind, spec.name, registry);
    bool takes = false;
    const std::string fault = fault_of_plugin([&] { takes = takes_linear_solver(registry, spec); });
    if (!fault.empty()) {  // its plugin cannot be asked, and stands there once
      all.push_back({optimizer, "", fault});
      solvers_used = true;
    } else if (takes && !spec.values.contains(kLinearSolverOption)) {
      for (const std::string& solver : solvers) all.push_back({optimizer, solver, {}});
      solvers_used = true;
    } else {
      all.push_back({optimizer, "", {}});
      refusing = spec;
    }
  }
  if (!given.empty() && !solvers_used) throw linear_solver_refused(registry, refusing);
  if (!solvers_used) compared.left_out.clear();
  for (Configuration& configuration : all) {
    if (!configuration.broken.empty()) continue;
    configuration.broken = fault_of_plugin([&] { registry.make<Optimizer>(configuration.spec()); });
  }
  if (!compared.left_out.empty()) {
    session.note(fmt::format("left out as iterative: {}; --linear-solver compares them too",
                             joined(compared.left_out, ", ")));
  }
  return compared;
}

BenchResult run_bench(const BenchOptions& options, Session& session) {
  const std::vector<std::string> labels = graph_labels(options.graphs, options.names);
  const Comparison compared = comparison(options, session);
  const ProblemSetup setup(options.problem, session.registry());
  const InterruptGuard guard;
  BenchResult result{.graphs = {}, .left_out = compared.left_out};
  for (std::size_t k = 0; k < options.graphs.size() && !guard.interrupted(); ++k) {
    result.graphs.push_back(prepare(options.graphs[k], options, setup, compared, guard, session));
    result.graphs.back().loaded.label = labels[k];
    GraphBench(options, result.graphs.back(), session, guard).run();
  }
  result.interrupted = guard.interrupted();
  return result;
}

bool ran_out_of_time(const Summary& run, const Stop& stop) {
  return stop.max_seconds > 0.0 && run.status == Status::max_iterations &&
         std::ssize(run.iterations) < stop.max_iterations && run.seconds.total >= stop.max_seconds;
}

std::vector<std::string> configuration_labels(const std::vector<ConfigurationResult>& results) {
  const auto is_common = [&](std::string Configuration::*name) {
    return std::ranges::all_of(results, [&](const ConfigurationResult& result) {
      return result.configuration.*name == results.front().configuration.*name;
    });
  };
  const bool one_optimizer = is_common(&Configuration::optimizer);
  const bool one_solver = is_common(&Configuration::linear_solver);
  std::vector<std::string> labels;
  for (const ConfigurationResult& result : results) {
    const auto& [optimizer, solver, broken] = result.configuration;
    if (solver.empty() || (one_solver && !one_optimizer)) {
      labels.push_back(optimizer);
    } else if (one_optimizer && !one_solver) {
      labels.push_back(solver);
    } else {
      labels.push_back(fmt::format("{}, {}", optimizer, solver));
    }
  }
  return labels;
}

double median(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

std::vector<double> totals(const ConfigurationResult& result) {
  std::vector<double> all;
  for (const Summary& run : result.runs) all.push_back(run.seconds.total);
  return all;
}

const Summary& median_run(const ConfigurationResult& result) {
  std::vector<const Summary*> runs;
  for (const Summary& run : result.runs) runs.push_back(&run);
  const auto middle = runs.begin() + (std::ssize(runs) - 1) / 2;
  std::nth_element(runs.begin(), middle, runs.end(), [](const Summary* a, const Summary* b) {
    return a->seconds.total < b->seconds.total;
  });
  return **middle;
}

double paired_ratio(const ConfigurationResult& result, const GraphResult& graph) {
  const ConfigurationResult* first = first_that_ran(graph);
  std::vector<double> ratios;
  for (std::size_t k = 0; first && k < std::min(result.runs.size(), first->runs.size()); ++k) {
    ratios.push_back(result.runs[k].seconds.total / first->runs[k].seconds.total);
  }
  return median(ratios);
}

double chi2_excess(const ConfigurationResult& result, const GraphResult& graph) {
  if (result.runs.empty()) return std::numeric_limits<double>::quiet_NaN();
  const double lowest = lowest_chi2(graph);
  const double excess = result.runs.front().final_chi2 - lowest;
  return excess == 0.0 ? 0.0 : excess / lowest;
}

bool chi2_agrees(const ConfigurationResult& result, const GraphResult& graph) {
  if (result.runs.empty()) return false;
  const Summary& run = result.runs.front();
  const double lowest = lowest_chi2(graph);
  return run.final_chi2 - lowest <= std::max(kAgreement * lowest, kRounding * run.initial_chi2);
}

}  // namespace cairn::app
