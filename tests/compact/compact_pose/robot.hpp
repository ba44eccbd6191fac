// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <Eigen/Core>

#include "cairn/plugin/registry.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/runtime/error.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {

/// What a call is refused with; fails the test where it is not, or with another code.
std::string message_of(const std::function<void()>& call, ErrorCode code);

/// Drives in the plane, knows where it truly is, and tells a policy.
class Robot {
 public:
  using Pose = test::PoseWorld::Pose;

  Robot(Registry& registry, const std::string& policy, unsigned seed = 1);
  PosePolicy& policy() { return *policy_; }
  const test::PoseWorld& world() const { return world_; }
  Id newest() const { return static_cast<Id>(truth_.size()) - 1; }

  /// Ends the newest pose and begins the next.
  PoseReport advance();
  void begin();
  /// From an earlier pose to the newest.
  Factor right(Id other, double sigma = 0.02);
  Factor wrong(Id other, const Pose& motion, double sigma = 0.02) const;
  LinkReport offer(const Factor& factor);
  double newest_error() const;  ///< from the truth [m, rad]

 private:
  Factor measured(Id from, Id to, const Pose& motion, const Eigen::MatrixXd& covariance);

  test::PoseWorld world_;
  std::unique_ptr<PosePolicy> policy_;
  test::Draw draw_;
  Pose step_{1.0, 0.0, 0.1};
  std::vector<Pose> truth_;
};

class CompactPoseTest : public testing::Test {
 protected:
  std::unique_ptr<PosePolicy> make(const std::string& options) {
    return registry.make<PosePolicy>("compact_pose:reuse=false," + options);
  }
  Registry registry;
};

}  // namespace cairn::compact
