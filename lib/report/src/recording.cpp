// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/recording.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include <fmt/core.h>

#include "cairn/io/output_file.hpp"
#include "cairn/io/packed_array.hpp"
#include "cairn/report/scene_json.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/version.hpp"
#include "json_reading.hpp"

namespace cairn {
namespace {

constexpr std::string_view kOpening = R"({"format":"cairn-recording")";
constexpr double kNumbersAtFullRate = 8e6;  // 32 MB as f32
constexpr int kMostIterations = 1 << 30;

/// Whether the positions of the k-th accepted iteration are kept: all of the first `dense`, then
/// every second up to 2 dense, every fourth up to 4 dense …
bool kept(int k, int dense) {
  const int stride =
      static_cast<int>(std::bit_floor(static_cast<unsigned>(std::max(1, k / dense))));
  return k % (k < dense ? 1 : 2 * stride) == 0;
}

}  // namespace

struct RecordingWriter::Impl {
  explicit Impl(const std::filesystem::path& path) : file(path) {}

  OutputFile file;
  std::string name, graph_file;
  Observer* next = nullptr;

  int dimension = 2;
  std::array<double, 3> origin{};
  int dense = 1;
  int accepted = 0;
  double time = 0.0;
  double chi2 = 0.0;
  int last_iteration = 0;
  bool last_kept = false;
  std::vector<float> positions;

  /// Errors come up in finish(): a full disk must not end the optimisation.
  void write(const std::string& line) { file.write(line + '\n'); }
  std::string positions_json(const Graph& graph, const Values& values) {
    copy_positions(graph, values, dimension, origin, positions);
    return packed_json(std::span<const float>(positions), Packing::base64);
  }
};

RecordingWriter::RecordingWriter(const std::filesystem::path& file, std::string name,
                                 std::string graph_file, Observer* next)
    : impl_(std::make_unique<Impl>(file)) {
  impl_->name = std::move(name);
  impl_->graph_file = std::move(graph_file);
  impl_->next = next;
}

RecordingWriter::~RecordingWriter() = default;

void RecordingWriter::on_start(const Graph& graph, double chi2) {
  const Scene scene = scene_of(graph, impl_->graph_file);
  impl_->dimension = scene.dimension;
  impl_->origin = scene.origin;
  impl_->chi2 = chi2;
  const double numbers = std::max(1.0, double(scene.dimension) * scene.variable_count());
  impl_->dense = static_cast<int>(std::clamp(kNumbersAtFullRate / numbers, 8.0, 1e6));
  impl_->write(
      fmt::format(R"({},"version":1,"cairn":"{}","name":{},"kind":"iterations","graph":{},{}}})",
                  kOpening, CAIRN_VERSION, json_string(impl_->name), json_string(impl_->graph_file),
                  structure_json(scene)));
  impl_->write(fmt::format(R"({{"iteration":0,"time":0,"chi2":{},"positions":{}}})",
                           json_number(chi2), impl_->positions_json(graph, graph.values())));
  impl_->last_kept = true;
  if (impl_->next) impl_->next->on_start(graph, chi2);
}

bool RecordingWriter::on_iteration(const Iteration& it, const Graph& graph, const Values& values) {
  impl_->time += it.seconds;
  impl_->chi2 = it.chi2;
  impl_->last_iteration = it.number;
  std::string line = fmt::format(
      R"({{"iteration":{},"time":{},"chi2":{},"step_norm":{},"lambda":{},"accepted":{},"seconds":{})",
      it.number, json_number(impl_->time), json_number(it.chi2), json_number(it.step_norm),
      json_number(it.lambda), it.accepted, json_number(it.seconds));
  if (it.accepted) {
    ++impl_->accepted;
    impl_->last_kept = kept(impl_->accepted, impl_->dense);
    if (impl_->last_kept) line += ",\"positions\":" + impl_->positions_json(graph, values);
  }
  impl_->write(line + "}");
  return impl_->next ? impl_->next->on_iteration(it, graph, values) : true;
}

void RecordingWriter::on_message(std::string_view message) {
  if (impl_->next) impl_->next->on_message(message);
}

void RecordingWriter::finish(const Graph& graph, const Summary& summary) {
  if (!impl_->last_kept) {
    impl_->write(fmt::format(R"({{"iteration":{},"time":{},"chi2":{},"positions":{}}})",
                             impl_->last_iteration, json_number(impl_->time),
                             json_number(impl_->chi2),
                             impl_->positions_json(graph, graph.values())));
    impl_->last_kept = true;
  }
  SceneRun run;
  run.name = impl_->name;
  run.summary = summary;
  run.summary.iterations.clear();  // they have lines of their own
  impl_->write(fmt::format(R"({{"summary":{}}})", run_json(run)));
  impl_->file.finish();
}

// Reading -----------------------------------------------------------------------------------------

namespace {

/// What the lines after the first add up to.
class FrameReader {
 public:
  explicit FrameReader(Scene& scene) : scene_(scene) {}

  void read(const JsonReader& line) {
    if (line.has("summary")) return read_summary(line);
    const int number = static_cast<int>(line.whole("iteration", -1, 0, kMostIterations));
    if (number == 0) run_.summary.initial_chi2 = line.number("chi2");
    if (number > last_) add_iteration(line, number);
    if (line.has("positions")) add_frame(line, number);
  }

  void finish(const std::string& name) {
    Summary& summary = run_.summary;
    if (!summary.iterations.empty()) summary.final_chi2 = summary.iterations.back().chi2;
    if (run_.name.empty()) run_.name = name;
    recording_.name = run_.name;
    scene_.runs.push_back(run_);
    if (recording_.frames.empty()) {
      throw Error(ErrorCode::input,
                  fmt::format("{}: not even the start was recorded", scene_.name));
    }
    add_estimate(recording_.frames.front(), "start", EstimateRole::initial);
    add_estimate(recording_.frames.back(), run_.name, EstimateRole::estimate);
    scene_.estimates.back().run = static_cast<int>(scene_.runs.size()) - 1;
    scene_.recordings.push_back(std::move(recording_));
  }

 private:
  void add_iteration(const JsonReader& line, int number) {
    last_ = number;
    Iteration it;
    it.number = number;
    it.chi2 = line.number("chi2");
    it.step_norm = line.number("step_norm", 0.0);
    it.lambda = line.number("lambda", 0.0);
    it.accepted = line.boolean("accepted", true);
    it.seconds = line.number("seconds", 0.0);
    run_.summary.iterations.push_back(it);
  }

  void add_frame(const JsonReader& line, int number) {
    Frame frame;
    frame.iteration = number;
    frame.time = line.number("time", 0.0);
    frame.chi2 = line.number("chi2");
    frame.seconds = line.number("seconds", 0.0);
    const std::size_t count = scene_.ids.size() * static_cast<std::size_t>(scene_.dimension);
    for (const double x : line.numbers("positions", count)) {
      frame.positions.push_back(static_cast<float>(x));
    }
    recording_.frames.push_back(std::move(frame));
  }

  /// The last line: all but the iterations, which have been read.
  void read_summary(const JsonReader& line) {
    const JsonReader summary = line.object("summary");
    const std::vector<Iteration> iterations = std::move(run_.summary.iterations);
    const double initial = run_.summary.initial_chi2;
    run_ = read_run(summary.serialized(), "summary");
    run_.summary.iterations = iterations;
    run_.summary.initial_chi2 = initial;
  }

  void add_estimate(const Frame& frame, const std::string& name, EstimateRole role) {
    SceneEstimate estimate;
    estimate.name = name;
    estimate.role = role;
    estimate.file = scene_.name;
    estimate.chi2 = frame.chi2;
    const auto d = static_cast<std::size_t>(scene_.dimension);
    estimate.positions.resize(frame.positions.size());
    for (std::size_t k = 0; k < frame.positions.size(); ++k) {
      estimate.positions[k] = frame.positions[k] + scene_.origin[k % d];
    }
    scene_.estimates.push_back(std::move(estimate));
  }

  Scene& scene_;
  SceneRun run_;
  Recording recording_;
  int last_ = 0;
};

}  // namespace

/// As this program writes it, or with blanks and an order of the members that others give it.
bool is_recording(std::string_view head) {
  if (head.starts_with(kOpening)) return true;
  const std::string_view line = head.substr(0, head.find('\n'));
  const std::size_t first = line.find_first_not_of(" \t\r");
  if (first == std::string_view::npos || line[first] != '{') return false;
  try {
    return JsonReader(line, "").text("format") == "cairn-recording";
  } catch (const Error&) {
    return false;
  }
}

Scene read_recording(std::string_view text, const std::string& name) {
  if (!is_recording(text)) {
    throw Error(ErrorCode::input,
                fmt::format("{}: is not a recording, as RecordingWriter writes it", name));
  }
  Scene scene;
  std::unique_ptr<FrameReader> frames;
  std::string run_name;
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos && number > 1) break;  // cut short
    const std::string where = fmt::format("{}:{}", name, number);
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (number == 1) {
      const JsonReader header(line, where);
      if (header.whole("version", 0, 0, kMostIterations) != 1) {
        header.fail("a version of recordings that this program does not know; expected 1");
      }
      run_name = header.text("name");
      scene = read_structure(line, where);
      scene.name = name;
      frames = std::make_unique<FrameReader>(scene);
    } else {
      frames->read(JsonReader(line, where));
    }
  }
  frames->finish(run_name.empty() ? name : run_name);
  return scene;
}

}  // namespace cairn
