// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/component.hpp"

namespace cairn {

class Registry;

/// How to read a file.
struct ReadOptions {
  /// Skip lines with unknown tags, counted in the report, and factors on vertices that are skipped.
  bool skip_unknown = false;
  bool repair_information = false;  ///< repair known mistakes in information matrices
  /// Take the information of factors whose lines end before it as the identity.
  bool unit_information = false;
  /// Leave out factors on variables that the file does not give, as those of another robot.
  bool skip_dangling = false;
};

/// What reading did beyond building the graph. Everything that is skipped or changed is listed
/// here.
struct ReadReport {
  std::string format;
  std::map<std::string, std::int64_t> skipped;  ///< unknown tag → lines
  std::int64_t repaired = 0;                    ///< information matrices repaired
  std::vector<std::string> notes;  ///< sentences: renumbered ids, missing vertices, …
  std::vector<double> stamps;  ///< time [s] of each pose, by rising id; empty if the file has none
  bool row_ids = false;        ///< the file has no ids: they are the numbers of its rows from 0
  /// The graph at the true states, where the file has them beside (`pyfg`).
  std::optional<Graph> truth;
};

/// A file format. The reader is given the whole text, unpacked.
class CAIRN_API Format : public Component {
 public:
  static constexpr std::string_view kKind = "format";
  ~Format() override;

  virtual bool can_read() const = 0;
  virtual bool can_write() const = 0;
  /// File name endings without the dot, such as "g2o"; first the one for new files.
  virtual std::vector<std::string> extensions() const = 0;

  /// The confidence that the text (the beginning of a file, at least its first lines) is in this
  /// format: 0 certainly not, 100 certain. File name endings are not considered.
  virtual int detect(std::string_view head) const = 0;

  /// Builds a graph. Types come from the registry by tag. Throws `Error` (input) with `name`, line,
  /// what was found and what was expected.
  virtual Graph read(std::string_view text, const std::string& name, Registry& types,
                     const ReadOptions& options, ReadReport& report) = 0;

  /// The graph (its estimate and, where the format has them, its factors) as text. Throws `Error`
  /// (input) naming the first variable or factor that the format cannot express.
  virtual std::string write(const Graph& graph) = 0;
};

/// Reads a graph: unpacks .gz by content, chooses the format by content where `format` is empty.
/// Throws `Error` (input) when the file cannot be opened, is empty, or no format knows it.
CAIRN_API Graph read_graph(const std::filesystem::path& file, Registry& registry,
                           const ReadOptions& options, ReadReport& report,
                           std::string_view format = {});
CAIRN_API Graph read_graph(const std::filesystem::path& file, Registry& registry);

/// Writes a graph: format by `format`, else by the file's ending (before .gz, which packs). The
/// file is written beside and renamed, so that a failure never leaves half a file. "-" is standard
/// output. `stamps`: the time [s] of each pose, by rising id, for formats that have times.
CAIRN_API void write_graph(const Graph& graph, const std::filesystem::path& file,
                           Registry& registry, std::string_view format = {},
                           std::span<const double> stamps = {});

/// Whether the format that `write_graph` would choose writes poses alone (`TrajectoryWriter`).
CAIRN_API bool writes_poses_alone(const std::filesystem::path& file, Registry& registry,
                                  std::string_view format = {});

/// The ending of a file's name without the dot and in lower case, "g2o" of "map.G2O.gz": .gz is
/// taken off before. Empty: it has none.
CAIRN_API std::string file_ending(std::filesystem::path file);

/// The bytes of a file, unpacked if they are gzip. Throws `Error` (input), also where they unpack
/// to more than 256 MB and 200 times the file.
CAIRN_API std::string read_file(const std::filesystem::path& file);

/// Tries what `write_file` needs, and leaves nothing: throws `Error` (input) where its folder is
/// not there or refuses, the name is too long, or names a folder or a file that no other can
/// replace (mounted by itself, immutable, another user's in a sticky folder).
CAIRN_API void check_writable(const std::filesystem::path& file);

/// Writes beside and renames. Packs if the name ends in .gz. "-" is standard output, whose reader
/// may have gone: that is no error. Throws `Error` (input).
CAIRN_API void write_file(const std::filesystem::path& file, std::string_view bytes);

}  // namespace cairn
