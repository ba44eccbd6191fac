// SPDX-License-Identifier: BSD-3-Clause
// cairn convert IN OUT: reads one format and writes another.
#include <memory>

#include <fmt/core.h>

#include "cairn/plugin/registry.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/program/trajectory_axes.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::app {
namespace {

struct ConvertOptions {
  std::string input_file;
  std::string output_file;
  std::string output_format;
  std::string axes;          ///< of IN
  std::string ground_truth;  ///< file, or empty
  InputOptions input;

  static auto fields() {
    using O = ConvertOptions;
    return OptionFields<O>()
        .text("in", &O::input_file, kGraphHelp)
        .positional()
        .placeholder("IN")
        .or_generated_by({"generator"})
        .required()
        .text("output", &O::output_file,
              "file, also as -o OUT (packed if it ends in .gz; - is standard output)")
        .positional(true)
        .letter('o')
        .placeholder("OUT")
        .required()
        .component("to", &O::output_format, {"format"}, "format of OUT, instead of by the ending")
        .placeholder("FORMAT")
        .choice("axes", &O::axes, {"robot", "camera"},
                "of IN, a trajectory: camera (z ahead, y down) is turned into robot (x ahead, z "
                "up)")
        .placeholder("AXES")
        .optional()
        .text("ground_truth", &O::ground_truth,
              "write the true states too, of a graph that has them beside")
        .placeholder("FILE")
        .part(&O::input);
  }
};

boost::json::object report_json(const ConvertOptions& options, const LoadedGraph& loaded,
                                bool poses_alone) {
  boost::json::object report = begin_report("convert");
  report["graph"] = graph_json(loaded.graph, loaded.name);
  report["format"] = loaded.report.format;
  report["output"] = options.output_file;
  report["poses_alone"] = poses_alone;
  report["ground_truth"] = text_json(options.ground_truth);
  report["read_notes"] = strings_json(sentences(loaded.report));
  report["seconds"] = boost::json::object{{"read", loaded.seconds}};
  return report;
}

std::string contents(const Graph& graph, bool poses_alone) {
  if (poses_alone) return plural(pose_count(graph), "pose");
  return fmt::format("{}, {}", plural(graph.variable_count(), "variable"),
                     plural(graph.factor_count(), "factor"));
}

/// A KITTI file is in the axes of a camera, which other formats are not read in.
void note_axes(const ConvertOptions& options, const LoadedGraph& loaded, const Session& session) {
  if (loaded.report.format != "kitti" || !options.axes.empty()) return;
  session.note(
      fmt::format("{}: KITTI's axes are those of a camera, and are kept; --axes camera "
                  "turns them into a robot's, x ahead and z up",
                  loaded.name));
}

int run(const ConvertOptions& options, Session& session) {
  check_output(options.output_file, options.output_format, session);
  check_output(options.ground_truth, options.output_format, session, false);
  LoadedGraph loaded = load_graph(options.input_file, options.input, session);
  if (!options.ground_truth.empty() && !loaded.truth) {
    throw Error(ErrorCode::usage,
                fmt::format("--ground-truth: {} has no truth beside its states; format pyfg and "
                            "generated graphs do",
                            loaded.name));
  }
  turn_to_robot_axes(loaded, options.axes);
  const std::string format = output_format(options.output_file, options.output_format);
  const bool poses_alone = note_poses_alone(loaded.graph, options.output_file, format, session);
  note_axes(options, loaded, session);
  Results results;
  results.write(options.output_file, [&] {
    write_graph(loaded.graph, options.output_file, session.registry(), format,
                loaded.report.stamps);
  });
  results.write(options.ground_truth, [&] {
    write_graph(*loaded.truth, options.ground_truth, session.registry(),
                output_format(options.ground_truth, options.output_format));
  });
  results.add([&] { session.write_json(report_json(options, loaded, poses_alone)); });
  results.finish();
  session.print(fmt::format("{} ({}): {} written to {}\n", loaded.name, loaded.report.format,
                            contents(loaded.graph, poses_alone), options.output_file));
  return 0;
}

}  // namespace

void add_convert(Registrar& registrar) {
  add_command<ConvertOptions>(registrar, "convert",
                              "Example:\n"
                              "  cairn convert manhattan_isam.txt manhattan.g2o.gz\n"
                              "  cairn convert best.g2o - --to tum\n"
                              "  cairn convert 00.txt robot.tum --axes camera\n"
                              "  cairn convert drone.pyfg drone.g2o --ground-truth truth.g2o",
                              run);
}

}  // namespace cairn::app
