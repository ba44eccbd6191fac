// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/scan_slam.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include "cairn/runtime/timed.hpp"
#include "cairn/typed/build.hpp"
#include "scan_poses.hpp"

namespace cairn {

ScanSlam::ScanSlam(const ScanSlamParts& parts)
    : parts_(parts), places_(std::make_unique<ScanPoses>()) {}
ScanSlam::~ScanSlam() = default;

std::span<const Pose2> ScanSlam::poses() const { return places_->all(); }

void ScanSlam::begin(const Pose2& at, LaserScan scan, const OdometryModel& odometry,
                     const Pose2& typical, const std::optional<Pose2>& truth) {
  sample_.add(make_variable(0, Pose2(), parts_.registry));
  sample_.add(make_variable(1, typical, parts_.registry));
  sample_.add(make_factor(Between(0, 1, typical),
                          Information::covariance(odometry.covariance(typical)), nullptr,
                          parts_.registry));
  parts_.registration.begin({.recording = &sample_, .truth = truth ? &truth_ : nullptr});
  scans_to_ = query<ScanRegistration>(parts_.registration);
  Variable first = make_variable(0, at, parts_.registry);
  first.fixed = true;
  take(first, {}, std::move(scan), truth);
}

void ScanSlam::add(const Pose2& odometry, const Eigen::Matrix3d& covariance, LaserScan scan,
                   const std::optional<Pose2>& truth) {
  const auto id = static_cast<Id>(scans_.size());
  const std::array factors{make_factor(Between(id - 1, id, odometry),
                                       Information::covariance(covariance), nullptr,
                                       parts_.registry)};
  take(make_variable<Pose2>(id, parts_.registry), factors, std::move(scan), truth);
}

void ScanSlam::take(const Variable& pose, std::span<const Factor> odometry, LaserScan scan,
                    const std::optional<Pose2>& truth) {
  if (truth) truth_.add(make_variable(pose.id, *truth, parts_.registry));
  if (scans_to_) scans_to_->take(pose.id, scan);
  scans_.push_back(scan);
  const auto began = std::chrono::steady_clock::now();
  const PoseReport report = process_pose(pose, odometry, parts_.policy, parts_.registration);
  counts_.policy_seconds += report.seconds.total;
  counts_.registration_seconds += seconds_since(began) - report.seconds.total;
  const int before = counts_.loops;
  count(report);
  places_->add(report, parts_.policy);
  const Timed timed(counts_.map_seconds);
  parts_.mapper.add(poses().back(), std::move(scan));
  if (counts_.loops > before) follow_estimate();
  estimate_ = poses().back();
}

void ScanSlam::count(const PoseReport& report) {
  for (const LinkReport& link : report.links) {
    ++counts_.proposed;
    counts_.registered += link.verdict != LinkVerdict::unmatched;
    counts_.loops += link.verdict == LinkVerdict::linked;
  }
  for (const std::string& note : report.notes) {
    if (std::ranges::find(counts_.notes, note) == counts_.notes.end())
      counts_.notes.push_back(note);
  }
}

void ScanSlam::follow_estimate() {
  places_->update(parts_.policy);
  counts_.rebuilt += parts_.mapper.move(poses());
}

const FloorMap& ScanSlam::map() {
  const Timed timed(counts_.map_seconds);
  return parts_.mapper.map();
}

bool ScanSlam::finish() {
  const bool converged = parts_.policy.finish();
  follow_estimate();
  estimate_ = poses().back();
  return converged;
}

}  // namespace cairn
