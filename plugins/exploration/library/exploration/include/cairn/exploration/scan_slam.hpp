// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/exploration/laser_scan.hpp"
#include "cairn/exploration/world.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/policy/registration.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/typed/pose2.hpp"
#include "cairn/types/loss.hpp"

namespace cairn {

class OdometryScale;
class ScanPoses;

/// The parts of `ScanSlam`, which must outlive it.
struct ScanSlamParts {
  PosePolicy& policy;
  Registration& registration;
  Mapper& mapper;
  Registry& registry;  ///< of the types of poses and odometry
  /// Each scan is matched with the one before as well, which corrects odometry. How much odometry
  /// errs is learnt from these matches: the standard deviation of each component is scaled so
  /// that nine tenths of the differences are where they should be, since wheels slip. Where the two
  /// contradict each other nevertheless (beyond the quantile 0.999 of χ²), the motion is that of
  /// the match, with a covariance that admits odometry's.
  bool match_consecutive = false;
  /// Of loop closures: with a robust one a wrong match that others contradict does not bend the
  /// map. None: none.
  std::shared_ptr<const Loss> loop_loss = nullptr;
};

/// What `ScanSlam` counts, and the notes of its parts, each once.
struct ScanSlamCounts {
  int loops = 0, proposed = 0, registered = 0;
  int rebuilt = 0;  ///< times that scans were drawn again
  /// With `match_consecutive`: scans that matched the one before, and those of them that
  /// contradicted odometry.
  int consecutive = 0, contradicted = 0;
  double policy_seconds = 0.0, registration_seconds = 0.0, map_seconds = 0.0;
  std::vector<std::string> notes;
};

/// Pose graph and map from scans and odometry: each scan is a pose, the policy decides which poses
/// and loop closures are kept, the registration matches the scans, and the map follows the
/// estimate. Where the policy drops a pose its scan moves with the pose that was kept before it.
class CAIRN_API ScanSlam {
 public:
  explicit ScanSlam(const ScanSlamParts& parts);
  ScanSlam(const ScanSlam&) = delete;
  ScanSlam& operator=(const ScanSlam&) = delete;
  ~ScanSlam();

  /// The first scan, at a pose that is fixed. `typical`: a motion with its noise, from which a
  /// simulated registration takes its own; `truth`: given that the true poses are known, the first
  /// of them.
  void begin(const Pose2& at, LaserScan scan, const OdometryModel& odometry, const Pose2& typical,
             const std::optional<Pose2>& truth = {});
  /// The next scan, after a motion as odometry has measured it.
  void add(const Pose2& odometry, const Eigen::Matrix3d& covariance, LaserScan scan,
           const std::optional<Pose2>& truth = {});
  /// Solves everything to convergence; false if it has not converged.
  bool finish();

  const Pose2& pose() const { return estimate_; }  ///< the newest, as estimated
  /// Where each scan was taken, as estimated.
  std::span<const Pose2> poses() const;
  std::span<const LaserScan> scans() const { return scans_; }
  const FloorMap& map();
  const ScanSlamCounts& counts() const { return counts_; }
  /// The true poses, as far as they were given, by the ids of the graph.
  const Graph& truth() const { return truth_; }

 private:
  void take(const Variable& pose, std::span<const Factor> odometry, LaserScan scan);
  std::vector<Factor> matched_odometry(Id id, const Pose2& odometry,
                                       const Eigen::Matrix3d& covariance);
  void count(const PoseReport& report);
  void follow_estimate();

  ScanSlamParts parts_;
  ScanSlamCounts counts_;
  Graph sample_, truth_;
  ScanRegistration* scans_to_ = nullptr;
  std::vector<LaserScan> scans_;
  std::unique_ptr<ScanPoses> places_;
  std::unique_ptr<OdometryScale> scale_;
  Pose2 estimate_;
};

}  // namespace cairn
