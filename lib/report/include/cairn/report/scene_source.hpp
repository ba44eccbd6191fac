// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "cairn/report/album_builder.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"

namespace cairn {

/// Files of a subject that can be shown beside graphs, such as recordings of a robot that explores:
/// the subject offers a component of this kind for them.
class CAIRN_API SceneSource : public Component {
 public:
  static constexpr std::string_view kKind = "scene_source";
  /// What is taken from a file.
  struct Wanted {
    bool whole = true;           ///< else its curves alone, as a table
    std::size_t most_bytes = 0;  ///< that it may add to a page; 0: any number
  };
  /// Whether a file that begins so is one.
  virtual bool knows(std::string_view head) const = 0;
  /// Adds what a file of that text has. Throws `Error` (input), naming `file`, where it is
  /// damaged.
  virtual void add(const std::string& file, const std::string& name, std::string_view text,
                   const Wanted& wanted, AlbumBuilder& album) const = 0;
};

}  // namespace cairn
