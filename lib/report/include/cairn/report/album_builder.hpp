// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/report/run_report.hpp"
#include "cairn/report/scene.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/solve/initial_guess.hpp"

namespace cairn {

/// Combines graphs, trajectories, recordings and runs into what `Album` holds:
///
/// - graphs with the same ids over the first of them; the one with the lowest chi2 is the estimate,
///   of two otherwise the first the initial estimate, all others peers;
/// - graphs without factors (trajectories) over the last graph that has their ids, the first of
///   them as ground truth unless that is given;
/// - recordings and reports of runs with their graph;
/// - tables and explorations as they are.
///
/// Everything else stands by itself. Add everything, in any order, then `finish`. A file's name
/// identifies it: reports name the files of their graph and estimate.
class CAIRN_API AlbumBuilder {
 public:
  /// Reads a graph that a report names; none where it is not there (any more). May throw `Error`.
  using Load = std::function<std::optional<Graph>(const std::string& file)>;
  /// Receives a sentence on what is not shown; all of them are in `Album` too.
  using Note = std::function<void(const std::string& sentence)>;

  explicit AlbumBuilder(Load load, Note note = {})
      : load_(std::move(load)), note_(std::move(note)) {}

  /// Before any graph: each stands by itself under its name, also one with the ids of another.
  void keep_apart() { apart_ = true; }
  /// A graph or, without factors, a trajectory. `name`: what to call its estimate. `covariances`:
  /// of its variables, of the step δ (x_true = x · exp(δ)), shown as those of positions; not of a
  /// trajectory.
  void add_graph(const std::string& file, const std::string& name, Graph graph,
                 std::span<const ReportedCovariance> covariances = {});
  /// What `read_recording` has read.
  void add_recording(Scene recording) { recordings_.push_back(std::move(recording)); }
  void add_report(const std::string& file, std::variant<RunReport, BenchReport> report) {
    reports_.emplace_back(file, std::move(report));
  }
  /// What `read_number_table` has read, under this name.
  void add_table(NumberTable table, std::string name) {
    table.name = std::move(name);
    tables_.push_back(std::move(table));
  }
  /// An EXPLORATION of docs/report.md.
  void add_exploration(std::string json) { explorations_.push_back(std::move(json)); }
  /// A sentence on what is shown, for the report and for `Note`.
  void add_note(const std::string& sentence) { note(sentence); }
  void set_truth(const std::string& file, Graph truth) { truth_.emplace(file, std::move(truth)); }
  /// Each estimate is shown after the rigid motion that brings its poses nearest to those of the
  /// truth, as `compare` (evaluation/trajectory.hpp) moves it.
  void align_to_truth() { aligned_ = true; }
  /// Shows where this computation of initial estimates puts every graph; it outlives `finish`.
  void show_initial(const std::string& name, InitialGuess& initial) {
    initial_name_ = name;
    initial_ = &initial;
  }

  /// Puts graphs, notes and comparison into `album`; once. Throws `Error` (input) if no graph has
  /// the ids of the truth, (usage) if there are two comparisons.
  void finish(Album& album);

 private:
  /// A `Scene` with its graph, unless it came from a recording.
  struct Entry {
    Scene scene;
    std::optional<Graph> graph;
  };
  struct NamedGraph {
    std::string file, name;
    Graph graph;
  };

  void note(const std::string& sentence);
  Entry& add_entry(const std::string& file, const std::string& name, Graph graph);
  void lay_over(Entry& entry, const std::string& file, const std::string& name, const Graph& graph);
  void note_dimensions(const Entry& entry, const std::string& file, const Graph& graph);
  bool lay_by_id(const std::string& file, const std::string& name, const Graph& graph,
                 EstimateRole role);
  void join_trajectory(NamedGraph trajectory);
  void join_recording(Scene recording);
  void join_run(const std::string& file, RunReport report);
  void join_bench(const std::string& file, const BenchReport& report);
  void join_estimate(Entry& entry, const std::string& file, const RunReport& report);
  void note_lost_covariances(const std::string& file);
  void join_truth();
  void align_estimates(Scene& scene);
  void join_initial();
  Entry* find_graph(const std::string& graph, const std::string& report);
  bool known(const std::string& file) const;

  Load load_;
  Note note_;
  std::vector<Entry> entries_;
  std::vector<NamedGraph> trajectories_;
  std::vector<Scene> recordings_;
  std::vector<std::pair<std::string, std::variant<RunReport, BenchReport>>> reports_;
  std::optional<std::pair<std::string, Graph>> truth_;
  bool truth_known_ = false, apart_ = false, aligned_ = false;
  std::string initial_name_;
  InitialGuess* initial_ = nullptr;  // borrowed until `finish`
  std::vector<std::string> notes_;
  std::string bench_;
  std::vector<NumberTable> tables_;
  std::vector<std::string> explorations_;
};

/// "sphere.g2o" of "maps/sphere.g2o"; a generator's name ("@city") as it is.
CAIRN_API std::string short_name(const std::string& file);

}  // namespace cairn
