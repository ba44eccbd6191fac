// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace cairn {

/// Rays from one point that all lie within 45° of one direction along an axis of the grid, the
/// *major* one. They are followed side by side, a line of cells (a column or a row) at a time: what
/// is in a line is one word of bits for all of them. Positions along a line are in fixed point,
/// with 32 bits behind the point.
struct RayFan {
  static constexpr int kLanes = 8;
  static constexpr int kPoint = 32;
  /// Cells before the first and behind the last one of a line. All of them stop rays, so that these
  /// leave the grid by a cell at most; but the word of a line follows the ray of the least slope,
  /// whether that still runs or not.
  static constexpr int kMargin = 128;
  /// How far rays of one fan may be apart in any line [cells]: 8 of a word's 64 are lost where it
  /// begins at a byte, and 3 to rays that lie at the border of a cell.
  static constexpr double kWidest = 52.0;
  /// At most so many lines are followed before it is asked whether any ray still runs.
  static constexpr int kAtOnce = 8;

  /// Rounding slopes makes an error of half a unit of fixed point in each line, 2⁻¹⁷ cells in so
  /// many: less than the tolerance.
  static constexpr int kMostLines = 65536;
  static constexpr std::int64_t kTolerance = std::int64_t{1} << 17;  // 2⁻¹⁵ cells
  /// A steeper ray could be in three cells of a line, with the tolerance on both sides.
  static constexpr double kSteepest = 1.0 - 1.0 / 8192.0;

  const std::uint8_t* bits = nullptr;  ///< of the line in which the rays begin
  std::ptrdiff_t stride = 0;           ///< from a line to the next one [bytes]
  int lines = 0;                       ///< after so many no ray is within its range
  double across = 0.0, along = 0.0;  ///< where the rays begin [cells], across lines and along them
  int step = 1, border = 0;  ///< to the next line, and the first border across: above `across`, or
                             ///< below it and steps are backwards
  std::int64_t cell = 0;     ///< floor(along)
  bool rows = false;         ///< lines are rows

  int count = 0, lowest = 0;           ///< rays, and the one of the least slope
  alignas(64) double minor[kLanes];    ///< component of the direction along the line
  alignas(64) double inverse[kLanes];  ///< 1 / component of the direction across it
  alignas(64) double slope[kLanes];    ///< minor |inverse|, `kSteepest` at most
};

/// Where the rays of a fan end, whatever their range is.
struct RayEnds {
  using Numbers = std::int64_t[RayFan::kLanes];
  alignas(64) Numbers line;  ///< counted from the first one; `RayFan::lines` or more: nowhere
  alignas(64) Numbers cell;  ///< of that line
  alignas(64) Numbers sure;  ///< 0: the ray passes a cell that stops rays very closely, and runs on
  alignas(64) double length[RayFan::kLanes];  ///< [cells] to where it enters the cell
};

/// Follows each ray to the first line in which a cell stops it that it enters, or would enter if it
/// were shifted along the line by the tolerance. Of the two cells that it may be in there, which it
/// enters and when is then found out by the comparisons of exact traversal, in floating point.
using FollowRays = void (*)(const RayFan&, RayEnds&);

/// The fastest that this machine can run, or `limit` (`choose_kernels`); null if it cannot.
FollowRays choose_ray_kernel(std::string_view limit);

/// 64 bits from a byte on, the lowest ones first.
[[gnu::always_inline]] inline std::uint64_t bits_from(const std::uint8_t* byte) {
  std::uint64_t word = 0;
  __builtin_memcpy(&word, byte, sizeof(word));
  if constexpr (std::endian::native == std::endian::big) word = __builtin_bswap64(word);
  return word;
}

}  // namespace cairn
