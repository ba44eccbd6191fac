// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include <Eigen/Core>

#include "cairn/exploration/explorer.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/enum_names.hpp"

namespace cairn {

/// Entropy of a Gaussian with covariance Σ: `standard` is ½ ln((2πe)ⁿ |Σ|); `thesis` is equation
/// 5.5 as printed, ln((2πe)^{n/2} |Σ|), which lacks the root of the determinant.
enum class EntropyForm { standard, thesis };
constexpr auto enum_names(EntropyForm) {
  return std::to_array<EnumName<EntropyForm>>(
      {{EntropyForm::standard, "standard"}, {EntropyForm::thesis, "thesis"}});
}

/// By which pose α weighs the map's entropy in the decrease that a path is expected to bring:
/// `now` is ΔH(x) + α_t ΔH(m) with the pose at its beginning, so that α is the same for all paths
/// of a decision; `end` is ΔH(x) + α_T ΔH(m) with the pose at its end, which favours paths that
/// close a loop last; `both` is ΔH(x) + α_T H(m_T) − α_t H(m_t) (thesis, 5.11 and 5.12 as printed:
/// there a path that discovers nothing and loses its way is better than any exploration), and
/// `none` has α = 1 (Valencia et al. 2012).
enum class AlphaForm { end, now, both, none };
constexpr auto enum_names(AlphaForm) {
  return std::to_array<EnumName<AlphaForm>>({{AlphaForm::end, "end"},
                                             {AlphaForm::now, "now"},
                                             {AlphaForm::both, "both"},
                                             {AlphaForm::none, "none"}});
}

/// The objective that a path shall make small: how much it changes the joint entropy of
/// trajectory and map (thesis, 5.4 and 5.10), with what is left open there as options.
struct JointObjectiveOptions {
  EntropyForm entropy = EntropyForm::standard;
  AlphaForm alpha = AlphaForm::now;
  /// |Σ_ref| of α = (|Σ_ref| / |Σ|)^power [m⁴rad²]; 1 is the thesis's α. 0: that of the pose error
  /// which blurs a point at half the lidar's range by one cell: σ_xy = l/√2, σ_θ = √2 l/range.
  double reference = 0.0;
  double power = 1.0;

  static auto fields() {
    using O = JointObjectiveOptions;
    return OptionFields<O>()
        .choice("entropy", &O::entropy,
                "of a Gaussian: standard is ½ ln((2πe)ⁿ|Σ|), thesis lacks the root of |Σ|")
        .choice(
            "alpha", &O::alpha,
            "the pose whose uncertainty weighs what is discovered: now, at the path's end, both "
            "as printed in the thesis, or none")
        .real("reference", &O::reference, 0.0, 1e12,
              "determinant [m⁴rad²] with which a discovery counts fully; 0: from the cell's size "
              "and the lidar's range; 1: as in the thesis")
        .real("power", &O::power, 0.0, 10.0, "of the ratio of determinants; 1: as in the thesis");
  }
};

class CAIRN_API JointObjective {
 public:
  /// `resolution`: side of a cell [m]; `range`: of the lidar [m].
  JointObjective(const JointObjectiveOptions& options, double resolution, double range);

  /// (|Σ_ref| / |Σ|)^power, or 1 with `alpha=none`.
  double alpha(const Eigen::Matrix3d& covariance) const;

  /// What a path is expected to do, as far as α matters: `now` and `end` are the covariances of
  /// the robot's pose before it and at its end.
  InformationChange change(double trajectory, double map, const Eigen::Matrix3d& now,
                           const Eigen::Matrix3d& end) const;
  /// The change of the joint entropy [nats]; below zero: a decrease. `map_now`: the map's entropy
  /// before [nats·m²], and `now` the covariance, which count with `alpha=both` alone.
  double value(const InformationChange& change, double map_now, const Eigen::Matrix3d& now) const;

  const JointObjectiveOptions& options() const { return options_; }

 private:
  JointObjectiveOptions options_;
  double reference_ = 1.0;
};

}  // namespace cairn
