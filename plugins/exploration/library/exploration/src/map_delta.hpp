// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/exploration/floor_map.hpp"

namespace cairn {

inline constexpr std::uint8_t kUnchangedCell = 254;  ///< in a delta
inline constexpr std::uint8_t kUnknownByte = 255;    ///< `kUnknownCell` as a byte

/// What has changed of a map since it was last asked: JSON text of a MAP in docs/recording.md.
class MapDelta {
 public:
  /// The object without braces round it, or nothing where no cell has changed.
  std::string changes(const FloorMap& map);

 private:
  /// Cells that stand on the lattice of the first map.
  struct Raster {
    int x = 0, y = 0, width = 0, height = 0;
    std::vector<std::uint8_t> cells;
    std::uint8_t at(int column, int row) const;
  };
  std::string start_lattice(const GridFrame& frame);

  GridFrame lattice_;
  Raster last_;
};

}  // namespace cairn
