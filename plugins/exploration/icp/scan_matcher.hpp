// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cairn/runtime/enum_names.hpp"
#include "cairn/typed/pose2.hpp"
#include "scan_matcher_options.hpp"
#include "surface_scan.hpp"
#include "visibility.hpp"

namespace cairn::icp {

/// Whether a match is accepted, or else why not.
enum class Verdict {
  accepted,
  no_candidate,    ///< the search found none, or refining it came to nothing
  few_matches,     ///< too few points on lines
  little_overlap,  ///< too few of the points in each other's view agree
  contradiction,   ///< one lidar looked through what the other saw
  large_residuals,
  ambiguous,  ///< another pose fits nearly as well
};
constexpr auto enum_names(Verdict) {
  return std::to_array<EnumName<Verdict>>({{Verdict::accepted, "accepted"},
                                           {Verdict::no_candidate, "no candidate"},
                                           {Verdict::few_matches, "few matches"},
                                           {Verdict::little_overlap, "little overlap"},
                                           {Verdict::contradiction, "contradiction"},
                                           {Verdict::large_residuals, "large residuals"},
                                           {Verdict::ambiguous, "ambiguous"}});
}

struct ScanMatch {
  Verdict verdict = Verdict::no_candidate;
  Pose2 pose;  ///< z, of the later scan in the frame of the earlier one
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of ξ in z exp(ξ) [m², m rad, rad²]
  int unobserved = 0;       ///< directions that the scans do not determine
  int matches = 0;          ///< points on lines, before trimming
  double share = 0.0;       ///< of the later scan's points with a line
  double rms = 0.0;         ///< of their residuals after trimming [m]
  Visibility visibility;    ///< of both scans' points
  double quality = 0.0;     ///< see `ScanMatcher`
  double runner_up = -1.0;  ///< quality of the best pose that differs; −1: there was no other
  Eigen::Vector3d weakest = Eigen::Vector3d::UnitX();  ///< ξ of the least information [1 m]
  int iterations = 0;

  bool accepted() const { return verdict == Verdict::accepted; }
};

/// Measures the relative pose of two laser scans.
///
/// Where the guess is poor, a correlative search of a window (`Correlation`) gives candidates, each
/// of which is refined a little (`PointToLine`). Of those the one with the highest *quality* is
/// refined to the end: the part of the points within the other lidar's view that agree, less twice
/// the part that is in front of what it saw. The match is accepted if enough points are on lines
/// and agree, few are in contradiction, and no other candidate comes near in quality, but for those
/// that differ along directions that the scans do not determine, as along a corridor: these get a
/// large variance.
///
/// Deterministic. What it computes is on the stack or local: one object may serve several threads.
class ScanMatcher {
 public:
  explicit ScanMatcher(const ScanMatcherOptions& options = {}) : options_(options) {}

  const ScanMatcherOptions& options() const { return options_; }
  SurfaceScan prepare(const LaserScan& scan) const { return SurfaceScan(scan, options_.surface); }

  /// The pose of `later` in the frame of `earlier`, from a guess that is good.
  ScanMatch refine(const SurfaceScan& earlier, const SurfaceScan& later, const Pose2& guess) const;
  /// The same where it may be anywhere in a window around the guess.
  ScanMatch search(const SurfaceScan& earlier, const SurfaceScan& later, const Pose2& guess,
                   const SearchWindow& window) const;

 private:
  class Search;
  ScanMatch finish(const SurfaceScan& earlier, const SurfaceScan& later, const Pose2& start,
                   double distance) const;
  Verdict judge(const ScanMatch& match) const;

  ScanMatcherOptions options_;
};

}  // namespace cairn::icp
