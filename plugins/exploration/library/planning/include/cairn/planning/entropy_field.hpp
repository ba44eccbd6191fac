// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cairn/exploration/explorer.hpp"
#include "cairn/planning/configuration_space.hpp"
#include "cairn/planning/frontier_view.hpp"
#include "cairn/planning/joint_objective.hpp"
#include "cairn/planning/loop_closure_value.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

struct EntropyFieldOptions {
  int orientations = 72, directions = 360;
  double left = 0.0;  ///< H(p̂): entropy of a cell after it was discovered [nats]
  JointObjectiveOptions objective = {};

  static auto fields() {
    using O = EntropyFieldOptions;
    return OptionFields<O>()
        .integer("orientations", &O::orientations, 4, 720, "of the robot, for each cell")
        .integer("directions", &O::directions, 4, 2000, "of beams, in the full circle")
        .real("left", &O::left, 0.0, 0.6931,
              "entropy of a cell after it was discovered [nats]; of an unknown one it is ln 2")
        .part(&O::objective);
  }
};

/// How much the joint entropy of trajectory and map is expected to change if the robot turned up at
/// a configuration, whatever it meets on its path there, for all free configurations (entropy
/// decrease estimation, EDE: thesis, 5.3.1):
///
///     E(q) = ΔH(x)(q) + α ΔH(m)(q)
///
/// ΔH(x) is that of the most informative loop closure whose match area q lies in (5.7, 5.8), ΔH(m)
/// = −l² (ln 2 − H(p̂)) for each frontier cell that is seen from q (`FrontierView`), and α follows
/// from the covariance of the newest pose, with which the robot would turn up
/// (`JointObjective`, 5.4).
class CAIRN_API EntropyField {
 public:
  /// What is left out of a field.
  struct Parts {
    std::span<const BeamCell> cells = {};  ///< instead of `beam_cells` of the map
    bool loop_closures = true;
  };

  /// 8 bytes per configuration. Throws `Error` as `ConfigurationSpace` and `FrontierView` do.
  EntropyField(const Situation& situation, const EntropyFieldOptions& options, const Parts& parts);
  EntropyField(const Situation& situation, const EntropyFieldOptions& options)
      : EntropyField(situation, options, Parts{}) {}

  const ConfigurationSpace& space() const { return space_; }
  /// E [nats], by `ConfigurationSpace::index`; never above zero.
  double value(std::size_t configuration) const {
    return trajectory_[configuration] + alpha_ * cell_change_ * view_.seen(configuration);
  }
  /// The two parts of E.
  InformationChange change(std::size_t configuration) const {
    return {.trajectory = trajectory_[configuration],
            .map = cell_change_ * view_.seen(configuration),
            .alpha = alpha_};
  }
  /// Frontier cells seen from a configuration.
  double seen(std::size_t configuration) const { return view_.seen(configuration); }
  double alpha() const { return alpha_; }
  /// The loop closures that count, in the order of the trajectory.
  std::span<const LoopClosureValue> loop_closures() const { return loops_; }
  /// The configuration with the least E below zero of those in the cells that are marked, by
  /// `ConfigurationSpace::cells`; the first of several. None: there is none.
  std::optional<std::size_t> best(std::span<const char> cells) const;

 private:
  void write_match_areas(const MatchModel& match);

  ConfigurationSpace space_;
  FrontierView view_;
  std::vector<LoopClosureValue> loops_;
  std::vector<float> trajectory_;  ///< ΔH(x) [nats]
  double alpha_ = 1.0;
  double cell_change_ = 0.0;  ///< ΔH(m) of a frontier cell [nats·m²]
};

}  // namespace cairn
