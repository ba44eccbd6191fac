// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/scan_slam.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <string>
#include <utility>

#include <fmt/core.h>
#include <Eigen/LU>

#include "cairn/geometry/motion.hpp"
#include "cairn/runtime/timed.hpp"
#include "cairn/typed/build.hpp"
#include "cairn/update/rejected_factors.hpp"
#include "odometry_scale.hpp"
#include "scan_poses.hpp"

namespace cairn {
namespace {

/// Quantile 0.999 of χ² with 3 degrees of freedom.
constexpr double kContradiction = 16.27;
/// Wheels may slip by about this part of a motion, and by these [m, m, rad] in any case.
constexpr double kSlip = 0.3;
constexpr std::array kLeastSlip{0.05, 0.05, 0.05};

/// Where a scan is to be expected when wheels slip.
Motion within_slip(const Pose2& odometry, const Eigen::Matrix3d& covariance) {
  Eigen::Matrix3d slip = covariance;
  const double length = kSlip * odometry.translation().norm();
  const std::array motion{length, length, kSlip * std::abs(odometry.theta())};
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    slip(k, k) += motion[axis] * motion[axis] + kLeastSlip[axis] * kLeastSlip[axis];
  }
  return {{odometry.x(), odometry.y(), odometry.theta()}, {slip.data(), slip.data() + slip.size()}};
}

}  // namespace

ScanSlam::ScanSlam(const ScanSlamParts& parts)
    : parts_(parts),
      places_(std::make_unique<ScanPoses>()),
      scale_(std::make_unique<OdometryScale>()) {}
ScanSlam::~ScanSlam() = default;

std::span<const Pose2> ScanSlam::poses() const { return places_->all(); }

void ScanSlam::begin(const Pose2& at, LaserScan scan, const OdometryModel& odometry,
                     const Pose2& typical, const std::optional<Pose2>& truth) {
  check_scan(scan, "scan 0");
  sample_.add(make_variable(0, Pose2(), parts_.registry));
  sample_.add(make_variable(1, typical, parts_.registry));
  sample_.add(make_factor(Between(0, 1, typical),
                          Information::covariance(odometry.covariance(typical)), nullptr,
                          parts_.registry));
  parts_.registration.begin({.recording = &sample_, .truth = truth ? &truth_ : nullptr});
  scans_to_ = query<ScanRegistration>(parts_.registration);
  if (parts_.loop_loss)
    parts_.policy.estimator().set_loss(parts_.loop_loss, FactorSelector::loops());
  Variable first = make_variable(0, at, parts_.registry);
  first.fixed = true;
  if (truth) truth_.add(make_variable(first.id, *truth, parts_.registry));
  if (scans_to_) scans_to_->take(first.id, scan);
  take(first, {}, std::move(scan));
}

void ScanSlam::add(const Pose2& odometry, const Eigen::Matrix3d& covariance, LaserScan scan,
                   const std::optional<Pose2>& truth) {
  const auto id = static_cast<Id>(scans_.size());
  check_scan(scan, fmt::format("scan {}", id));
  if (truth) truth_.add(make_variable(id, *truth, parts_.registry));
  if (scans_to_) scans_to_->take(id, scan);
  take(make_variable<Pose2>(id, parts_.registry), matched_odometry(id, odometry, covariance),
       std::move(scan));
}

/// The motion to a pose whose scan the registration has.
std::vector<Factor> ScanSlam::matched_odometry(Id id, const Pose2& odometry,
                                               const Eigen::Matrix3d& covariance) {
  const auto factor = [&](const Pose2& motion, const Eigen::Matrix3d& noise) {
    return make_factor(Between(id - 1, id, motion), Information::covariance(noise), nullptr,
                       parts_.registry);
  };
  if (!parts_.match_consecutive) return {factor(odometry, covariance)};
  const Timed timed(counts_.registration_seconds);
  const std::vector<Factor> matches = parts_.registration.match_proposed(
      {.earlier = id - 1, .later = id, .expected = within_slip(odometry, covariance)});
  if (matches.empty()) return {factor(odometry, scale_->scaled(covariance))};
  ++counts_.consecutive;
  const Motion measured =
      MotionGroup(parts_.registry.variable_type("VERTEX_SE2")).of_factor(matches.front(), id - 1);
  const Pose2 match = Pose2::from_state(measured.mean);
  const Eigen::Matrix3d noise = Eigen::Map<const Eigen::Matrix3d>(measured.covariance.data());
  const Eigen::Vector3d apart = match.between(odometry).log();
  const Eigen::Matrix3d learnt = scale_->scaled(covariance), expected = learnt + noise;
  scale_->learn(apart, covariance, noise);
  if (apart.dot(expected.inverse() * apart) < kContradiction)
    return {factor(odometry, learnt), matches.front()};
  ++counts_.contradicted;
  return {factor(match, noise + apart * apart.transpose())};
}

void ScanSlam::take(const Variable& pose, std::span<const Factor> odometry, LaserScan scan) {
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
  const std::string rejected = in_words(rejected_factors(parts_.policy.estimator().graph()));
  if (!rejected.empty()) counts_.notes.push_back(rejected);
  return converged;
}

}  // namespace cairn
