// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "compact_pose.hpp"
#include "random_poses.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::compact;
  registrar.add<PosePolicy, CompactPoseOptions>(
      "compact_pose", [](const CompactPoseOptions& options, Registry& registry) {
        return std::make_unique<CompactPose>(registry.make<Estimator>(options.estimator), options);
      });
  registrar.add<PosePolicy, RandomPosesOptions>(
      "random_poses", [](const RandomPosesOptions& options, Registry& registry) {
        return std::make_unique<RandomPoses>(registry.make<Estimator>(options.estimator), options);
      });
}
