// SPDX-License-Identifier: BSD-3-Clause
// cairn info GRAPH: what a graph consists of, and what looks wrong.
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>

#include <fmt/core.h>

#include "cairn/evaluation/graph_survey.hpp"
#include "cairn/information/graph_information.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/covariances.hpp"
#include "cairn/program/error_metric.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/other_input.hpp"
#include "cairn/program/problem_setup.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

struct InfoOptions {
  std::string graph;
  InputOptions input;
  BodyOptions body;
  bool entropy = false;
  std::string linear_solver = kDefaultLinearSolver;  ///< of the entropy

  static auto fields() {
    using O = InfoOptions;
    return OptionFields<O>()
        .text("graph", &O::graph,
              std::string(kGraphHelp) + "; or the map of a floor (.yaml, .png:resolution=R)")
        .positional()
        .placeholder("GRAPH")
        .or_generated_by({"generator"})
        .required()
        .boolean("entropy", &O::entropy,
                 "entropy of the graph at the states of the file, in nats: optimise it first")
        .component("linear_solver", &O::linear_solver, {"linear_solver"},
                   "gives the determinant for --entropy")
        .part(&O::body)
        .part(&O::input);
  }
};

/// The entropy that was asked for. Without a value: H is singular.
struct Entropy {
  std::optional<GraphEntropy> value;
  std::string linear_solver;
  double seconds = 0.0;
};

std::string ratio_text(const GraphSurvey& s) {
  const bool defined = s.degrees_of_freedom > 0 && std::isfinite(s.chi2);
  return defined ? fmt::format(" ({:.4g} per degree of freedom)",
                               s.chi2 / static_cast<double>(s.degrees_of_freedom))
                 : "";
}

std::string gauge_text(const Graph& graph, const GraphSurvey& s) {
  if (s.gauge.anchored.empty()) {
    return s.gauge.left_free.empty() ? "0" : fmt::format("not known ({})", s.gauge.describe(graph));
  }
  return fmt::format("{} ({})", s.gauge_freedoms, s.gauge.describe(graph));
}

std::string counts_text(const LoadedGraph& loaded, const GraphSurvey& s, bool colour) {
  Table types({{"type", Table::Align::left},
               {"count", Table::Align::right},
               {"size", Table::Align::right},
               {"chi2", Table::Align::right},
               {"", Table::Align::left}},
              "  ");
  for (const GraphSurvey::VariableCount& v : s.variables) {
    types.add({v.tag, fmt::format("{}", v.count), fmt::format("{}", v.tangent_size), "",
               v.fixed > 0 ? fmt::format("{} fixed", v.fixed) : ""});
  }
  for (const GraphSurvey::FactorCount& f : s.factors) {
    types.add({f.tag, fmt::format("{}", f.count), fmt::format("{}", f.residual_size),
               chi2_text(f.chi2), f.metric.empty() ? "" : "metric " + f.metric});
  }
  return fmt::format("{} ({})\n{}", bold(loaded.label, colour), loaded.report.format,
                     types.text(colour));
}

std::string entropy_text(const Entropy& entropy) {
  if (!entropy.value) return "none: H is singular";
  return fmt::format("{:.8g} nats ({} unknowns, ln |H| {:.8g})", entropy.value->entropy,
                     entropy.value->size, entropy.value->log_determinant);
}

std::string figures_text(const Graph& graph, const GraphSurvey& s,
                         const std::optional<Entropy>& entropy, const Session& session) {
  Table table({{"", Table::Align::left}, {"", Table::Align::left}}, "  ");
  add_metric(table, graph, session);
  table.add({"components", fmt::format("{}", s.gauge.components)});
  table.add({"odometry / loop closures", fmt::format("{} / {}", s.odometry, s.loops)});
  table.add({"gauge freedoms", gauge_text(graph, s)});
  table.add({"residuals / unknowns",
             fmt::format("{} / {}", graph.residual_size(), graph.tangent_size())});
  table.add({"degrees of freedom", fmt::format("{}", s.degrees_of_freedom)});
  table.add({"chi2, initial", chi2_text(s.chi2) + ratio_text(s)});
  if (entropy) table.add({"entropy", entropy_text(*entropy)});
  return table.text(false);
}

std::string list_text(const std::string& title, const std::vector<std::string>& lines,
                      bool colour) {
  if (lines.empty()) return "";
  std::string text = bold(title, colour) + "\n";
  for (const std::string& line : lines) {
    text += fmt::format("  {}\n", joined(folded(line, output_width() - 4), "\n    "));
  }
  return text;
}

std::string worst_text(const GraphSurvey& s, bool colour) {
  if (!(s.chi2 > 0)) return "";
  Table table({{"worst factors", Table::Align::left},
               {"chi2", Table::Align::right},
               {"share", Table::Align::right}},
              "  ");
  for (const GraphSurvey::WorstFactor& factor : s.worst) {
    const double share = factor.chi2 / s.chi2;
    table.add({factor.name, chi2_text(factor.chi2),
               std::isfinite(s.chi2) ? fmt::format("{:.1f} %", 100 * share) : "-"});
  }
  return table.text(colour);
}

json::array variables_json(const GraphSurvey& s) {
  json::array all;
  for (const GraphSurvey::VariableCount& v : s.variables) {
    all.push_back({{"type", v.tag},
                   {"count", v.count},
                   {"tangent_size", v.tangent_size},
                   {"fixed", v.fixed}});
  }
  return all;
}

json::array factors_json(const GraphSurvey& s) {
  json::array all;
  for (const GraphSurvey::FactorCount& f : s.factors) {
    all.push_back({{"type", f.tag},
                   {"count", f.count},
                   {"residual_size", f.residual_size},
                   {"chi2", f.chi2},
                   {"metric", text_json(f.metric)}});
  }
  return all;
}

json::array worst_json(const GraphSurvey& s) {
  json::array all;
  for (const GraphSurvey::WorstFactor& factor : s.worst) {
    all.push_back({{"factor", factor.name}, {"chi2", factor.chi2}});
  }
  return all;
}

json::array ids_json(const Graph& graph, const std::vector<int>& variables) {
  json::array ids;
  for (const int variable : variables) ids.push_back(graph.id(variable));
  return ids;
}

/// Null where H is singular.
json::value entropy_json(const Entropy& entropy) {
  if (!entropy.value) return nullptr;
  return {{"nats", entropy.value->entropy},
          {"size", entropy.value->size},
          {"log_determinant", entropy.value->log_determinant},
          {"linear_solver", entropy.linear_solver}};
}

json::object report_json(const LoadedGraph& loaded, const GraphSurvey& s,
                         const std::optional<Entropy>& entropy) {
  json::object report = begin_report("info");
  report["graph"] = graph_json(loaded.graph, loaded.name);
  report["format"] = loaded.report.format;
  report["variables"] = variables_json(s);
  report["factors"] = factors_json(s);
  report["components"] = s.gauge.components;
  report["gauge"] = {{"freedoms", s.gauge_freedoms},
                     {"anchored", ids_json(loaded.graph, s.gauge.anchored)},
                     {"left_free", ids_json(loaded.graph, s.gauge.left_free)}};
  report["odometry"] = s.odometry;
  report["loop_closures"] = s.loops;
  report["doubled"] = s.doubled;
  report["chain_gaps"] = s.chain_gaps;
  report["unconstrained"] = std::ssize(s.gauge.unconstrained);
  report["degrees_of_freedom"] = s.degrees_of_freedom;
  report["chi2"] = json::object{{"initial", s.chi2}};
  report["worst"] = worst_json(s);
  report["suspicions"] = strings_json(s.suspicions);
  report["read_notes"] = strings_json(sentences(loaded.report));
  json::object& seconds = report["seconds"].emplace_object();
  seconds["read"] = loaded.seconds;
  if (entropy) {
    seconds["entropy"] = entropy->seconds;
    report["entropy"] = entropy_json(*entropy);
  }
  return report;
}

Entropy entropy_of(const Graph& graph, const std::string& name, LinearSolver& solver) {
  Entropy result{std::nullopt, name, 0.0};
  const auto begin = std::chrono::steady_clock::now();
  result.value = call_plugin([&] { return fmt::format("linear solver '{}'", name); },
                             [&] { return entropy(graph, solver); });
  result.seconds = seconds_since(begin);
  return result;
}

int run(const InfoOptions& options, Session& session) {
  session.use_threads();
  if (const auto other = other_input(options.graph, session)) {
    if (options.entropy) {
      throw Error(ErrorCode::usage, fmt::format("--entropy is of graphs, and {} is {}",
                                                options.graph, other->what()));
    }
    return other->info(options.graph, options.body, session);
  }
  std::optional<CovarianceSolver> solver;  // a wrong name is reported before the file is read
  if (options.entropy)
    solver = make_determinant_solver(options.linear_solver, session.registry(), false);
  const LoadedGraph loaded = load_graph(options.graph, options.input, session);
  const GraphSurvey s = survey_graph(loaded.graph);
  Results results;
  std::optional<Entropy> entropy;
  if (solver) {
    entropy.emplace();
    results.add([&] { entropy = entropy_of(loaded.graph, solver->name, *solver->solver); });
  }
  results.add([&] { session.write_json(report_json(loaded, s, entropy)); });
  results.add([&] {
    const bool colour = session.colour();
    session.print(counts_text(loaded, s, colour) + figures_text(loaded.graph, s, entropy, session) +
                  worst_text(s, colour) + list_text("what looks wrong", s.suspicions, colour));
  });
  results.finish();
  return 0;
}

}  // namespace

void add_info(Registrar& registrar) {
  add_command<InfoOptions>(registrar, "info",
                           "Example:\n"
                           "  cairn info sphere2500.g2o --types slam3d:metric=g2o\n"
                           "  cairn info best.g2o --entropy\n"
                           "  cairn info floor.yaml --radius 0.3",
                           run);
}

}  // namespace cairn::app
