// SPDX-License-Identifier: BSD-3-Clause
// The registration `mrpt_icp`: scan matching by MRPT, to compare `icp` with.
#include <cmath>
#include <cstddef>
#include <memory>
#include <string_view>
#include <vector>

#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/poses/CPosePDFGaussian.h>
#include <mrpt/slam/CICP.h>
#include <Eigen/Cholesky>

#include "cairn/exploration/laser_scan.hpp"
#include "cairn/geometry/motion.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/registration.hpp"
#include "cairn/runtime/error.hpp"
#include "scans_by_pose.hpp"

namespace cairn::icp {
namespace {

using mrpt::maps::CSimplePointsMap;
using mrpt::slam::CICP;

/// Those of mrpt::slam::CICP, and the last, which it does not have. The defaults are those of a few
/// that were tried with which most matches are right where the guess is off by up to 1 m and 0.35
/// rad; with those of CICP fewer are on most floors, and several times as many wrong.
struct MrptIcpOptions {
  int iterations = 200;
  double distance = 1.5;            ///< between points that are paired, at first [m]
  double smallest_distance = 0.05;  ///< and at the end [m]
  double angle = 0.1;               ///< by which that grows with the range of a point [rad]
  double shrink = 0.5;              ///< factor on these whenever the iterations have converged
  int every = 1;                    ///< so many points one is used of
  double least_goodness = 0.8;      ///< part of the points that have a partner

  static OptionFields<MrptIcpOptions> fields() {
    using O = MrptIcpOptions;
    return OptionFields<O>()
        .integer("iterations", &O::iterations, 1, 100000, "maximum number of iterations")
        .real("distance", &O::distance, 1e-3, 100.0,
              "largest distance between points that are paired, at first [m]")
        .real("smallest_distance", &O::smallest_distance, 1e-3, 100.0, "and at the end [m]")
        .real("angle", &O::angle, 0.0, 3.15,
              "by which these distances grow with the range of a point [rad]")
        .real("shrink", &O::shrink, 0.01, 0.99,
              "factor on the distances whenever the iterations have converged")
        .integer("every", &O::every, 1, 1000, "of so many points one is used")
        .real("least_goodness", &O::least_goodness, 0.0, 1.0,
              "least fraction of the points that have a partner, or the match is rejected");
  }
};

CICP::TConfigParams parameters(const MrptIcpOptions& options) {
  CICP::TConfigParams result;
  result.maxIterations = static_cast<unsigned>(options.iterations);
  result.thresholdDist = options.distance;
  result.smallestThresholdDist = options.smallest_distance;
  result.thresholdAng = options.angle;
  result.ALFA = options.shrink;
  result.corresponding_points_decimation = static_cast<unsigned>(options.every);
  return result;
}

/// The points at which the beams of a scan end.
CSimplePointsMap points_of(const LaserScan& scan) {
  CSimplePointsMap points;
  for (std::size_t beam = 0; beam < scan.ranges.size(); ++beam) {
    const double range = scan.ranges[beam], angle = scan.angle(beam);
    if (range > 0.0 && range < scan.max_range)
      points.insertPoint(static_cast<float>(range * std::cos(angle)),
                         static_cast<float>(range * std::sin(angle)));
  }
  return points;
}

class MrptIcp final : public Registration, public ScanRegistration {
 public:
  MrptIcp(const MrptIcpOptions& options, Registry& registry)
      : icp_(parameters(options)),
        least_goodness_(options.least_goodness),
        group_(registry.variable_type("VERTEX_SE2")),
        edge_(registry.factor_type("EDGE_SE2")) {}

  void begin(const RegistrationData&) override {}
  void take(Id pose, LaserScan scan) override { scans_.take(pose, points_of(scan)); }
  void pose_ended(Id pose, bool kept) override { scans_.pose_ended(pose, kept); }

  std::vector<Factor> match(Id earlier, Id later) override { return measure(earlier, later, {}); }
  std::vector<Factor> match_proposed(const MatchProposal& proposal) override {
    const std::vector<double>& mean = proposal.expected.mean;
    if (mean.empty()) return match(proposal.earlier, proposal.later);
    if (mean.size() != 3)
      throw Error(ErrorCode::usage, "registration mrpt_icp: matches planar poses (VERTEX_SE2)");
    return measure(proposal.earlier, proposal.later, {mean[0], mean[1], mean[2]});
  }

  void* ability(std::string_view name) override {
    return name == ScanRegistration::kAbility ? static_cast<ScanRegistration*>(this) : nullptr;
  }

 private:
  std::vector<Factor> measure(Id earlier, Id later, const mrpt::poses::CPose2D& guess) {
    const CSimplePointsMap *const from = scans_.find(earlier), *const to = scans_.find(later);
    if (earlier == later || !from || !to || from->empty() || to->empty()) return {};
    CICP::TReturnInfo info;
    const auto found = icp_.Align(from, to, guess, info);
    if (!found || info.goodness < least_goodness_) return {};
    const auto [Sigma, mean] = found->getCovarianceAndMean();
    // MRPT's is of x, y and the heading in the frame of the earlier pose; ours of ξ, z exp(ξ).
    const double c = std::cos(mean.phi()), s = std::sin(mean.phi());
    Eigen::Matrix3d to_local;
    to_local << c, s, 0, -s, c, 0, 0, 0, 1;
    const Eigen::Matrix3d covariance = to_local * Sigma.asEigen() * to_local.transpose();
    if (!covariance.allFinite() || covariance.llt().info() != Eigen::Success) return {};
    return {group_.to_factor(edge_, earlier, later,
                             {.mean = {mean.x(), mean.y(), mean.phi()},
                              .covariance = {covariance.data(), covariance.data() + 9}})};
  }

  CICP icp_;
  double least_goodness_;
  MotionGroup group_;
  std::shared_ptr<const FactorType> edge_;
  ScansByPose<CSimplePointsMap> scans_;
};

std::unique_ptr<Registration> make_mrpt_icp(const MrptIcpOptions& options, Registry& registry) {
  return std::make_unique<MrptIcp>(options, registry);
}

}  // namespace
}  // namespace cairn::icp

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::Registration, cairn::icp::MrptIcpOptions>("mrpt_icp",
                                                                 cairn::icp::make_mrpt_icp);
}
