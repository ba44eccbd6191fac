// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace cairn::performance {

/// A graph to measure on, as the command line of `cairn` takes it.
struct DataSet {
  std::string name;
  std::string graph;                   ///< a file, or @KIND:options
  std::vector<std::string> arguments;  ///< what reading it needs
  bool generated() const { return graph.starts_with('@'); }
};

/// Where the true poses of a graph come from.
enum class Truth {
  generated,  ///< the generator knows them
  file,       ///< a graph or a trajectory
  edges,      ///< measurements without noise, to be optimised
  camera,     ///< poses of a camera in KITTI's axes
  simulated,  ///< the same, along which the graph is simulated, too (`camera_world`)
  de_facto    ///< nobody knows them: the minimum of all measurements
};

/// A graph for `cairn compact`.
struct TruthfulSet {
  DataSet set;
  Truth truth = Truth::generated;
  std::string file{};                    ///< with the truth
  std::vector<std::string> arguments{};  ///< what optimising it needs
};

// The graphs of each study: the published ones that lie in the folder `data` (empty: none do), then
// generated ones, which everybody has. `quick`: few and small.
// For `cairn compact`:
/// The ellipses of Ila et al. (2017) with the noise that the errors in their Table 4 show, and more
/// options of the generators. Their relative pose errors of odometry, 0.100 m and 3.16 degrees of
/// ellipse3D and 0.095 m and 2.74 degrees of ellipseN, over sqrt(3), are that of an axis: as much
/// for every pair, and not 5 % of its motion. ellipseN was matched within about 1 m, by its v.
DataSet ellipse3d(const std::string& more = {});
DataSet ellipse_n(int laps, const std::string& more = {});
/// The sensor of these, as options of the registration `simulated`.
inline constexpr const char* kEllipseSensor = "range=3,angle=0.2";
inline constexpr const char* kEllipseNSensor = "range=1,angle=0.2";

std::vector<TruthfulSet> compact_sets(const std::string& data, bool quick);
std::vector<TruthfulSet> gain_sets(const std::string& data, bool quick);
std::vector<TruthfulSet> comparison_sets(const std::string& data, bool quick);

// For `cairn sparsify`; without published graphs, generated ones:
/// M3500, Intel, FR079 and MITb, those of the thesis.
std::vector<DataSet> thesis_sets(const std::string& data, bool quick);
std::vector<DataSet> space_sets(const std::string& data, bool quick);
std::vector<DataSet> large_sets(const std::string& data, bool quick);
std::vector<DataSet> sparsify_online_sets(const std::string& data, bool quick);
std::vector<DataSet> edge_sets(const std::string& data, bool quick);

/// With a registration that measures what the truth is.
struct SimulatedSet {
  TruthfulSet set;
  std::string range;  ///< of the simulated sensor, as options of `--registration simulated`
};
/// Whose maps are drawn.
struct FigureSet {
  TruthfulSet set;
  bool norms = false;  ///< and the norms of covariances, which takes longer
};
std::vector<FigureSet> figure_sets(const std::string& data, bool quick);

/// With what a robot knows of its sensor.
struct LiveSet {
  TruthfulSet set;
  std::vector<std::string> sensor{};  ///< its range, as arguments; empty: thresholds are found
};
/// Circles whose loop closures are half to five times as noisy as odometry, and recordings.
std::vector<LiveSet> live_sets(const std::string& data, bool quick);
std::vector<SimulatedSet> simulated_sets(const std::string& data, bool quick);

}  // namespace cairn::performance
