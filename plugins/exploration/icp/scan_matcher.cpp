// SPDX-License-Identifier: BSD-3-Clause
#include "scan_matcher.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "match_covariance.hpp"
#include "point_to_line.hpp"

namespace cairn::icp {
namespace {

/// Largest distance from a point to its line in the first iteration from a good guess [m].
constexpr double kFirstDistance = 0.5;
/// A candidate of the search is refined by so many iterations, from this distance [m], before it is
/// compared with others.
constexpr int kShort = 6;
constexpr double kCandidateDistance = 0.3;
/// The direction of the least information is explored in such steps, this far [m]; where it is not
/// observed through all of the window, in steps that are larger …
constexpr double kExploring = 0.1, kExplored = 0.3, kCoarse = 0.2;
/// … and again, at most so often, from a pose whose quality is better by this.
constexpr int kRounds = 3;
constexpr double kBetter = 0.01;
/// Poses that differ by no more than this are one [m, rad] …
constexpr double kSamePosition = 0.1, kSameAngle = 0.05;
/// … or by as much as the covariance explains, in squared standard deviations.
constexpr double kExplained = 16.0;
/// What is accepted has so many points on lines, so large a part of the points in each other's view
/// that agrees, and a quality that exceeds that of any other pose by so much.
constexpr int kLeastMatches = 20;
constexpr double kLeastOverlap = 0.6, kMargin = 0.06;
/// Ranges agree within so many standard deviations.
constexpr double kNoise = 3.5;

/// Ranges that differ by no more agree [m].
double tolerance(const SurfaceScan& earlier, const SurfaceScan& later, double least) {
  return std::max(least, kNoise * std::max(earlier.sigma(), later.sigma()));
}

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
  Refinement refined = PointToLine(earlier, later, options_.last_distance).refine(start, distance);
  ScanMatch match;
  match.pose = refined.pose;
  match.iterations = refined.iterations;
  match.matches =
      static_cast<int>(std::ranges::count(refined.matches, false, &PointMatch::inverse));
  match.share = match.matches == 0 ? 0.0 : static_cast<double>(match.matches) / later.line_count();
  trim(refined.matches);
  match.rms = rms(refined.matches);
  const MatchCovariance uncertain =
      match_covariance(earlier, later, refined.matches, options_.covariance);
  match.covariance = uncertain.covariance;
  match.unobserved = uncertain.unobserved;
  match.weakest = uncertain.weakest;
  match.visibility = mutual_visibility(earlier, later, match.pose,
                                       tolerance(earlier, later, options_.acceptance.tolerance));
  match.quality = quality(match.visibility);
  return match;
}

Verdict ScanMatcher::judge(const ScanMatch& match) const {
  const AcceptanceOptions& least = options_.acceptance;
  if (match.matches < kLeastMatches) return Verdict::few_matches;
  if (match.visibility.overlap() < kLeastOverlap) return Verdict::little_overlap;
  if (match.visibility.conflict() > least.most_conflict) return Verdict::contradiction;
  if (match.rms > least.largest_rms) return Verdict::large_residuals;
  if (match.unobserved == 3) return Verdict::few_matches;
  if (match.runner_up > match.quality - kMargin) return Verdict::ambiguous;
  return Verdict::accepted;
}

ScanMatch ScanMatcher::refine(const SurfaceScan& earlier, const SurfaceScan& later,
                              const Pose2& guess) const {
  ScanMatch match = finish(earlier, later, guess, kFirstDistance);
  match.verdict = judge(match);
  return match;
}

/// Candidates that are refined a little and compared.
class ScanMatcher::Search {
 public:
  Search(const ScanMatcher& matcher, const SurfaceScan& earlier, const SurfaceScan& later)
      : matcher_(matcher),
        earlier_(earlier),
        later_(later),
        point_to_line_(earlier, later, matcher.options_.last_distance),
        tolerance_(tolerance(earlier, later, matcher.options_.acceptance.tolerance)) {}

  void add(const Pose2& start) {
    const Pose2 pose = point_to_line_.refine(start, kCandidateDistance, kShort).pose;
    refined_.push_back({pose, quality(mutual_visibility(earlier_, later_, pose, tolerance_))});
  }
  bool empty() const { return refined_.empty(); }
  const Refined& best() const {
    return *std::ranges::max_element(refined_, {}, &Refined::quality);  // the first of equals
  }

  /// The best, refined to the end. From there the direction of the least information is explored,
  /// as local optima follow each other along it; if one of them is better it is refined instead.
  ScanMatch finish(const Pose2& guess, const SearchWindow& window) {
    ScanMatch match;
    for (int round = 0; round < kRounds; ++round) {
      const Refined start = best();
      match = matcher_.finish(earlier_, later_, start.pose, matcher_.options_.last_distance);
      const bool all = match.unobserved > 0;
      const double reach = all ? std::hypot(window.x, window.y) : kExplored;
      const double spacing = all ? kCoarse : kExploring;
      for (double offset = spacing; offset <= reach; offset += spacing) {
        for (const double side : {-offset, offset}) {
          const Pose2 pose = match.pose.retract(side * match.weakest);
          if (within(window, guess, pose)) add(pose);
        }
      }
      if (best().quality <= std::max(start.quality, match.quality) + kBetter) break;
    }
    for (const Refined& other : refined_) {
      if (!same(match, other.pose)) match.runner_up = std::max(match.runner_up, other.quality);
    }
    return match;
  }

 private:
  static bool within(const SearchWindow& window, const Pose2& guess, const Pose2& pose) {
    return std::abs(pose.x() - guess.x()) <= window.x + kExploring &&
           std::abs(pose.y() - guess.y()) <= window.y + kExploring;
  }

  const ScanMatcher& matcher_;
  const SurfaceScan& earlier_;
  const SurfaceScan& later_;
  PointToLine point_to_line_;
  double tolerance_;
  std::vector<Refined> refined_;
};

ScanMatch ScanMatcher::search(const SurfaceScan& earlier, const SurfaceScan& later,
                              const Pose2& guess, const SearchWindow& window) const {
  Search search(*this, earlier, later);
  for (const Candidate& candidate : Correlation(earlier, window).search(later, guess))
    search.add(candidate.pose);
  if (search.empty()) return {};
  ScanMatch match = search.finish(guess, window);
  match.verdict = judge(match);
  return match;
}

}  // namespace cairn::icp
