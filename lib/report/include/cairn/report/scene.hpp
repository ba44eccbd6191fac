// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/report/number_table.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/solve/optimizer.hpp"

namespace cairn {

/// The kind of an edge in a report or plot; the numbers are those of docs/report.md.
enum class EdgeClass : std::uint8_t {
  odometry = 0,  ///< a relative factor between poses that follow each other
  loop = 1,      ///< any other relative factor between poses
  landmark = 2,  ///< a pose and a landmark
  prior = 3,     ///< one variable
  path = 4,      ///< poses that follow each other in a file without factors
  other = 5,
};

/// The role of an estimate beside others: determines its colour and dash.
enum class EstimateRole { initial, estimate, truth, peer };
CAIRN_API std::string_view to_string(EstimateRole role);

/// One set of positions for the variables of a `Scene`.
struct SceneEstimate {
  std::string name;
  EstimateRole role = EstimateRole::estimate;
  std::string file;                ///< where it is from, or empty
  int run = -1;                    ///< index into `Scene::runs`, or -1
  std::vector<double> positions;   ///< dimension × variables [m], world frame; NaN: not there
  std::vector<float> orientation;  ///< empty, or as in docs/report.md: 1 or 4 numbers each
  std::vector<float> edge_chi2;    ///< empty, or ‖r‖² of each edge; NaN: none
  double chi2 = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::int32_t> covariance_variables;
  std::vector<float> covariance_upper;  ///< [m²], 3 or 6 numbers for each of those variables
};

/// An optimisation, as it reported itself.
struct SceneRun {
  std::string name;
  Summary summary;
  int threads = 0;                     ///< 0: not known
  std::int64_t peak_memory_bytes = 0;  ///< 0: not known
};

/// Positions at one iteration of a run.
struct Frame {
  int iteration = 0;  ///< 0: the start
  double time = 0.0;  ///< [s] since the start
  double chi2 = 0.0;
  double seconds = 0.0;          ///< that this iteration took
  std::vector<float> positions;  ///< dimension × variables [m], relative to `Scene::origin`
};

/// The snapshots of a run, by increasing iteration.
struct Recording {
  std::string name;
  std::vector<Frame> frames;
};

struct SceneVariableType {
  std::string tag;
  bool pose = true;  ///< else a landmark
  int tangent_size = 0;
};

struct SceneEdgeType {
  std::string tag;
  int residual_size = 0;
};

/// A graph as reports and plots need it: its structure and positions, without types or
/// measurements. It is made from a graph (`scene_of`) or read from a run log.
struct Scene {
  std::string name;
  int dimension = 2;               ///< 2 or 3
  std::array<double, 3> origin{};  ///< [m] near the middle, so that floats do relative to it
  // Variables, in the order of the graph.
  std::vector<Id> ids;
  std::vector<SceneVariableType> variable_types;
  std::vector<std::uint8_t> variable_type;
  std::vector<std::int32_t> fixed;  ///< by the user
  std::vector<bool> held;           ///< constant: fixed or anchored; no columns in H
  // Edges: a factor has one from the first of its variables that has a position to each other that
  // has, and at least one.
  std::vector<std::int32_t> a, b;  ///< variables; b = -1 where none other has a position
  std::vector<EdgeClass> edge_class;
  std::vector<SceneEdgeType> edge_types;
  std::vector<std::uint8_t> edge_type;
  std::vector<std::int32_t>
      factor;       ///< position of the edge's factor; empty where edges are factors
  int factors = 0;  ///< how many there are; 0 for a trajectory

  std::vector<SceneEstimate> estimates;
  std::vector<SceneRun> runs;
  std::vector<Recording> recordings;

  int variable_count() const { return static_cast<int>(ids.size()); }
  int edge_count() const { return static_cast<int>(a.size()); }
};

/// The structure of a graph, without an estimate: `place` gives one. Throws `Error` (input) if the
/// graph has no variable with a position in space, or more than 255 types.
CAIRN_API Scene scene_of(const Graph& graph, std::string name);

/// Where the graph's variables are, with ‖r‖² of each edge and chi2 unless it has no factors.
/// `scene` is that of the same graph.
CAIRN_API SceneEstimate place(const Graph& graph, const Scene& scene, std::string name,
                              EstimateRole role);

/// The positions of the variables of another graph, matched by id to those of `scene`; poses only,
/// and without the third coordinate where `scene` has two. Returns how many ids matched in
/// `matched`.
CAIRN_API SceneEstimate place_by_id(const Graph& other, const Scene& scene, std::string name,
                                    EstimateRole role, int& matched);

/// Writes the positions of a graph's variables at `values`, relative to `origin`.
CAIRN_API void copy_positions(const Graph& graph, const Values& values, int dimension,
                              const std::array<double, 3>& origin, std::vector<float>& out);

/// The content of one report or plot.
struct Album {
  std::string title;
  std::string command;             ///< how it was made, or empty
  std::string created;             ///< 2026-11-01T12:00:00Z, or empty
  std::string machine, build;      ///< JSON objects as in the program's reports, or empty
  std::vector<std::string> notes;  ///< sentences for the reader
  std::vector<Scene> scenes;
  std::vector<std::string> explorations;  ///< EXPLORATIONs of docs/report.md, JSON objects
  std::string bench;                      ///< the report of `cairn bench --json`, or empty
  std::vector<NumberTable> tables;  ///< what plots of columns draw; the page has no part for them
};

/// Draws an `Album`. The names of this kind are those of output formats (html, svg, …); what is
/// drawn and how depends on the options of each. Names and texts from files may contain anything.
class CAIRN_API Picture : public Component {
 public:
  static constexpr std::string_view kKind = "picture";
  ~Picture() override;

  /// The bytes of the file. Throws `Error` (input) where `album` lacks what is to be drawn, naming
  /// what would provide it.
  virtual std::string draw(const Album& album) = 0;
};

}  // namespace cairn
