// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <utility>

#include "cairn/plugin/registry.hpp"
#include "cairn/sparsification/map_sparsifier.hpp"
#include "compact_pose.hpp"
#include "random_poses.hpp"

namespace {

using namespace cairn;

/// What makes room for new poses; null: any number is kept.
std::unique_ptr<PoseRemover> pose_remover(const compact::CompactPoseOptions& options,
                                          Registry& registry) {
  if (options.keep == 0) return nullptr;
  auto remover = std::make_unique<MapSparsifier>(registry, parse_component(options.sparsifier),
                                                 parse_component(options.select));
  remover->prepare();  // it asks the registry for nothing later
  return remover;
}

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn::compact;
  registrar.add<PosePolicy, CompactPoseOptions>(
      "compact_pose", [](const CompactPoseOptions& options, Registry& registry) {
        return std::make_unique<CompactPose>(registry.make<Estimator>(options.estimator), options,
                                             pose_remover(options, registry));
      });
  registrar.add<PosePolicy, RandomPosesOptions>(
      "random_poses", [](const RandomPosesOptions& options, Registry& registry) {
        return std::make_unique<RandomPoses>(registry.make<Estimator>(options.estimator), options);
      });
}
