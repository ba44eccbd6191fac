// SPDX-License-Identifier: BSD-3-Clause
// What reports are made of: run logs, the structure of a graph as JSON, the reports of
// `cairn optimize --json`, and recordings of explorations. The first byte chooses. What is read
// fits together, and is read from what is written of it as the same.
#include <algorithm>
#include <variant>

#include <fmt/format.h>

#include "cairn/exploration/recording.hpp"
#include "cairn/io/packed_array.hpp"
#include "cairn/report/recording.hpp"
#include "cairn/report/run_report.hpp"
#include "cairn/report/scene_json.hpp"
#include "cairn/runtime/error.hpp"
#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {
namespace {

constexpr const char* kName = "input";

void expect_consistent(const Scene& scene) {
  const std::size_t variables = scene.ids.size(), edges = scene.a.size();
  expect(scene.variable_type.size() == variables && scene.held.size() == variables,
         [] { return "arrays of variables of different sizes"; });
  expect(scene.b.size() == edges && scene.edge_class.size() == edges &&
             scene.edge_type.size() == edges &&
             (scene.factor.empty() || scene.factor.size() == edges),
         [] { return "arrays of edges of different sizes"; });
  const auto in_range = [](std::int64_t index, std::int64_t low, std::size_t size) {
    return index >= low && index < static_cast<std::int64_t>(size);
  };
  for (std::size_t e = 0; e < edges; ++e) {
    expect(in_range(scene.a[e], 0, variables) && in_range(scene.b[e], -1, variables) &&
               in_range(scene.edge_type[e], 0, scene.edge_types.size()) &&
               static_cast<int>(scene.edge_class[e]) <= 5,
           [&] { return fmt::format("edge {} refers to what is not there", e); });
  }
  for (const std::uint8_t type : scene.variable_type) {
    expect(in_range(type, 0, scene.variable_types.size()), [] { return "a type of no variable"; });
  }
  for (const std::int32_t v : scene.fixed)
    expect(in_range(v, 0, variables), [] { return "a fixed variable that is not there"; });
  const std::size_t positions = variables * static_cast<std::size_t>(scene.dimension);
  for (const SceneEstimate& estimate : scene.estimates) {
    expect(estimate.positions.size() == positions, [] { return "an estimate of another size"; });
  }
  for (const Recording& recording : scene.recordings) {
    for (const Frame& frame : recording.frames)
      expect(frame.positions.size() == positions, [] { return "a snapshot of another size"; });
  }
}

/// All that is not a number with a fraction, which Boost.JSON 1.81 reads to within its last bit.
void expect_same_again(const Scene& scene) {
  const Scene again = read_structure(fmt::format("{{{}}}", structure_json(scene)), "again");
  expect_consistent(again);
  expect(again.dimension == scene.dimension && again.ids == scene.ids &&
             again.variable_type == scene.variable_type && again.held == scene.held &&
             again.a == scene.a && again.b == scene.b && again.edge_class == scene.edge_class &&
             again.edge_type == scene.edge_type && again.factor == scene.factor &&
             again.factors == scene.factors,
         [&] { return "not the same again: " + structure_json(scene); });
}

/// From the second time on, when names are valid UTF-8.
void expect_same_again(const SceneRun& first) {
  const SceneRun run = read_run(run_json(first), "once"), again = read_run(run_json(run), "again");
  const Summary &a = run.summary, &b = again.summary;
  expect(again.threads == run.threads && again.peak_memory_bytes == run.peak_memory_bytes &&
             a.optimizer == b.optimizer && a.linear_solver == b.linear_solver &&
             a.status == b.status && a.iterations.size() == b.iterations.size() &&
             a.solver.ordering == b.solver.ordering &&
             a.solver.factor_nonzeros == b.solver.factor_nonzeros && a.notes == b.notes,
         [&] { return "not the same again: " + run_json(run); });
}

/// Also with as little as a page may have.
void expect_same_again(const ExplorationRecording& recording) {
  std::string text = recording.header + "\n";
  for (const std::string& line : recording.lines) text += line + "\n";
  const ExplorationRecording again = read_exploration_recording(text, kName);
  expect(again.lines == recording.lines && again.ended == recording.ended &&
             again.decisions == recording.decisions && !again.torn,
         [&] { return "not the same again: " + text; });
  for (const NumberTable::Column& column : recording.steps.columns) {
    expect(column.values.size() == recording.steps.columns.front().values.size(),
           [] { return "columns of different sizes"; });
  }
  std::vector<std::string> notes;
  exploration_json(recording, kName, 0, notes);
}

void read(int what, std::string_view text) {
  switch (what) {
    case 0: {
      const Scene scene = read_recording(text, kName);
      expect_consistent(scene);
      expect_same_again(scene);
      for (const SceneRun& run : scene.runs) expect_same_again(run);
      break;
    }
    case 1: {
      const Scene scene = read_structure(text, kName);
      expect_consistent(scene);
      expect_same_again(scene);
      break;
    }
    case 2:
      expect_same_again(read_run(text, kName));
      break;
    case 4:
      expect_same_again(read_exploration_recording(text, kName));
      break;
    default:
      if (const auto report = read_report(text, kName); std::holds_alternative<RunReport>(report))
        expect_same_again(std::get<RunReport>(report).run);
  }
}

void run(Bytes bytes) {
  Source source(bytes);
  const int what = source.byte() % 5;
  const std::string_view text = text_of(source.rest());
  is_recording(text);
  is_exploration_recording(text);
  try {
    read(what, text);
  } catch (const Error& error) {
    expect(error.code() == ErrorCode::input,
           [&] { return fmt::format("refused by: {}", error.what()); });
  }
}

std::string as_text(int what, const std::string& text) {
  return std::string(1, static_cast<char>(what)) + text;
}

std::vector<std::string> seeds() {
  const std::string graph =
      R"("dimension":2,"origin":[1,2,0],"variables":{"count":2,"ids":[3,7],"types":[)"
      R"({"name":"P",)"
      R"("role":"pose","tangent_size":3}],"type":[0,0],"fixed":[1]},)"
      R"("edges":{"count":1,"factors":1,)"
      R"("a":[0],"b":[1],"class":[0],"types":[{"name":"E","residual_size":3}],)"
      R"("type":[0],"factor":[0]})";
  const std::string run =
      R"({"name":"n","optimizer":"o","linear_solver":"l","status":"converged","threads":2,)"
      R"("chi2":{"initial":2,"final":1},"iterations":[{"chi2":1,"step_norm":0.5,"lambda":0,)"
      R"("accepted":true,"seconds":0.1}],"seconds":{"total":1},"solver":{"ordering":"amd",)"
      R"("factor_nonzeros":9,"factor_flops":27},"notes":["a"]})";
  const std::vector<float> positions = {0.5F, 1.5F, -2.0F, 3.0F};
  const std::string packed = packed_json(positions, Packing::base64),
                    deflated = packed_json(positions, Packing::deflate);
  const std::string header =
      R"({"format":"cairn-recording","version":1,"name":"r",)" + graph + "}\n";
  const std::vector<std::uint8_t> cells = {3, 254, 255, 97};
  const std::string explored =
      R"({"format":"cairn-recording","version":1,"kind":"exploration","name":"r"})"
      "\n"
      R"({"step":0,"distance":0,"estimate":[0,0,0],"poses":[[0,0,0,0]],"map":{"resolution":0.1,)"
      R"("origin":[0,0],"yaw":0,"x":-2,"y":1,"width":2,"height":2,"cells":)" +
      packed_json(cells, Packing::deflate) + R"(},"scan":{"ranges":)" +
      packed_points_json(positions, 1) + "}}\n";
  const std::string tree = R"({"decision":0,"kind":"drive","why":"w","chosen":0,"candidates":[],)"
                           R"("tree":{"count":2,"positions":)" +
                           packed_points_json(positions, 2) + R"(,"parents":)" +
                           packed_json(std::vector<std::int32_t>{-1, 0}, Packing::deflate) +
                           R"(,"values":)" + packed_points_json(std::vector<float>{1.0F, 2.0F}, 1) +
                           "}}\n";
  std::string sequence = graph;
  sequence.replace(sequence.find("[3,7]"), 5, R"("sequence")");
  return {as_text(0, header + R"({"iteration":0,"time":0,"chi2":2,"positions":[0,1,2,3]})" + "\n" +
                         R"({"iteration":1,"time":1,"chi2":1,"positions":)" + packed + "}\n" +
                         R"({"summary":)" + run + "}\n"),
          as_text(0, header + R"({"iteration":0,"chi2":2,"positions":)" + deflated + "}\n"),
          as_text(0, header),
          as_text(4, explored),
          as_text(4, explored + tree + R"({"end":"limit","why":"so"})" + "\n"),
          as_text(4, explored + tree + tree.substr(0, 40)),
          as_text(1, "{" + graph + "}"),
          as_text(1, "{" + sequence + "}"),
          as_text(2, run),
          as_text(3, run),
          as_text(3, R"({"command":"bench","graphs":[{"graph":{"file":"a.g2o"}}]})"),
          as_text(3, run.substr(0, run.size() - 1) +
                         R"(,"graph":{"file":"a"},"output":"b","covariance":{"blocks":[{"id":1,)"
                         R"("covariance":[[1,0],[0,1]]}]}})")};
}

std::vector<std::string> words() {
  return {R"("format":"cairn-recording")",
          R"("version":1)",
          R"("dimension":)",
          R"("origin":[0,0,0])",
          R"("variables":)",
          R"("edges":)",
          R"("count":)",
          R"("ids":"sequence")",
          R"("types":[)",
          R"("type":)",
          R"("fixed":)",
          R"("factors":)",
          R"("class":)",
          R"("factor":)",
          R"("iteration":)",
          R"("positions":)",
          R"("summary":)",
          R"("kind":"exploration")",
          R"("step":)",
          R"("decision":)",
          R"("end":)",
          R"("map":{"resolution":)",
          R"("width":)",
          R"("cells":)",
          R"("scan":{"ranges":)",
          R"("tree":{"count":)",
          R"("base64":")",
          R"("deflate":")",
          R"("u16")",
          R"("i64")",
          R"("f64")",
          R"("command":"bench")",
          R"("graphs":[)",
          R"("covariance":{"blocks":[)",
          "2147483647",
          "1e308",
          "null"};
}

}  // namespace

Target recording() { return {"recording", &run, &seeds, &words, {}, 2048}; }

}  // namespace cairn::fuzz
