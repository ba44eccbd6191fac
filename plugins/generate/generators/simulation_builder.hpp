// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "loops.hpp"
#include "noise.hpp"
#include "rigid.hpp"

namespace cairn::generate {

/// Measures a path and its loop closures and puts the graph together in the order in which a robot
/// would: pose, odometry, its loop closures, next pose.
///
/// A measurement of x = x_i⁻¹ x_j is z = x · n⁻¹, n = (translation, exp(rotation vector)) normal
/// with the covariance of `Noise`: the residual z⁻¹ x at the truth is n itself, in the metric of
/// SE(2) and in the `rotation_vector` metric of SE(3); with the full logarithm it differs in second
/// order. The information is the inverse of that covariance.
template <class Pose>
class SimulationBuilder {
 public:
  SimulationBuilder(Registry& types, const Noise& noise, std::uint64_t seed, std::size_t poses,
                    std::size_t factors);

  /// The next pose of the path at its true state; measured by odometry, and guessed from it. The
  /// first one is known.
  void add_pose(const Pose& truth);
  void add_loop(const Loop& loop);
  /// A loop closure that says `claimed` where it is anything else, weighted like a right one.
  void add_wrong_loop(const Loop& loop, const Pose& claimed);

  int poses() const { return static_cast<int>(truth_.size()); }
  const Pose& truth(int pose) const { return truth_[pose]; }
  const Pose& estimate(int pose) const { return estimate_[pose]; }
  Graph& graph() { return graph_; }
  /// For states that differ from the estimate: the true state of a variable that is not a pose.
  void set_truth(int variable, std::vector<double> state);

  Simulation finish();

 private:
  /// `noisier`: factor on the noise.
  Pose measure(const Pose& motion, double noisier);
  void add_factor(int from, int to, const Pose& measured, const Pose& motion, double noisier);

  Noise noise_;
  Random random_;
  std::shared_ptr<const VariableType> variable_;
  std::shared_ptr<const FactorType> factor_;
  std::vector<Pose> truth_, estimate_;
  std::vector<int> variable_of_pose_;
  std::vector<std::pair<int, std::vector<double>>> other_truth_;
  Graph graph_;
};

/// The wrong loop closures of a simulation: pairs of poses that are far apart, claimed to be near.
struct Outliers {
  std::int64_t count = 0;
  double reach =
      1.0;  ///< claimed translations stay below [m]; the true ones are three times as long
};

/// The whole simulation of a path with loop closures (by rising `later`) and wrong ones between
/// them. Throws `Error` (usage) where the world is too small for wrong loop closures.
template <class Pose>
Simulation simulate(const std::vector<Pose>& path, const std::vector<Loop>& loops,
                    const Noise& noise, const Outliers& outliers, Registry& types,
                    std::uint64_t seed);

}  // namespace cairn::generate
