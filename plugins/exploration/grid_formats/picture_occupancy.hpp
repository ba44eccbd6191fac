// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "cairn/grid/grid.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/runtime/enum_names.hpp"
#include "picture.hpp"

namespace cairn::grids {

/// How levels of grey become occupancy; p = 1 − level / 255 is the probability of being occupied.
enum class PictureMode {
  trinary,  ///< free where p < free_thresh, occupied where p > occupied_thresh, else unknown
  scale,    ///< the same, but 1 to 99 per cent in between, and unknown where not opaque
  raw,      ///< the level is the percentage, above 100 unknown
};
constexpr auto enum_names(PictureMode) {
  return std::to_array<EnumName<PictureMode>>({{PictureMode::trinary, "trinary"},
                                               {PictureMode::scale, "scale"},
                                               {PictureMode::raw, "raw"}});
}

/// As in the YAML of ROS' map server, with its defaults.
struct PictureMeaning {
  PictureMode mode = PictureMode::trinary;
  bool negate = false;  ///< white is occupied
  double occupied = 0.65, free = 0.196;

  static auto fields() {
    using M = PictureMeaning;
    return OptionFields<M>()
        .choice("mode", &M::mode, "what levels between free and occupied are")
        .boolean("negate", &M::negate, "white is occupied, black free")
        .real("occupied", &M::occupied, 0.0, 1.0, "probability above which a cell is occupied")
        .real("free", &M::free, 0.0, 1.0, "probability below which a cell is free");
  }
};

/// The cells of an image; `frame` has their resolution and origin, its size is set. Throws `Error`
/// (input) where `check_frame` does, or if free ≥ occupied.
OccupancyGrid to_grid(const Picture& picture, const PictureMeaning& meaning, GridFrame frame,
                      const std::string& name);
/// The inverse: `to_grid` gives the same grid, but for percentages in mode trinary, which become 0,
/// 100 or unknown by `CellThresholds`.
Picture to_picture(const OccupancyGrid& grid, const PictureMeaning& meaning);

}  // namespace cairn::grids
