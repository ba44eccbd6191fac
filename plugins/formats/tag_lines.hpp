// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "draft.hpp"
#include "scanner.hpp"

namespace cairn::formats {

/// What a format does with the lines of one tag.
using LineReader = std::function<void(Scanner&, Draft&)>;

/// The tags that a format knows, with the readers of their lines. A tag is looked up once per line,
/// so this is a short array with the last hit first, not a map.
class TagTable {
 public:
  void add(std::string tag, LineReader reader) {
    rows_.push_back({std::move(tag), std::move(reader)});
  }

  const LineReader* find(std::string_view tag) {
    if (last_ < rows_.size() && rows_[last_].tag == tag) return &rows_[last_].reader;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      if (rows_[i].tag == tag) {
        last_ = i;
        return &rows_[i].reader;
      }
    }
    return nullptr;
  }
  std::vector<std::string> tags() const {
    std::vector<std::string> names;
    for (const Row& row : rows_) names.push_back(row.tag);
    return names;
  }

 private:
  struct Row {
    std::string tag;
    LineReader reader;
  };
  std::vector<Row> rows_;
  std::size_t last_ = 0;
};

/// `FIX id id …`.
void read_fix(Scanner& scanner, Draft& draft);

/// A line with an unknown tag: counted where that was asked for, else an error with the tag of
/// `on_offer()`, which is asked only then, or of `commands` that is nearest, or with all tags where
/// none is near. `commands`: the other words that lines of a stream begin with, which stand for the
/// many tags there, since a stream may have such lines again and again.
void unknown_tag(const Scanner& scanner, Draft& draft, const ReadOptions& options,
                 const std::function<std::vector<std::string>()>& on_offer,
                 std::span<const std::string> commands = {});

/// Reads a factor line whose measurement stands there as it is kept: ids, measurement, information.
void read_factor(Scanner& scanner, Draft& draft, std::int32_t kind,
                 const Arrangement& arrangement = kRows);
/// Reads the information of the draft's last factor, and thereby ends its line.
void read_information(Scanner& scanner, Draft& draft, const Arrangement& arrangement = kRows);
/// The same of an edge of poses in space, measured as x y z roll pitch yaw.
void read_edge_of_angles(Scanner& scanner, Draft& draft, std::int32_t kind,
                         const Arrangement& arrangement);
/// x y z roll pitch yaw as x y z qx qy qz qw.
void read_pose_of_angles(Scanner& scanner, std::span<double> pose);
/// Reads a variable line: id and state.
void read_variable(Scanner& scanner, Draft& draft, std::int32_t kind);

}  // namespace cairn::formats
