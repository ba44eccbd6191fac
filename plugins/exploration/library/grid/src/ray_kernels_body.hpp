// SPDX-License-Identifier: BSD-3-Clause
//
// The kernel of ray_kernels.hpp, compiled once for each instruction set: the including file sets
// CAIRN_KERNEL_SET (a name) and CAIRN_KERNEL_WIDTH (numbers of 64 bits in a vector register), and
// is compiled with that set's flags. No inline function of the standard library may be called here:
// compiled for a newer machine, it could be the copy that the linker keeps for all.

#include "ray_kernels.hpp"

#if defined(__AVX2__)
#include <immintrin.h>
#endif

namespace cairn::CAIRN_KERNEL_SET {
namespace {

constexpr int kWidth = CAIRN_KERNEL_WIDTH;
constexpr std::int64_t kCell = std::int64_t{1} << RayFan::kPoint;
constexpr int kByte = RayFan::kPoint + 3;  // from fixed point to bytes of cells
#if CAIRN_KERNEL_WIDTH == 1
using Lanes = std::uint64_t;
using Signed = std::int64_t;
using Reals = double;
#else
using Lanes = std::uint64_t __attribute__((vector_size(8 * CAIRN_KERNEL_WIDTH)));
using Signed = std::int64_t __attribute__((vector_size(8 * CAIRN_KERNEL_WIDTH)));
using Reals = double __attribute__((vector_size(8 * CAIRN_KERNEL_WIDTH)));
#endif

template <class To, class From>
[[gnu::always_inline]] inline To same_bits(From from) {
  To to;
  __builtin_memcpy(&to, &from, sizeof(to));
  return to;
}

Reals load(const double* numbers) {
  Reals lanes;
  __builtin_memcpy(&lanes, numbers, sizeof(lanes));
  return lanes;
}

template <class Number, class Vector>
[[gnu::always_inline]] inline void store(Number* numbers, Vector lanes) {
  __builtin_memcpy(numbers, &lanes, sizeof(lanes));
}

Lanes all(std::uint64_t number) { return Lanes{} + number; }
Lanes all(std::int64_t number) { return all(static_cast<std::uint64_t>(number)); }
Reals all(double number) { return Reals{} + number; }

// Below 2⁵¹ a sum with this number has the integer nearest to the other one in its last bits.
constexpr double kRounding = 6755399441055744.0;  // 1.5 · 2⁵²

Lanes nearest(Reals lanes) {
  return same_bits<Lanes>(lanes + kRounding) - all(same_bits<std::uint64_t>(kRounding));
}
Reals real(Lanes lanes) {
  return same_bits<Reals>(lanes + all(same_bits<std::uint64_t>(kRounding))) - kRounding;
}

bool any(Lanes lanes) {
#if defined(__AVX512F__)
  const auto numbers = reinterpret_cast<__m512i>(lanes);
  return _mm512_test_epi64_mask(numbers, numbers) != 0;
#elif defined(__AVX2__)
  const auto numbers = reinterpret_cast<__m256i>(lanes);
  return _mm256_testz_si256(numbers, numbers) == 0;
#else
  return lanes != 0;
#endif
}

/// 1 for each of the lanes that have a ray.
Lanes used(const RayFan& fan, int lane) {
  Lanes result;
  std::uint64_t one[kWidth];
  for (int k = 0; k < kWidth; ++k) one[k] = lane + k < fan.count ? 1 : 0;
  __builtin_memcpy(&result, one, sizeof(result));
  return result;
}

/// The byte with which a word begins that holds the cells of all rays in a line: the lowest ray is
/// `at` there, and changes by `before` at most; a cell for the tolerance.
std::int64_t first_byte(std::int64_t at, std::int64_t before) {
  return (at + before - kCell) >> kByte;
}

/// Positions in fixed point, of each lane.
struct Positions {
  Lanes first;  ///< where it enters the second line, less or more by the tolerance
  Lanes slope;  ///< by how much that changes from line to line
  Lanes reach;  ///< and to where it leaves it, with the tolerance on the other side
};

/// What stops each lane: in which line, and by its first cell there, its second, or both.
struct Stops {
  Lanes line, first, second;
};

Stops follow(const RayFan& fan, const Positions& rays, std::int64_t start, std::int64_t lowest,
             std::int64_t lowest_slope, Lanes running) {
  constexpr int kAtOnce = kWidth == 1 ? 1 : RayFan::kAtOnce;
  const std::ptrdiff_t stride = fan.stride;
  const int lines = fan.lines;
  const std::uint8_t* bits = fan.bits;
  const std::int64_t before = lowest_slope < 0 ? lowest_slope - kCell : -kCell;

  Lanes at = rays.first;
  const std::int64_t byte_0 = first_byte(start, -kCell);
  const Lanes end_0 = at + (rays.reach - rays.slope) - (all(byte_0) << kByte);
  Lanes second = (all(bits_from(bits + byte_0)) >> (end_0 >> RayFan::kPoint)) & running;
  running &= ~second;
  Stops stops{running, Lanes{}, second};
  for (int line = 1; line < lines && any(running); line += kAtOnce) {
    for (int k = 0; k < kAtOnce; ++k) {
      bits += stride;
      const std::int64_t byte = first_byte(lowest, before);
      const Lanes word = all(bits_from(bits + byte));
      const Lanes begin = at - (all(byte) << kByte), end = begin + rays.reach;
      const Lanes at_first = word >> (begin >> RayFan::kPoint);
      const Lanes at_second = word >> (end >> RayFan::kPoint);
      stops.first |= at_first & running;
      stops.second |= at_second & running;
      running &= ~(at_first | at_second);
      stops.line += running;
      at += rays.slope;
      lowest += lowest_slope;
    }
  }
  return stops;
}

void follow(const RayFan& fan, int lane, RayEnds& ends) {
  constexpr double kUnit = kCell;
  const double to_second = fan.step > 0 ? fan.border - fan.across : fan.across - fan.border;
  const auto start = static_cast<std::int64_t>((fan.along + RayFan::kMargin) * kUnit);
  const Reals slope = load(fan.slope + lane), inverse = load(fan.inverse + lane),
              minor = load(fan.minor + lane);
  const Lanes tolerance = slope < 0.0 ? all(RayFan::kTolerance) : all(-RayFan::kTolerance);
  Positions rays;
  rays.slope = nearest(slope * kUnit);
  rays.first = nearest(slope * (to_second * kUnit)) + all(start) + tolerance;
  rays.reach = rays.slope - 2 * tolerance;
  const double lowest = fan.slope[fan.lowest] * kUnit;
  const Stops stops =
      follow(fan, rays, start, start + static_cast<std::int64_t>(lowest * to_second),
             static_cast<std::int64_t>(lowest), used(fan, lane));

  // The two cells of the line that it may be in, and by how many cells the second one is away from
  // that in which it began.
  const Lanes line = stops.line, at_start = all(fan.cell + RayFan::kMargin);
  const Lanes enters = rays.first + rays.slope * (line - 1);
  const Lanes begin = line == 0 ? at_start : enters >> RayFan::kPoint;
  const Lanes end = (enters + rays.reach) >> RayFan::kPoint, moved = end - at_start;
  // When it enters this line and the next one, and when it changes into the second cell.
  const Reals border = real(line) * double(fan.step) + double(fan.border - fan.step);
  const Reals from = line == 0 ? Reals{} : (border - fan.across) * inverse;
  const Reals to = (border + double(fan.step) - fan.across) * inverse;
  const Reals side = real(moved + all(fan.cell)) + (minor < 0.0 ? all(1.0) : Reals{});
  const Reals changes = minor == 0.0 ? all(__builtin_inf()) : (side - fan.along) * (1.0 / minor);
  // Through a corner a ray goes along x first.
  const auto changes_before = [&](const Reals& other) {
    return fan.rows ? changes <= other : changes < other;
  };
  // It is in the second cell alone: also where the first one is behind the start.
  const auto alone = (begin == end) | (moved == 0) | ((line != 0) & changes_before(from));
  const auto at_once = (alone ? stops.second : stops.first) != 0;
  const auto later = (stops.second != 0) & changes_before(to);
  store(ends.line + lane, line);
  store(ends.cell + lane, (alone ? end : at_once ? begin : end) - RayFan::kMargin);
  store(ends.sure + lane, at_once | later ? all(std::uint64_t{1}) : Lanes{});
  store(ends.length + lane, at_once ? from : changes);
}

}  // namespace

void follow_rays(const RayFan& fan, RayEnds& ends);
void follow_rays(const RayFan& fan, RayEnds& ends) {
  for (int lane = 0; lane < fan.count; lane += kWidth) follow(fan, lane, ends);
}

}  // namespace cairn::CAIRN_KERNEL_SET
