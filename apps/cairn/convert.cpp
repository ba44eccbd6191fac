// SPDX-License-Identifier: BSD-3-Clause
// cairn convert IN OUT: reads one format and writes another.
#include <memory>

#include <fmt/core.h>

#include "arguments.hpp"
#include "cairn/plugin/registry.hpp"
#include "commands.hpp"
#include "graph_files.hpp"
#include "json_report.hpp"
#include "results.hpp"
#include "table.hpp"

namespace cairn::app {
namespace {

struct ConvertOptions {
  std::string input_file;
  std::string output_file;
  std::string output_format;
  InputOptions input;
};

boost::json::object report_json(const ConvertOptions& options, const LoadedGraph& loaded) {
  boost::json::object report = begin_report("convert");
  report["graph"] = graph_json(loaded.graph, loaded.name);
  report["format"] = loaded.report.format;
  report["output"] = options.output_file;
  report["read_notes"] = strings_json(sentences(loaded.report));
  report["seconds"] = boost::json::object{{"read", loaded.seconds}};
  return report;
}

int run(const ConvertOptions& options, Session& session) {
  check_output(options.output_file, options.output_format, session);
  const LoadedGraph loaded = load_graph(options.input_file, options.input, session);
  Results results(session);
  results.write(options.output_file, [&] {
    write_graph(loaded.graph, options.output_file, session.registry(),
                output_format(options.output_file, options.output_format));
  });
  results.add([&] { session.write_json(report_json(options, loaded)); });
  results.finish();
  session.print(fmt::format("{} ({}): {}, {} written to {}\n", loaded.name, loaded.report.format,
                            plural(loaded.graph.variable_count(), "variable"),
                            plural(loaded.graph.factor_count(), "factor"), options.output_file));
  return 0;
}

}  // namespace

Command add_convert(ArgumentParser program) {
  auto options = std::make_shared<ConvertOptions>();  // lives as long as the parser and the run
  ArgumentParser cli =
      program.add_command("convert", "write a graph or its trajectory in another format");
  cli.add_option("in", options->input_file, kGraphHelp)
      .type_name("IN")
      .file_or_generated({"generator"})
      .required();
  cli.add_option("-o,--output,out", options->output_file,
                 "file, also as -o OUT (packed if it ends in .gz; - is standard output)")
      .type_name("OUT")
      .required();
  cli.add_option("--to", options->output_format, "format of OUT, instead of by the ending")
      .component({"format"})
      .type_name("FORMAT");
  add_input_options(cli, options->input);
  cli.footer(
      "Example:\n"
      "  cairn convert manhattan_isam.txt manhattan.g2o.gz\n"
      "  cairn convert best.g2o - --to tum");
  return {cli, [options](Session& session) { return run(*options, session); }};
}

}  // namespace cairn::app
