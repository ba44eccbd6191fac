// SPDX-License-Identifier: BSD-3-Clause
// cairn marginals GRAPH: how certain the estimate is.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "cairn/geometry/pose.hpp"
#include "cairn/information/graph_information.hpp"
#include "cairn/io/format.hpp"
#include "cairn/linear/graph_marginals.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/covariances.hpp"
#include "cairn/program/error_metric.hpp"
#include "cairn/program/figures.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/interrupt.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/problem_setup.hpp"
#include "cairn/program/progress.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/runtime/timed.hpp"
#include "cairn/typed/symbol.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

/// Rows of the table for people; the rest is in the file and in the report.
constexpr std::size_t kMostShown = 30;

struct MarginalsOptions {
  std::string graph;
  std::string output;
  InputOptions input;
  ProblemOptions problem;
  std::string optimizer = kDefaultOptimizer;
  std::string linear_solver = kDefaultLinearSolver;
  bool as_given = false;
  bool diagonal = false;
  std::vector<std::string> pairs;   ///< "A:B"
  std::string column;               ///< an id, "last", or empty
  std::vector<std::string> mutual;  ///< "A:B", each an id or several as "A+B"

  static auto fields() {
    using O = MarginalsOptions;
    return OptionFields<O>()
        .text("graph", &O::graph, kGraphHelp)
        .positional()
        .placeholder("GRAPH")
        .or_generated_by({"generator"})
        .required()
        .boolean("diagonal", &O::diagonal,
                 "the block of every variable; what is done if nothing else is asked for")
        .text("pairs", &O::pairs, "the blocks of these pairs of ids")
        .placeholder("A:B,…")
        .separated_by(',')
        .text("column", &O::column, "the blocks of all variables with this id, or last")
        .placeholder("ID")
        .text("mutual_information", &O::mutual,
              "of these pairs of ids, or of sets of ids as A+B:C+D, in nats")
        .placeholder("A:B,…")
        .separated_by(',')
        .text("output", &O::output, "write the blocks as text (- is standard output)")
        .letter('o')
        .placeholder("FILE")
        .boolean("as_given", &O::as_given,
                 "at the states as they are, or as --initial puts them: do not optimise")
        .component("optimizer", &O::optimizer, {"optimizer"},
                   "the optimizer that finds the estimate")
        .component("linear_solver", &O::linear_solver, {"linear_solver"},
                   "solves H x = g, and gives the covariances")
        .part(&O::problem)
        .part(&O::input);
  }
};

/// What is asked for, by variables of the graph.
struct Request {
  bool diagonal = false;
  std::vector<std::pair<int, int>> pairs;
  std::optional<int> column;
  std::vector<VariableSets> mutual;
};

/// One block of Σ.
struct Block {
  int a, b;  ///< variables
  std::span<const double> values;
};

struct Answer {
  std::vector<double> diagonal, pairs, column;
  std::vector<double> mutual;               ///< I(a; b) [nats]
  double factorize = 0.0, marginals = 0.0;  ///< [s]; analysis with the first
};

// What is asked for -----------------------------------------------------------------------------

int variable_of(const std::string& text, const Graph& graph, const char* option) {
  const std::optional<Id> id = id_from_text(text);
  if (!id) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: '{}' is not an id of a variable; expected an integer, or a symbol "
                            "such as x3",
                            option, text));
  }
  if (const std::optional<int> found = graph.find(*id)) return *found;
  Id first = std::numeric_limits<Id>::max(), last = 0;
  for (int v = 0; v < graph.variable_count(); ++v) {
    first = std::min(first, graph.id(v));
    last = std::max(last, graph.id(v));
  }
  throw Error(ErrorCode::input,
              fmt::format("{}: the graph has no variable {}; the ids of its {} are between {} and "
                          "{}",
                          option, text, plural(graph.variable_count(), "variable"), id_text(first),
                          id_text(last)));
}

std::pair<int, int> pair_of(const std::string& text, const Graph& graph) {
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) {
    throw Error(ErrorCode::usage,
                fmt::format("--pairs: '{}' is not a pair of ids; expected A:B,C:D", text));
  }
  return {variable_of(text.substr(0, colon), graph, "--pairs"),
          variable_of(text.substr(colon + 1), graph, "--pairs")};
}

/// "3", or "3+7+8".
std::vector<int> set_of(const std::string& text, const Graph& graph) {
  std::vector<int> variables;
  std::size_t begin = 0;
  while (true) {
    const std::size_t end = text.find('+', begin);
    variables.push_back(
        variable_of(text.substr(begin, end - begin), graph, "--mutual-information"));
    if (end == std::string::npos) return variables;
    begin = end + 1;
  }
}

VariableSets sets_of(const std::string& text, const Graph& graph) {
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) {
    throw Error(ErrorCode::usage,
                fmt::format("--mutual-information: '{}' is not a pair of ids, or of sets of them; "
                            "expected A:B, or A+B:C+D",
                            text));
  }
  VariableSets sets{set_of(text.substr(0, colon), graph), set_of(text.substr(colon + 1), graph)};
  std::vector<int> all = sets.a;
  all.insert(all.end(), sets.b.begin(), sets.b.end());
  std::ranges::sort(all);
  if (const auto twice = std::ranges::adjacent_find(all); twice != all.end()) {
    throw Error(ErrorCode::usage,
                fmt::format("--mutual-information: '{}' names {} twice; the sets must not share a "
                            "variable",
                            text, graph.id(*twice)));
  }
  return sets;
}

void note_constant(const Request& request, const Graph& graph, const std::vector<bool>& held,
                   const Session& session) {
  std::vector<int> noted;
  for (const VariableSets& sets : request.mutual) {
    for (const std::vector<int>* set : {&sets.a, &sets.b}) {
      for (const int v : *set) {
        if (held[static_cast<std::size_t>(v)] && std::ranges::find(noted, v) == noted.end())
          noted.push_back(v);
      }
    }
  }
  for (const int v : noted) {
    session.note(fmt::format("{} is constant (fixed, or anchored): it shares no information",
                             graph.describe_variable(v)));
  }
}

Request request_of(const MarginalsOptions& options, const Graph& graph) {
  Request request;
  request.diagonal = options.diagonal ||
                     (options.pairs.empty() && options.column.empty() && options.mutual.empty());
  for (const std::string& pair : options.pairs) request.pairs.push_back(pair_of(pair, graph));
  if (options.column == "last") {
    request.column = graph.variable_count() - 1;
  } else if (!options.column.empty()) {
    request.column = variable_of(options.column, graph, "--column");
  }
  for (const std::string& sets : options.mutual) request.mutual.push_back(sets_of(sets, graph));
  return request;
}

Answer compute(const Graph& graph, const Request& request, CovarianceSolver& solver,
               const Session& session) {
  Answer answer;
  GraphMarginals marginals(graph, *solver.solver);
  if (const Factorization made = marginals.factorize(); !made.ok) {
    throw Error(ErrorCode::numerical, fmt::format("no covariances: {}", marginals.explain(made)));
  }
  answer.factorize = marginals.seconds().analyze + marginals.seconds().factorize;
  const auto begin = std::chrono::steady_clock::now();
  if (request.diagonal) answer.diagonal = marginals.diagonal();
  if (!request.pairs.empty()) answer.pairs = marginals.blocks(request.pairs);
  if (request.column) answer.column = marginals.column(*request.column);
  if (!request.mutual.empty()) {
    note_constant(request, graph, marginals.gauge().held, session);
    answer.mutual = mutual_information(graph, marginals, request.mutual);
  }
  answer.marginals = marginals.diagonal_seconds() + seconds_since(begin);
  return answer;
}

// Blocks of the answer ----------------------------------------------------------------------------

std::size_t tangent(const Graph& graph, int variable) {
  return static_cast<std::size_t>(graph.type(variable).tangent_size());
}

/// visit(Block) of each pair, whose values follow one another.
template <class Pairs, class Visit>
void for_each_block(const Graph& graph, const Pairs& pairs, std::span<const double> values,
                    const Visit& visit) {
  for (const auto& [a, b] : pairs) {
    const std::size_t count = tangent(graph, a) * tangent(graph, b);
    visit(Block{a, b, values.first(count)});
    values = values.subspan(count);
  }
}

std::vector<std::pair<int, int>> diagonal_pairs(const Graph& graph) {
  std::vector<std::pair<int, int>> pairs;
  for (int v = 0; v < graph.variable_count(); ++v) pairs.emplace_back(v, v);
  return pairs;
}

/// visit(Block) of each block of a column, which lie below one another.
template <class Visit>
void for_each_block_of_column(const Graph& graph, int column, const std::vector<double>& values,
                              const Visit& visit) {
  const auto height = static_cast<std::size_t>(graph.tangent_size());
  std::vector<double> block;
  std::size_t row = 0;
  for (int v = 0; v < graph.variable_count(); ++v) {
    block.clear();
    for (std::size_t c = 0; c < tangent(graph, column); ++c) {
      const double* from = values.data() + c * height + row;
      block.insert(block.end(), from, from + tangent(graph, v));
    }
    visit(Block{v, column, block});
    row += tangent(graph, v);
  }
}

/// visit(Block) of everything that was asked for.
template <class Visit>
void for_each_block(const Graph& graph, const Request& request, const Answer& answer,
                    const Visit& visit) {
  if (request.diagonal) for_each_block(graph, diagonal_pairs(graph), answer.diagonal, visit);
  for_each_block(graph, request.pairs, answer.pairs, visit);
  if (request.column) for_each_block_of_column(graph, *request.column, answer.column, visit);
}

// Reports -----------------------------------------------------------------------------------------

json::array matrix_json(const Graph& graph, const Block& block) {
  return rows_json(block.values, graph.type(block.a).tangent_size(),
                   graph.type(block.b).tangent_size());
}

/// Of a variable's place in the world frame; null where it has none.
json::value position_json(const Graph& graph, const Block& block) {
  const VariableType& type = graph.type(block.a);
  if (!type.placement()) return nullptr;
  const int dimension = type.placement()->dimension();
  return rows_json(position_covariance(type, graph.state(block.a), block.values), dimension,
                   dimension);
}

void add_blocks(const Graph& graph, const Request& request, const Answer& answer,
                json::object& report) {
  if (request.diagonal) {
    json::array& all = report["diagonal"].emplace_array();
    for_each_block(graph, diagonal_pairs(graph), answer.diagonal, [&](const Block& block) {
      all.push_back({{"id", graph.id(block.a)},
                     {"covariance", matrix_json(graph, block)},
                     {"position", position_json(graph, block)}});
    });
  }
  if (!request.pairs.empty()) {
    json::array& all = report["pairs"].emplace_array();
    for_each_block(graph, request.pairs, answer.pairs, [&](const Block& block) {
      all.push_back({{"a", graph.id(block.a)},
                     {"b", graph.id(block.b)},
                     {"covariance", matrix_json(graph, block)}});
    });
  }
  if (request.column) {
    json::array all;
    for_each_block_of_column(graph, *request.column, answer.column, [&](const Block& block) {
      all.push_back({{"id", graph.id(block.a)}, {"covariance", matrix_json(graph, block)}});
    });
    report["column"] = {{"id", graph.id(*request.column)}, {"blocks", std::move(all)}};
  }
}

json::array ids_json(const Graph& graph, const std::vector<int>& variables) {
  json::array ids;
  for (const int v : variables) ids.push_back(graph.id(v));
  return ids;
}

/// Null for what is infinite.
json::array mutual_json(const Graph& graph, const Request& request, const Answer& answer) {
  json::array all;
  for (std::size_t k = 0; k < request.mutual.size(); ++k) {
    const double nats = answer.mutual[k];
    all.push_back({{"a", ids_json(graph, request.mutual[k].a)},
                   {"b", ids_json(graph, request.mutual[k].b)},
                   {"nats", number_json(nats)}});
  }
  return all;
}

json::object report_json(const MarginalsOptions& options, const LoadedGraph& loaded,
                         const std::optional<Summary>& summary, const Request& request,
                         const Answer& answer, const LinearSolverStats& stats) {
  json::object report = begin_report("marginals");
  report["graph"] = graph_json(loaded.graph, loaded.name);
  report["optimizer"] = summary ? json::value(summary->optimizer) : json::value(nullptr);
  report["linear_solver"] = options.linear_solver;
  report["threads"] = threads();
  report["initial"] = options.problem.initial;
  report["loss"] = text_json(options.problem.loss);
  if (summary) {
    report["status"] = to_string(summary->status);
    report["chi2"] = {{"initial", summary->initial_chi2}, {"final", summary->final_chi2}};
  }
  report["seconds"] = {{"read", loaded.seconds},
                       {"optimize", summary ? summary->seconds.total : 0.0},
                       {"factorize", answer.factorize},
                       {"marginals", answer.marginals}};
  report["solver"] = to_json(stats);
  report["notes"] = strings_json(summary ? summary->notes : std::vector<std::string>{});
  report["doubts"] = strings_json(summary ? summary->doubts : std::vector<std::string>{});
  report["read_notes"] = strings_json(sentences(loaded.report));
  report["output"] = text_json(options.output);
  add_blocks(loaded.graph, request, answer, report);
  if (!request.mutual.empty())
    report["mutual_information"] = mutual_json(loaded.graph, request, answer);
  end_report(report);
  return report;
}

/// See docs/formats.md.
std::string file_text(const LoadedGraph& loaded, const Request& request, const Answer& answer) {
  std::string text =
      "# cairn covariances 1\n"
      "# COVARIANCE id_a id_b rows columns numbers, row by row\n";
  for_each_block(loaded.graph, request, answer, [&](const Block& block) {
    const std::size_t rows = tangent(loaded.graph, block.a);
    const std::size_t columns = tangent(loaded.graph, block.b);
    text += fmt::format("COVARIANCE {} {} {} {}", loaded.graph.id(block.a),
                        loaded.graph.id(block.b), rows, columns);
    for (std::size_t r = 0; r < rows; ++r) {
      for (std::size_t c = 0; c < columns; ++c)
        text += fmt::format(" {:.17g}", block.values[c * rows + r]);
    }
    text += '\n';
  });
  return text;
}

/// The names of the numbers of δ, if they are the same for all variables as far as they go.
std::vector<std::string> tangent_names(const Graph& graph) {
  int dimension = 0;
  std::size_t most = 0;
  for (const VariablePool& pool : graph.variable_pools()) {
    const Placement* place = pool.type->placement();
    const bool known = place && (dimension == 0 || place->dimension() == dimension);
    dimension = known ? place->dimension() : -1;
    most = std::max(most, static_cast<std::size_t>(pool.type->tangent_size()));
    if (!known) break;
  }
  std::vector<std::string> names;
  if (dimension == 2) names = {"x [m]", "y [m]", "angle [rad]"};
  if (dimension == 3) names = {"x [m]", "y [m]", "z [m]", "rx [rad]", "ry [rad]", "rz [rad]"};
  for (const VariablePool& pool : graph.variable_pools())
    most = std::max(most, static_cast<std::size_t>(pool.type->tangent_size()));
  while (names.size() < most) names.push_back(fmt::format("delta {}", names.size() + 1));
  names.resize(most);
  return names;
}

Table with_columns(std::vector<Table::Column> first, const std::vector<std::string>& names) {
  for (const std::string& name : names) first.push_back({name, Table::Align::right});
  return Table(std::move(first));
}

/// Standard deviations; only the first and last of many.
std::string diagonal_text(const Graph& graph, const std::vector<double>& values, bool colour) {
  Table table = with_columns({{"standard deviation of", Table::Align::left}}, tangent_names(graph));
  const auto count = static_cast<std::size_t>(graph.variable_count());
  for_each_block(graph, diagonal_pairs(graph), values, [&](const Block& block) {
    const auto v = static_cast<std::size_t>(block.a);
    if (count > kMostShown && v == kMostShown / 2)
      table.add({fmt::format("… {} more …", count - kMostShown)});
    if (count > kMostShown && v >= kMostShown / 2 && v < count - kMostShown / 2) return;
    std::vector<std::string> cells{graph.describe_variable(block.a)};
    const std::size_t size = tangent(graph, block.a);
    for (std::size_t k = 0; k < size; ++k)
      cells.push_back(fmt::format("{:.6g}", std::sqrt(block.values[k * size + k])));
    table.add(std::move(cells));
  });
  return table.text(colour);
}

/// A block with a row for each of its rows.
void add_rows(const Graph& graph, const Block& block, Table& table) {
  const std::size_t rows = tangent(graph, block.a);
  for (std::size_t r = 0; r < rows; ++r) {
    std::vector<std::string> cells{
        r == 0 ? fmt::format("{}, {}", id_text(graph.id(block.a)), id_text(graph.id(block.b)))
               : ""};
    for (std::size_t c = 0; c < tangent(graph, block.b); ++c)
      cells.push_back(fmt::format("{:.6g}", block.values[c * rows + r]));
    table.add(std::move(cells));
  }
}

std::string set_text(const Graph& graph, const std::vector<int>& variables) {
  std::string text;
  for (const int v : variables) text += (text.empty() ? "" : "+") + id_text(graph.id(v));
  return text;
}

std::string mutual_text(const Graph& graph, const Request& request, const Answer& answer,
                        bool colour) {
  Table table({{"mutual information of", Table::Align::left}, {"nats", Table::Align::right}});
  for (std::size_t k = 0; k < request.mutual.size(); ++k) {
    if (k == kMostShown) {
      table.add({fmt::format("… {} more", request.mutual.size() - kMostShown)});
      break;
    }
    table.add({fmt::format("{}, {}", set_text(graph, request.mutual[k].a),
                           set_text(graph, request.mutual[k].b)),
               fmt::format("{:.6g}", answer.mutual[k])});
  }
  return table.text(colour);
}

std::string result_text(const MarginalsOptions& options, const LoadedGraph& loaded,
                        const std::optional<Summary>& summary, const Request& request,
                        const Answer& answer, const Results& results, const Session& session) {
  const Graph& graph = loaded.graph;
  const bool colour = session.colour();
  std::string text;
  if (request.diagonal) text += diagonal_text(graph, answer.diagonal, colour);
  if (!request.pairs.empty() || request.column) {
    Table table = with_columns({{"covariance of", Table::Align::left}}, tangent_names(graph));
    std::size_t shown = 0;
    const auto add = [&](const Block& block) {
      if (++shown <= kMostShown) add_rows(graph, block, table);
    };
    for_each_block(graph, request.pairs, answer.pairs, add);
    if (request.column) for_each_block_of_column(graph, *request.column, answer.column, add);
    if (shown > kMostShown) table.add({fmt::format("… {} more", shown - kMostShown)});
    text += (text.empty() ? "" : "\n") + table.text(colour);
  }
  if (!request.mutual.empty())
    text += (text.empty() ? "" : "\n") + mutual_text(graph, request, answer, colour);
  Table facts({{"", Table::Align::left}, {"", Table::Align::left}});
  add_metric(facts, graph, session);
  if (summary) {
    facts.add(
        {"estimate", fmt::format("{}, chi2 {}, {}", summary->optimizer,
                                 chi2_text(summary->final_chi2), to_string(summary->status))});
    add_notes(facts, summary->notes, summary->doubts);
  }
  facts.add(
      {"time", fmt::format("factorize {}, covariances {} ({})", seconds_text(answer.factorize),
                           seconds_text(answer.marginals), options.linear_solver)});
  for (const std::string& file : results.written({options.output})) facts.add({"output", file});
  return text + "\n" + facts.text(false);
}

// The command -------------------------------------------------------------------------------------

std::optional<Summary> optimize(Graph& graph, Optimizer* optimizer, const ProblemSetup& setup,
                                const MarginalsOptions& options, const InterruptGuard& guard,
                                const Session& session) {
  if (!optimizer) return std::nullopt;
  Stop stop = options.problem.stop;
  stop.interrupt = &guard.flag();
  OptimizationProgress progress(session.common.quiet, stop.max_iterations);
  Summary summary = call_plugin([&] { return fmt::format("optimizer '{}'", options.optimizer); },
                                [&] { return optimizer->optimize(graph, stop, progress); });
  GuessProgress of_guess(session.common.quiet, guard.flag());
  setup.look_again(graph, *optimizer, options.optimizer, stop, progress, std::ref(of_guess),
                   summary);
  note_the_end(summary, stop, graph);
  if (summary.status != Status::interrupted && summary.status != Status::converged) {
    summary.doubt(fmt::format(
        "the optimisation ended as {}: covariances are of where it stopped, which is not a minimum",
        to_string(summary.status)));
  }
  return summary;
}

int run(MarginalsOptions options, Session& session) {
  if (options.as_given) keep_states(options.problem);
  if (!options.output.empty() && !options.mutual.empty() && !options.diagonal &&
      options.pairs.empty() && options.column.empty()) {
    throw Error(ErrorCode::usage,
                "-o writes covariances, and none are asked for beside --mutual-information: add "
                "--diagonal, --pairs or --column, or write a report with --json");
  }
  check_file(options.output, session);
  session.use_threads();
  // Everything that is named is made before the file is read: a wrong name is told at once.
  Registry& registry = session.registry();
  CovarianceSolver solver = make_covariance_solver(options.linear_solver, registry);
  std::unique_ptr<Optimizer> optimizer;
  if (!options.as_given) {
    ComponentSpec spec = parse_component(options.optimizer);
    // An optimizer that brings its own keeps them: covariances are another matter.
    if (takes_linear_solver(registry, spec))
      spec.values.emplace(kLinearSolverOption, options.linear_solver);
    optimizer = registry.make<Optimizer>(spec);
  }
  const ProblemSetup setup(options.problem, registry);

  LoadedGraph loaded = load_graph(options.graph, options.input, session);
  const Request request = request_of(options, loaded.graph);
  std::optional<InterruptGuard> guard(std::in_place);
  GuessProgress progress(session.common.quiet, guard->flag());
  for (const std::string& note : setup.apply(loaded.graph, std::ref(progress))) {
    session.note(fmt::format("initial guess {}: {}", options.problem.initial, note));
  }
  const std::optional<Summary> summary =
      optimize(loaded.graph, optimizer.get(), setup, options, *guard, session);
  if (guard->interrupted()) {
    session.note("interrupted before any covariance was computed: nothing is written");
    return kExitInterrupted;
  }
  guard.reset();  // what follows has nothing to write before its end
  const Answer answer =
      call_plugin([&] { return fmt::format("linear solver '{}'", options.linear_solver); },
                  [&] { return compute(loaded.graph, request, solver, session); });
  Results results;
  results.write(options.output, [&] {
    const std::string text = file_text(loaded, request, answer);
    if (options.output == "-") return write_stdout(text);
    write_file(options.output, text);
  });
  results.add([&] {
    session.write_json(
        report_json(options, loaded, summary, request, answer, solver.solver->stats()));
  });
  results.add([&] {
    session.print(result_text(options, loaded, summary, request, answer, results, session));
  });
  results.finish();
  return summary ? exit_code(*summary, options.problem.stop) : 0;
}

}  // namespace

void add_marginals(Registrar& registrar) {
  add_command<MarginalsOptions>(
      registrar, "marginals",
      "Covariances are of the step that moves a state, for a pose x exp(d): metres along its own\n"
      "axes, then radians. Variables that are fixed, or anchored, have zeros.\n"
      "Example:\n"
      "  cairn marginals city.g2o --column last --pairs 17:350,17:351 -o city.cov\n"
      "  cairn marginals city.g2o --mutual-information 17:350,17+18:350+351",
      run);
}

}  // namespace cairn::app
