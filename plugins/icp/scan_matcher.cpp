// SPDX-License-Identifier: BSD-3-Clause
#include "scan_matcher.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "match_covariance.hpp"
#include "point_to_line.hpp"

namespace cairn::icp {
namespace {

/// A candidate of the search is refined by so many iterations, from this distance [m], before it is
/// compared with others.
constexpr int kShort = 6;
constexpr double kCandidateDistance = 0.3;
/// Poses that differ by no more than this are one [m, rad] …
constexpr double kSamePosition = 0.1, kSameAngle = 0.05;
/// … or by as much as the covariance explains, in squared standard deviations.
constexpr double kExplained = 16.0;

double quality(const Visibility& seen) {
  if (seen.seen() == 0) return 0.0;
  return static_cast<double>(seen.agreeing - 2 * seen.in_front) / seen.seen();
}

double rms(const std::vector<PointMatch>& matches) {
  if (matches.empty()) return 0.0;
  double sum = 0.0;
  for (const PointMatch& match : matches) sum += match.residual * match.residual;
  return std::sqrt(sum / static_cast<double>(matches.size()));
}

/// Whether two poses are the same, as far as the scans determine it.
bool same(const ScanMatch& match, const Pose2& other) {
  const Eigen::Vector3d apart = match.pose.local(other);
  if (apart.head<2>().norm() <= kSamePosition && std::abs(apart[2]) <= kSameAngle) return true;
  if (match.unobserved == 0) return false;
  return apart.dot(match.covariance.inverse() * apart) <= kExplained;
}

struct Refined {
  Pose2 pose;
  double quality;
};

}  // namespace

ScanMatch ScanMatcher::finish(const SurfaceScan& earlier, const SurfaceScan& later,
                              const Pose2& start, double distance) const {
  const PointToLine point_to_line(earlier, later, options_.refinement);
  Refinement refined = point_to_line.refine(start, distance, options_.refinement.iterations);
  ScanMatch match;
  match.pose = refined.pose;
  match.iterations = refined.iterations;
  match.matches = static_cast<int>(std::ssize(refined.matches));
  match.share = match.matches == 0 ? 0.0 : static_cast<double>(match.matches) / later.line_count();
  trim(refined.matches, options_.refinement.trim);
  match.rms = rms(refined.matches);
  const MatchCovariance uncertain =
      match_covariance(earlier, later, refined.matches, options_.covariance);
  match.covariance = uncertain.covariance;
  match.unobserved = uncertain.unobserved;
  match.visibility =
      mutual_visibility(earlier, later, match.pose, options_.acceptance.tolerance);
  match.quality = quality(match.visibility);
  return match;
}

Verdict ScanMatcher::judge(const ScanMatch& match) const {
  const AcceptanceOptions& least = options_.acceptance;
  if (match.matches < least.least_matches) return Verdict::few_matches;
  if (match.visibility.overlap() < least.least_overlap) return Verdict::little_overlap;
  if (match.visibility.conflict() > least.most_conflict) return Verdict::contradiction;
  if (match.rms > least.largest_rms) return Verdict::large_residuals;
  if (match.unobserved == 3) return Verdict::few_matches;
  if (match.runner_up > match.quality - least.margin) return Verdict::ambiguous;
  return Verdict::accepted;
}

ScanMatch ScanMatcher::refine(const SurfaceScan& earlier, const SurfaceScan& later,
                              const Pose2& guess) const {
  ScanMatch match = finish(earlier, later, guess, options_.refinement.distance);
  match.verdict = judge(match);
  return match;
}

ScanMatch ScanMatcher::search(const SurfaceScan& earlier, const SurfaceScan& later,
                              const Pose2& guess, const SearchWindow& window) const {
  const PointToLine point_to_line(earlier, later, options_.refinement);
  std::vector<Refined> refined;
  for (const Candidate& candidate :
       Correlation(earlier, window, options_.correlation).search(later, guess)) {
    const Pose2 pose = point_to_line.refine(candidate.pose, kCandidateDistance, kShort).pose;
    refined.push_back({pose, quality(mutual_visibility(earlier, later, pose,
                                                       options_.acceptance.tolerance))});
  }
  if (refined.empty()) return {};
  std::ranges::stable_sort(refined, std::greater{}, &Refined::quality);
  ScanMatch match = finish(earlier, later, refined.front().pose, options_.refinement.last_distance);
  for (const Refined& other : refined) {
    if (same(match, other.pose)) continue;
    match.runner_up = other.quality;
    break;
  }
  match.verdict = judge(match);
  return match;
}

}  // namespace cairn::icp
