// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "cairn/io/format.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/program/session.hpp"

namespace cairn::app {

/// How the graphs named on the command line are read.
struct InputOptions {
  std::string format;  ///< empty: by content
  ReadOptions read;

  static OptionFields<InputOptions> fields();
};

/// Shown where a graph is asked for.
inline constexpr const char* kGraphHelp =
    "file (.gz too; - is standard input), or @KIND[:k=v] to generate";

struct LoadedGraph {
  Graph graph;
  std::optional<Graph> truth;  ///< of a graph that was generated, or whose file has it
  ReadReport report;
  std::string name;      ///< as on the command line
  std::string label;     ///< what results call it: see `graph_label`
  double seconds = 0.0;  ///< that reading took
};

/// Reads a graph, and notes everything that the reader skipped, repaired or added.
/// "@manhattan:poses=500,seed=3" is generated: a generator, its options, and the seed.
LoadedGraph load_graph(const std::string& name, const InputOptions& options, Session& session);

/// The same for the ground truth, which no output may replace: the true states where they are known
/// beside the graph. Lines with unknown tags, such as those of measurements that are not read yet,
/// are skipped unless its factors are wanted, too.
LoadedGraph load_ground_truth(const std::string& name, InputOptions options, Session& session,
                              bool with_factors = false);

/// Whether some format of graphs goes by the ending of a file.
bool has_graph_ending(const std::string& file, Registry& registry);

/// Takes `seed=N` out of the options of what is generated, unless it has an option of that name.
std::uint64_t take_seed(ComponentSpec& spec, const OptionTable& table);

/// Runs a generator, given as `KIND:k=v`.
Simulation simulate(const std::string& spec, std::uint64_t seed, Session& session);

/// The format in which a graph is written to `file`: the one that `--to` names, else that of pipes
/// (g2o) where the file is standard output, else empty: that of the file's ending.
std::string output_format(const std::string& file, const std::string& named);

/// Finds out before the work whether its result can be written: throws `Error` if no format writes
/// files of that name, if it cannot be written there, or another output goes there. `format` is
/// what `--to` names. A graph may replace the one that it was made of.
/// `may_replace_graph`: it may take the place of the graph that is worked on.
void check_output(const std::string& file, const std::string& format, Session& session,
                  bool may_replace_graph = true);

/// Notes which variables of a graph a trajectory format leaves out, to which it is written, and
/// returns whether it is one. `format`: of `output_format`.
bool note_poses_alone(const Graph& graph, const std::string& file, const std::string& format,
                      Session& session);

/// How many variables have an orientation: those that a trajectory format writes.
std::int64_t pose_count(const Graph& graph);

/// The same for an output of another kind, which replaces no input.
void check_file(const std::string& file, Session& session);

/// What `ReadReport` says, a sentence each.
std::vector<std::string> sentences(const ReadReport& report);

}  // namespace cairn::app
