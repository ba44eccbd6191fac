// SPDX-License-Identifier: BSD-3-Clause
#include "icp.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/exploration/laser_scan.hpp"
#include "cairn/geometry/motion.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/runtime/error.hpp"
#include "scan_matcher.hpp"
#include "scans_by_pose.hpp"

namespace cairn::icp {
namespace {

/// How far the truth may be from what is expected, in standard deviations.
constexpr double kWithin = 3.0;
/// What may be further off is searched for first [m, rad].
constexpr double kPoorDistance = 0.3, kPoorAngle = 0.1745;

/// Between the scans that were taken at two poses, as a factor EDGE_SE2. Where there is no scan of
/// a pose, as of one that was not kept or of an earlier session, there is no match.
class Icp final : public Registration, public ScanRegistration {
 public:
  Icp(const ScanMatcherOptions& options, Registry& registry)
      : matcher_(options),
        group_(registry.variable_type("VERTEX_SE2")),
        edge_(registry.factor_type("EDGE_SE2")) {}

  void begin(const RegistrationData&) override {}

  void take(Id pose, LaserScan scan) override { scans_.take(pose, matcher_.prepare(scan)); }
  void pose_ended(Id pose, bool kept) override { scans_.pose_ended(pose, kept); }

  std::vector<Factor> match(Id earlier, Id later) override {
    return measure(earlier, later, Pose2::identity(), matcher_.options().window);
  }

  std::vector<Factor> match_proposed(const MatchProposal& proposal) override {
    const Motion& expected = proposal.expected;
    if (expected.mean.empty()) return match(proposal.earlier, proposal.later);
    if (expected.mean.size() != 3 || expected.covariance.size() != 9) {
      throw Error(ErrorCode::usage,
                  "registration icp: matches planar poses (VERTEX_SE2); a relative pose of " +
                      std::to_string(expected.mean.size()) + " numbers is expected between " +
                      std::to_string(proposal.earlier) + " and " + std::to_string(proposal.later));
    }
    return measure(proposal.earlier, proposal.later, Pose2::from_state(expected.mean),
                   window_of(expected));
  }

  void* ability(std::string_view name) override {
    return name == ScanRegistration::kAbility ? static_cast<ScanRegistration*>(this) : nullptr;
  }

 private:
  /// As wide as the expected covariance, but no wider than the options allow.
  SearchWindow window_of(const Motion& expected) const {
    const Eigen::Map<const Eigen::Matrix3d> covariance(expected.covariance.data());
    const Eigen::Matrix2d R =
        Se2::rotation(Eigen::Map<const Eigen::Vector3d>(expected.mean.data()));
    const Eigen::Matrix2d position = R * covariance.topLeftCorner<2, 2>() * R.transpose();
    // A variance that is no number or infinite leaves the whole window.
    const auto reach = [](double variance, double most) {
      const double within = kWithin * std::sqrt(variance);
      return within < most ? within : most;
    };
    const SearchWindow& most = matcher_.options().window;
    return {.x = reach(position(0, 0), most.x),
            .y = reach(position(1, 1), most.y),
            .angle = reach(covariance(2, 2), most.angle)};
  }

  static bool poor(const SearchWindow& window) {
    return std::max(window.x, window.y) > kPoorDistance || window.angle > kPoorAngle;
  }

  std::vector<Factor> measure(Id earlier, Id later, const Pose2& guess,
                              const SearchWindow& window) const {
    const SurfaceScan *const from = scans_.find(earlier), *const to = scans_.find(later);
    if (earlier == later || !from || !to) return {};
    const ScanMatch found = poor(window) ? matcher_.search(*from, *to, guess, window)
                                         : matcher_.refine(*from, *to, guess);
    if (!found.accepted()) return {};
    const std::span<const double> z = found.pose, sigma(found.covariance.data(), 9);
    return {group_.to_factor(
        edge_, earlier, later,
        {.mean = {z.begin(), z.end()}, .covariance = {sigma.begin(), sigma.end()}})};
  }

  ScanMatcher matcher_;
  MotionGroup group_;
  std::shared_ptr<const FactorType> edge_;
  ScansByPose<SurfaceScan> scans_;
};

}  // namespace

std::unique_ptr<Registration> make_icp(const ScanMatcherOptions& options, Registry& registry) {
  return std::make_unique<Icp>(options, registry);
}

}  // namespace cairn::icp
