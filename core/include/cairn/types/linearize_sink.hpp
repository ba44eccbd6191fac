// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace cairn {

/// Where one block or one gradient of a factor goes: an offset [doubles] in one of the arrays of a
/// `LinearizeSink`, and whether it is written there or added to what is there.
class LinearizeTarget {
 public:
  enum class Array : std::uint8_t { H, gradient, scratch };
  enum class How : std::uint8_t { write, add };

  /// Nowhere: one of the variables is constant.
  constexpr LinearizeTarget() = default;
  /// `transposed`: of a block, whether its transpose is meant.
  constexpr LinearizeTarget(Array array, std::int64_t offset, How how, bool transposed = false)
      : bits_(offset * 16 + (transposed ? 8 : 0) + (how == How::add ? 4 : 0) +
              static_cast<int>(array)) {}

  constexpr bool is_none() const { return bits_ < 0; }
  constexpr Array array() const { return static_cast<Array>(bits_ & 3); }
  constexpr std::int64_t offset() const { return bits_ >> 4; }
  constexpr bool adds() const { return (bits_ & 4) != 0; }
  constexpr bool transposed() const { return (bits_ & 8) != 0 && !is_none(); }

 private:
  std::int64_t bits_ = -16;
};

/// Where the contributions of the factors of a pool to H and to the gradient go. The linearizer
/// chooses the targets so that every sum has one order, that of the factors, and none depends on
/// the number of threads.
struct LinearizeSink {
  std::array<double*, 3> arrays{};  ///< by `LinearizeTarget::Array`
  /// size × arity(arity+1)/2, pairs (a, b) with a ≤ b in the order (0,0) (0,1) … (1,1) (1,2) …
  /// The block is J_aᵀ J_b (tangent_a × tangent_b, column-major), or its transpose where the target
  /// says so.
  const LinearizeTarget* blocks = nullptr;
  /// size × arity: where −J_aᵀ r goes.
  const LinearizeTarget* gradients = nullptr;

  /// Where a target that is not none starts.
  double* at(LinearizeTarget target) const {
    return arrays[static_cast<std::size_t>(target.array())] + target.offset();
  }
  /// Writes or adds numbers, or does nothing where there is no target.
  void put(LinearizeTarget target, const double* numbers, std::size_t count) const {
    if (target.is_none()) return;
    double* to = at(target);
    for (std::size_t k = 0; k < count; ++k) to[k] = target.adds() ? to[k] + numbers[k] : numbers[k];
  }
};

}  // namespace cairn
