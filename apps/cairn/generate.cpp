// SPDX-License-Identifier: BSD-3-Clause
// cairn generate KIND: a simulated graph, the same on every machine.
#include <cstdint>
#include <memory>

#include <fmt/core.h>

#include "arguments.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "commands.hpp"
#include "floors.hpp"
#include "graph_files.hpp"
#include "json_report.hpp"
#include "results.hpp"
#include "table.hpp"

namespace cairn::app {
namespace {

struct GenerateOptions {
  std::string kind;
  std::string output;
  std::string output_format;
  std::string ground_truth;
  std::uint64_t seed = 0;
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
  if (names_floor_plan(options.kind, session)) {
    if (!options.ground_truth.empty() || !options.output_format.empty())
      throw Error(ErrorCode::usage, "--ground-truth and --to are of graphs: '" + options.kind +
                                        "' is a floor, whose format is that of its ending");
    return run_floor_generate(options.kind, options.seed, options.output, session);
  }
  check_output(options.output, options.output_format, session);
  check_output(options.ground_truth, options.output_format, session);
  const Simulation simulation = simulate(options.kind, options.seed, session);
  Registry& registry = session.registry();
  Results results(session);
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

Command add_generate(ArgumentParser program) {
  auto options = std::make_shared<GenerateOptions>();  // lives as long as the parser and the run
  ArgumentParser cli =
      program.add_command("generate", "make a simulated graph, with its ground truth, or a floor");
  cli.add_option(
         "kind", options->kind,
         "generator: manhattan, sphere …, or floor plan: rooms, cave … (cairn plugins lists them)")
      .component({"generator", "floor_plan"})
      .type_name("KIND[:k=v]")
      .required();
  cli.add_option("-o,--output", options->output, "the noisy graph (- is standard output)")
      .type_name("OUT")
      .required();
  cli.add_option("--ground-truth", options->ground_truth, "the same graph at its true states")
      .type_name("FILE");
  cli.add_option("--to", options->output_format, "format, instead of by the ending")
      .component({"format"})
      .type_name("FORMAT");
  cli.add_option("--seed", options->seed, "seed of the noise; the same seed gives the same graph")
      .type_name("S")
      .show_default();
  cli.footer(
      "Example:\n"
      "  cairn generate manhattan:poses=3500 -o graph.g2o --ground-truth truth.g2o --seed 7\n"
      "  cairn generate rooms:width=30 -o floor.yaml --seed 3\n"
      "Options of a generator: cairn plugins manhattan");
  return {cli, [options](Session& session) { return run(*options, session); }};
}

}  // namespace cairn::app
