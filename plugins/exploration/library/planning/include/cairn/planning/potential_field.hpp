// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <vector>

#include "cairn/planning/configuration_space.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

struct PotentialRows;

struct PotentialFieldOptions {
  double attractor = 0.6, tolerance = 1e-3;
  int sweeps = 5000;

  static auto fields() {
    using O = PotentialFieldOptions;
    return OptionFields<O>()
        .real("attractor", &O::attractor, 0.0, 1.0,
              "configurations with more than this part of the largest decrease attract")
        .real("tolerance", &O::tolerance, 1e-14, 0.1,
              "relative change in a sweep of smoothing at which the field stands")
        .integer("sweeps", &O::sweeps, 1, 1000000, "of smoothing, at most");
  }
};

/// A potential over the free configurations whose gradient leads to where the entropy decreases
/// most (potential information field: thesis, 5.3.2).
///
/// Attractors, with a decrease of more than a part of the largest, keep their values; everywhere
/// else the potential is the mean of the six neighbours in x, y and θ (5.9), θ being periodic. A
/// neighbour where the body does not fit, at an obstacle or in the unknown, has the value of the
/// configuration beside it, divided by a weight w ≥ 1: with 1 paths run along obstacles, with more
/// they keep away.
///
/// The potential is that of the decrease, ψ = −φ ≥ 0, and is climbed. There dividing by w makes the
/// equations an M-matrix, strictly diagonally dominant at obstacles: they have one solution, above
/// zero, for every w. Multiplying φ ≥ 0 by w instead makes values at obstacles grow with each
/// sweep, and has no limit on most floors (a test shows it for a corridor).
///
/// It is solved by successive over-relaxation, in two colours, from the solution on a grid of
/// half as many cells and orientations, that on half as many again, and so forth. Its factor grows
/// to the best one for the rate at which changes become less (Young 1971), and falls where values
/// overshoot, as along narrow corridors.
class CAIRN_API PotentialField {
 public:
  /// `decrease`: −E ≥ 0 [nats], by `ConfigurationSpace::index`. The space must outlive it. 9 bytes
  /// per configuration, and 16 per cell; while it solves, two to four times as many, and seven
  /// times with less than ten orientations. `kernels`: by default the fastest that the machine can
  /// run; by name portable, avx2 or avx512. Throws `Error` (usage) for kernels that the machine
  /// cannot run, or another number of values.
  PotentialField(const ConfigurationSpace& space, std::span<const float> decrease,
                 const PotentialFieldOptions& options = {}, std::string_view kernels = "auto");

  struct Solution {
    int sweeps = 0;  ///< over all configurations
    /// Largest relative one in the last sweep; values below 1e-290 count as if they were that.
    double change = 0.0;
    bool converged = true;  ///< it stands
  };
  /// Solves with a weight w ≥ 1, from the beginning. Sweeps end after `seconds`, but for one on
  /// each grid and up to five where they are then, or when `interrupt`, if not null, is true: what
  /// is there then is smooth, and depends on the clock.
  Solution solve(double weight, double seconds = std::numeric_limits<double>::infinity(),
                 const std::atomic<bool>* interrupt = nullptr);

  double value(std::size_t configuration) const { return values_[configuration]; }
  bool is_attractor(std::size_t configuration) const { return fixed_[configuration] != 0; }

  enum class End {
    minimum,    ///< of −ψ, in an attractor
    elsewhere,  ///< where nothing is left of the gradient
    collision   ///< the body does not fit at the next step
  };
  struct Descent {
    std::vector<Pose2> path;  ///< from where it began, half a cell apart
    End end = End::minimum;
  };
  /// Steepest descent of −ψ, interpolated linearly in x, y and θ, a cell and an orientation being
  /// units of the same length. Begins at `from`, where the body must fit.
  Descent descend(const Pose2& from) const;

 private:
  const ConfigurationSpace& space_;
  PotentialFieldOptions options_;
  std::vector<double> values_;
  std::vector<char> fixed_;
  void (*relax_row_)(const PotentialRows&, std::size_t, std::size_t, double*);
  double weight_ = 1.0;
};

/// The corners of a polyline that leaves the cells of `path` nowhere by more than one cell and
/// stays where the body fits.
CAIRN_API std::vector<Eigen::Vector2d> straightened(const ConfigurationSpace& space,
                                                    std::span<const Pose2> path);

}  // namespace cairn
