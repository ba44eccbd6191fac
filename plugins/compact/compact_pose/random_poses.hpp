// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cairn/plugin/option_fields.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "compact_graph.hpp"

namespace cairn::compact {

/// What is drawn first.
enum class Draw {
  loops,  ///< loop closures, which keep the poses at their ends; then more poses
  poses   ///< poses; then loop closures of those between them
};
constexpr auto enum_names(Draw) {
  return std::to_array<EnumName<Draw>>({{Draw::loops, "loops"}, {Draw::poses, "poses"}});
}

/// Options of the pose policy `random_poses`.
struct RandomPosesOptions {
  int poses = 100;  ///< kept, the first and the last among them
  int loops = 10;   ///< loop closures used
  Draw draw = Draw::loops;
  std::uint64_t seed = 1;  ///< of the draw
  std::string estimator = "incremental_cholesky";

  static auto fields() {
    using O = RandomPosesOptions;
    return OptionFields<O>()
        .integer("poses", &O::poses, 2, 1e9, "kept, the first and the last among them")
        .integer("loops", &O::loops, 0, 1e9,
                 "loop closures used, if there are so many between those")
        .choice("draw", &O::draw,
                "what is drawn first: loop closures, with the poses at their ends, or poses, and "
                "then loop closures between those")
        .integer("seed", &O::seed, 0, 1e15, "of the draw")
        .component<Estimator>("estimator", &O::estimator, "estimator");
  }
};

/// The control: as many poses and loop closures of a recording as another policy keeps, drawn at
/// random (RFPFL of the paper), in one of two ways.
///
/// `Draw::loops` draws loop closures, each as likely as any other, and keeps their poses as far as
/// there is room for them; then more poses, and loop closures between those until there are enough.
/// No loop closure is lost for want of its poses.
///
/// `Draw::poses` is how the authors' program draws: poses, each as likely as any other; then loop
/// closures between two that are kept. Of the loop closures of a recording only the share
/// (poses kept / poses)² survives, so there may be fewer than asked for.
class RandomPoses final : public PosePolicy {
 public:
  RandomPoses(std::unique_ptr<Estimator> estimator, const RandomPosesOptions& options);

  void expect(const Graph& recording, std::span<const Arrival> poses) override;
  void add_pose(const Variable& pose, std::span<const Factor> odometry) override;
  std::optional<MatchProposal> next_match() override;
  LinkReport offer(Id other, std::span<const Factor> measured) override;
  /// In the graph if the pose is kept; the first one only if it determines where the graph is.
  PriorReport offer_prior(const Factor& measured) override;
  PoseReport end_pose() override;
  bool finish() override;

  Estimator& estimator() override { return graph_.estimator(); }
  std::vector<Id> kept() const override { return graph_.kept().ids(); }
  int factor_count() const override { return graph_.factor_count(); }
  std::vector<double> newest_state() const override;
  const std::vector<OdometryChain>& chains() const override { return graph_.chains(); }

 private:
  using Pair = std::pair<Id, Id>;

  void draw_loops_first(std::vector<Pair> pairs, std::vector<Id> poses);
  void draw_poses_first(std::vector<Pair> pairs, std::vector<Id> poses);

  RandomPosesOptions options_;
  CompactGraph graph_;
  std::set<Id> kept_;                     ///< the plan
  std::map<Id, std::vector<Id>> linked_;  ///< by later pose the earlier ones
  PoseReport report_;
  std::vector<Id> to_match_;
};

}  // namespace cairn::compact
