// SPDX-License-Identifier: BSD-3-Clause
// cairn generate KIND: a simulated graph, the same on every machine.
#include <cstdint>
#include <memory>

#include <fmt/core.h>

#include "cairn/plugin/registry.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/other_input.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::app {
namespace {

struct GenerateOptions {
  std::string kind;
  std::string output;
  std::string output_format;
  std::string ground_truth;
  std::uint64_t seed = 0;

  static auto fields() {
    using O = GenerateOptions;
    return OptionFields<O>()
        .component("kind", &O::kind, {"generator", "floor_plan"},
                   "generator: manhattan, sphere …, or floor plan: rooms, cave … (cairn plugins "
                   "lists them)")
        .positional()
        .placeholder("KIND[:k=v]")
        .required()
        .text("output", &O::output, "the noisy graph (- is standard output)")
        .letter('o')
        .placeholder("OUT")
        .required()
        .text("ground_truth", &O::ground_truth, "the same graph at its true states")
        .placeholder("FILE")
        .component("to", &O::output_format, {"format"}, "format, instead of by the ending")
        .placeholder("FORMAT")
        .integer("seed", &O::seed, 0, kMostSeed,
                 "seed of the noise; the same seed gives the same graph")
        .placeholder("S");
  }
};

boost::json::object report_json(const GenerateOptions& options, const Simulation& simulation) {
  boost::json::object report = begin_report("generate");
  report["kind"] = options.kind;
  report["seed"] = options.seed;
  report["graph"] = graph_json(simulation.graph, options.output);
  report["ground_truth"] = text_json(options.ground_truth);
  return report;
}

int run(const GenerateOptions& options, Session& session) {
  if (const auto other = other_input("@" + options.kind, session)) {
    if (!options.ground_truth.empty() || !options.output_format.empty()) {
      throw Error(ErrorCode::usage,
                  fmt::format("--ground-truth and --to are of graphs: '{}' is {}, whose format is "
                              "that of its ending",
                              options.kind, other->what()));
    }
    return other->generate(options.kind, options.seed, options.output, session);
  }
  check_output(options.output, options.output_format, session);
  check_output(options.ground_truth, options.output_format, session);
  const Simulation simulation = simulate(options.kind, options.seed, session);
  Registry& registry = session.registry();
  Results results;
  results.write(options.output, [&] {
    write_graph(simulation.graph, options.output, registry,
                output_format(options.output, options.output_format));
  });
  results.write(options.ground_truth, [&] {
    write_graph(simulation.truth, options.ground_truth, registry,
                output_format(options.ground_truth, options.output_format));
  });
  results.add([&] { session.write_json(report_json(options, simulation)); });
  results.finish();
  session.print(fmt::format("{}: {}, {} written to {}\n", options.kind,
                            plural(simulation.graph.variable_count(), "variable"),
                            plural(simulation.graph.factor_count(), "factor"), options.output));
  return 0;
}

}  // namespace

void add_generate(Registrar& registrar) {
  add_command<GenerateOptions>(
      registrar, "generate",
      "Example:\n"
      "  cairn generate manhattan:poses=3500 -o graph.g2o --ground-truth truth.g2o --seed 7\n"
      "  cairn generate rooms:width=30 -o floor.yaml --seed 3\n"
      "Options of a generator: cairn plugins manhattan",
      run);
}

}  // namespace cairn::app
