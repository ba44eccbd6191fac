// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/album_builder.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <string_view>

#include <fmt/core.h>
#include <Eigen/Core>

#include "cairn/evaluation/trajectory.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "scene_alignment.hpp"

namespace cairn {
namespace {

/// Poses that estimates in one scene must at least share with it.
constexpr int kFewestShared = 2;

/// "1 variable", "2 variables"
std::string counted(std::int64_t count, std::string_view noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

bool same_ids(const Scene& scene, const Graph& graph) {
  if (scene.variable_count() != graph.variable_count()) return false;
  return std::all_of(scene.ids.begin(), scene.ids.end(),
                     [&](Id id) { return graph.find(id).has_value(); });
}

void move_origin(Recording& recording, const std::array<double, 3>& from,
                 const std::array<double, 3>& to, int dimension) {
  const auto d = static_cast<std::size_t>(dimension);
  for (Frame& frame : recording.frames) {
    for (std::size_t k = 0; k < frame.positions.size(); ++k) {
      frame.positions[k] += static_cast<float>(from[k % d] - to[k % d]);
    }
  }
}

/// A recording and a report of one run: no two runs take the same time to the last bit.
bool same_run(const SceneRun& a, const SceneRun& b) {
  return a.summary.seconds.total == b.summary.seconds.total &&
         a.summary.final_chi2 == b.summary.final_chi2;
}

/// A covariance of a run, turned into one of the position in the world.
void add_ellipse(const Scene& scene, const Graph& of_scene, SceneEstimate& estimate,
                 const Graph& graph, const ReportedCovariance& reported) {
  const std::optional<int> variable = graph.find(reported.id);
  if (!variable) return;
  const VariableType& type = graph.type(*variable);
  const auto size = static_cast<std::size_t>(type.tangent_size());
  const int dimension = scene.dimension;
  if (!has_position(type) || type.placement()->dimension() != dimension) return;
  const std::vector<double>& sigma = reported.covariance;
  if (sigma.size() != size * size || std::ranges::all_of(sigma, [](double s) { return s == 0; }))
    return;  // of another type, or held
  const std::vector<double> world = position_covariance(type, graph.state(*variable), sigma);
  estimate.covariance_variables.push_back(*of_scene.find(reported.id));
  const Eigen::Map<const Eigen::MatrixXd> S(world.data(), dimension, dimension);
  for (const double number : pack(S))
    estimate.covariance_upper.push_back(static_cast<float>(number));
}

/// The lowest chi2 is the estimate; where there are two and it is the second's, the first is what
/// it began with. Several are a comparison.
void give_roles(Scene& scene) {
  std::vector<SceneEstimate*> open;
  for (SceneEstimate& estimate : scene.estimates) {
    if (estimate.role == EstimateRole::estimate) return;  // from a recording, which knows
    if (estimate.role == EstimateRole::peer) open.push_back(&estimate);
  }
  if (open.empty()) return;
  SceneEstimate* best = open.front();
  for (SceneEstimate* estimate : open) {
    if (estimate->chi2 < best->chi2 * (1 - 1e-9)) best = estimate;
  }
  best->role = EstimateRole::estimate;
  const bool guessed = std::any_of(
      scene.estimates.begin(), scene.estimates.end(),
      [](const SceneEstimate& estimate) { return estimate.role == EstimateRole::initial; });
  if (open.size() == 2 && best != open.front() && !guessed)
    open.front()->role = EstimateRole::initial;
}

}  // namespace

std::string short_name(const std::string& file) {
  if (file.starts_with('@')) return file;
  return file == "-" ? "standard input" : std::filesystem::path(file).filename().string();
}

void AlbumBuilder::note(const std::string& sentence) {
  if (note_) note_(sentence);
  notes_.push_back(sentence);
}

void AlbumBuilder::add_graph(const std::string& file, const std::string& name, Graph graph,
                             std::span<const ReportedCovariance> covariances) {
  if (graph.factor_count() == 0) {
    trajectories_.push_back({file, name, std::move(graph)});
    return;
  }
  const auto over = std::ranges::find_if(entries_, [&](const Entry& entry) {
    return !apart_ && entry.graph && same_ids(entry.scene, graph);
  });
  if (over == entries_.end()) {
    Entry& entry = add_entry(file, name, std::move(graph));
    if (apart_) entry.scene.name = name;
    for (const ReportedCovariance& covariance : covariances)
      add_ellipse(entry.scene, *entry.graph, entry.scene.estimates.back(), *entry.graph,
                  covariance);
    return;
  }
  lay_over(*over, file, name, graph);
  for (const ReportedCovariance& covariance : covariances)
    add_ellipse(over->scene, *over->graph, over->scene.estimates.back(), graph, covariance);
}

void AlbumBuilder::finish(Album& album) {
  for (NamedGraph& trajectory : trajectories_) join_trajectory(std::move(trajectory));
  for (Scene& recording : recordings_) join_recording(std::move(recording));
  for (auto& [file, report] : reports_) {
    if (const auto* bench = std::get_if<BenchReport>(&report)) {
      join_bench(file, *bench);
    } else {
      join_run(file, std::move(std::get<RunReport>(report)));
    }
  }
  if (truth_) join_truth();
  if (initial_) join_initial();
  for (Entry& entry : entries_) {
    give_roles(entry.scene);
    if (aligned_) align_estimates(entry.scene);
    album.scenes.push_back(std::move(entry.scene));
  }
  album.notes.insert(album.notes.end(), notes_.begin(), notes_.end());
  album.bench = std::move(bench_);
  album.tables = std::move(tables_);
  album.explorations = std::move(explorations_);
}

// Graphs and trajectories -------------------------------------------------------------------------

AlbumBuilder::Entry& AlbumBuilder::add_entry(const std::string& file, const std::string& name,
                                             Graph graph) {
  Entry entry{scene_of(graph, short_name(file)), std::move(graph)};
  entry.scene.estimates.push_back(place(*entry.graph, entry.scene, name, EstimateRole::peer));
  entry.scene.estimates.back().file = file;
  entries_.push_back(std::move(entry));
  return entries_.back();
}

/// Another set of states for a graph that is there already; chi2 is over the factors of the first.
void AlbumBuilder::lay_over(Entry& entry, const std::string& file, const std::string& name,
                            const Graph& graph) {
  Graph moved = entry.graph->clone();
  for (int v = 0; v < moved.variable_count(); ++v) {
    const int other = *graph.find(moved.id(v));
    if (moved.type(v).tag() != graph.type(other).tag()) {
      int matched = 0;
      note_dimensions(entry, file, graph);
      entry.scene.estimates.push_back(
          place_by_id(graph, entry.scene, name, EstimateRole::peer, matched));
      entry.scene.estimates.back().file = file;
      return;
    }
    moved.set_state(v, graph.state(other));
  }
  entry.scene.estimates.push_back(place(moved, entry.scene, name, EstimateRole::peer));
  entry.scene.estimates.back().file = file;
}

/// Says where a graph of the plane and one in space are laid over each other.
void AlbumBuilder::note_dimensions(const Entry& entry, const std::string& file,
                                   const Graph& graph) {
  if (entry.scene.dimension == 2) {
    if (is_planar(trajectory(graph))) return;
    note(fmt::format("{}: is in space, {} of the plane: x, y and the heading are shown alone", file,
                     entry.scene.name));
  } else if (is_planar(graph) && !(entry.graph && is_planar(trajectory(*entry.graph)))) {
    note(fmt::format("{}: is of the plane, {} in space: it is shown at z = 0", file,
                     entry.scene.name));
  }
}

/// Whether some scene took it: the one that has most of its ids, of several the last.
bool AlbumBuilder::lay_by_id(const std::string& file, const std::string& name, const Graph& graph,
                             EstimateRole role) {
  Entry* best = nullptr;
  SceneEstimate estimate;
  int most = kFewestShared - 1;
  for (Entry& entry : entries_) {
    int matched = 0;
    SceneEstimate here = place_by_id(graph, entry.scene, name, role, matched);
    if (matched < std::max(most, kFewestShared)) continue;
    most = matched;
    best = &entry;
    estimate = std::move(here);
  }
  if (!best) return false;
  if (most < graph.variable_count()) {
    note(fmt::format("{}: {} of {} are in {} by id, the rest is not shown", file, most,
                     counted(graph.variable_count(), "variable"), best->scene.name));
  }
  note_dimensions(*best, file, graph);
  estimate.file = file;
  best->scene.estimates.push_back(std::move(estimate));
  return true;
}

void AlbumBuilder::join_trajectory(NamedGraph trajectory) {
  const bool first = !truth_ && !truth_known_;
  const EstimateRole role = first ? EstimateRole::truth : EstimateRole::peer;
  if (lay_by_id(trajectory.file, trajectory.name, trajectory.graph, role)) {
    truth_known_ = true;
  } else {
    add_entry(trajectory.file, trajectory.name, std::move(trajectory.graph));
  }
}

void AlbumBuilder::join_truth() {
  const auto& [file, graph] = *truth_;
  if (!lay_by_id(file, "ground truth", graph, EstimateRole::truth)) {
    throw Error(ErrorCode::input,
                fmt::format("{}: none of the graphs has the ids of this ground truth", file));
  }
}

/// What stands nearest to the truth. Snapshots of runs move with the estimate.
void AlbumBuilder::align_estimates(Scene& scene) {
  const auto truth = std::ranges::find(scene.estimates, EstimateRole::truth, &SceneEstimate::role);
  if (truth == scene.estimates.end()) return;
  for (SceneEstimate& estimate : scene.estimates) {
    if (estimate.role == EstimateRole::truth) continue;
    const std::optional<Pose> motion = motion_to(*truth, estimate, scene);
    if (!motion) {
      note(fmt::format("{}: not aligned, fewer than two of its poses are in the ground truth",
                       estimate.name));
      continue;
    }
    move(estimate, scene, *motion);
    if (estimate.role != EstimateRole::estimate) continue;
    for (Recording& recording : scene.recordings) move(recording, scene, *motion);
  }
}

void AlbumBuilder::join_initial() {
  for (Entry& entry : entries_) {
    if (!entry.graph || entry.scene.factors == 0) continue;
    Graph start = entry.graph->clone();
    for (const std::string& sentence : initial_->compute(start)) {
      note(fmt::format("initial guess {}: {}", initial_name_, sentence));
    }
    entry.scene.estimates.push_back(
        place(start, entry.scene, "initial guess: " + initial_name_, EstimateRole::initial));
  }
}

// Recordings and reports --------------------------------------------------------------------------

void AlbumBuilder::join_recording(Scene recording) {
  for (Entry& entry : entries_) {
    Scene& scene = entry.scene;
    if (scene.ids != recording.ids || scene.dimension != recording.dimension ||
        recording.recordings.empty()) {
      continue;
    }
    Recording& frames = recording.recordings.front();
    move_origin(frames, recording.origin, scene.origin, scene.dimension);
    scene.recordings.push_back(std::move(frames));
    scene.runs.push_back(std::move(recording.runs.front()));
    return;
  }
  entries_.push_back({std::move(recording), std::nullopt});
}

void AlbumBuilder::join_bench(const std::string& file, const BenchReport& report) {
  if (!bench_.empty()) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: one comparison is shown at a time; leave out the other", file));
  }
  bench_ = report.text;
  for (const std::string& graph : report.graphs) find_graph(graph, file);
}

void AlbumBuilder::join_run(const std::string& file, RunReport report) {
  // Its output is the same graph: where that is shown and its input is not, or where the input was
  // standard input, which is gone.
  const bool written = !report.output.empty() && report.output != "-";
  const bool by_output = written && !known(report.graph) &&
                         (known(report.output) || report.graph.empty() || report.graph == "-");
  Entry* entry = find_graph(by_output ? report.output : report.graph, file);
  if (entry && entry->graph) {
    join_estimate(*entry, file, report);
  } else if (report.has_covariances) {
    note_lost_covariances(file);
  }
  if (!entry) {
    entries_.emplace_back();
    entry = &entries_.back();
    entry->scene.name = short_name(file);
  }
  for (SceneRun& shown : entry->scene.runs) {
    if (!same_run(shown, report.run)) continue;
    shown = std::move(report.run);  // the report says more than the recording
    return;
  }
  entry->scene.runs.push_back(std::move(report.run));
}

/// The estimate that a run wrote, and its covariances.
void AlbumBuilder::join_estimate(Entry& entry, const std::string& file, const RunReport& report) {
  const std::string& output = report.output;
  const bool shown = known(output);
  if (shown && !report.has_covariances) return;
  const std::optional<Graph> estimate = load_(output);
  if (!estimate) {
    if (report.has_covariances) note_lost_covariances(file);
    return;
  }
  if (!same_ids(entry.scene, *estimate)) return;
  if (!shown) {
    lay_over(entry, output, short_name(output), *estimate);
    entry.scene.estimates.back().run = static_cast<int>(entry.scene.runs.size());
  }
  const auto laid = std::ranges::find(entry.scene.estimates, output, &SceneEstimate::file);
  if (!report.has_covariances || laid == entry.scene.estimates.end()) return;
  laid->covariance_variables.clear();
  laid->covariance_upper.clear();
  for (const ReportedCovariance& covariance : report.covariances)
    add_ellipse(entry.scene, *entry.graph, *laid, *estimate, covariance);
}

void AlbumBuilder::note_lost_covariances(const std::string& file) {
  note(
      fmt::format("{}: its covariances are not shown, since the estimate was not written, or is "
                  "gone: give cairn optimize an output",
                  file));
}

bool AlbumBuilder::known(const std::string& file) const {
  return std::any_of(entries_.begin(), entries_.end(), [&](const Entry& entry) {
    return std::any_of(entry.scene.estimates.begin(), entry.scene.estimates.end(),
                       [&](const SceneEstimate& estimate) { return estimate.file == file; });
  });
}

/// The scene of a graph that a report names: one that is there, or read now if it can be. Null,
/// with a note, otherwise.
AlbumBuilder::Entry* AlbumBuilder::find_graph(const std::string& graph, const std::string& report) {
  for (Entry& entry : entries_) {
    for (const SceneEstimate& estimate : entry.scene.estimates) {
      if (estimate.file == graph) return &entry;
    }
  }
  try {
    std::optional<Graph> read = load_(graph);
    if (read) return &add_entry(graph, short_name(graph), std::move(*read));
    note(fmt::format("{}: its graph {} is not there, so only its curves are shown", report,
                     graph.empty() ? "(not named)" : graph));
  } catch (const Error& error) {
    note(fmt::format("{}: its graph is not shown: {}", report, error.what()));
  }
  return nullptr;
}

}  // namespace cairn
