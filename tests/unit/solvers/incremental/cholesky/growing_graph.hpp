// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "engine.hpp"

namespace cairn::incremental {

/// The types of small graphs in the plane or in space, differentiated automatically.
struct GrowingTypes {
  std::shared_ptr<const VariableType> pose, point;
  std::shared_ptr<const FactorType> relative_pose, pose_prior, point_seen;
};
GrowingTypes planar_types();
GrowingTypes spatial_types();

/// What may happen to a graph besides odometry and loop closures.
struct Happenings {
  bool points = false;   ///< landmarks come into sight, and leave
  bool cuts = false;     ///< new components, and anything may be removed; not with points
  bool priors = false;   ///< priors and fixed variables
  double noise = 0.03;   ///< of all measurements [m, rad]
  bool compacts = true;  ///< what has been removed leaves the arrays once it is most of them
};

/// A random walk, what is measured on it, and an engine that is told, at random but for the seed.
/// H is not singular at any time.
class GrowingGraph {
 public:
  GrowingGraph(GrowingTypes types, const Happenings& happenings, unsigned seed)
      : types_(std::move(types)), happenings_(happenings), rng_(seed) {}

  /// One change; what comes of it is not solved for.
  void grow(Engine& engine);
  void add_pose(Engine& engine);
  void add_loop(Engine& engine);
  /// From the newest pose to the one that is so many poses older, if there is one.
  void add_loop_back(Engine& engine, std::size_t poses);
  /// From the first pose to the newest, as the estimate has it, with so many times the information
  /// that others have.
  void add_precise_loop(Engine& engine, double more);
  /// What was done, for a failure's message.
  const std::string& log() const { return log_; }

 private:
  using State = std::vector<double>;
  struct Variable {
    Id id;
    State truth;
  };

  void add_point(Engine& engine);
  void add_prior(Engine& engine);
  void change_measurement(Engine& engine);
  void remove(Engine& engine);
  void remove_factor(Engine& engine, int f);
  void remove_variable(Engine& engine, std::vector<Variable>& variables);
  int add_variable(Engine& engine, const std::shared_ptr<const VariableType>& type, const State& x,
                   bool fixed);
  void add_factor(Engine& engine, const std::shared_ptr<const FactorType>& type,
                  std::initializer_list<int> variables, const State& z,
                  double information_factor = 1.0);
  State exp(std::span<const double> delta) const;
  State compose(const State& a, const State& b) const;
  State between(const State& a, const State& b) const;
  State noisy(const State& pose);
  State seen(const State& pose, const State& point);
  const Variable& any(const std::vector<Variable>& variables) {
    return variables[rng_() % variables.size()];
  }
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(rng_);
  }
  bool chance(double probability) { return uniform(0.0, 1.0) < probability; }

  GrowingTypes types_;
  Happenings happenings_;
  std::mt19937 rng_;
  std::vector<Variable> poses_, points_;
  std::vector<FactorId> loops_;
  Id next_id_ = 0;
  std::string log_;
};

}  // namespace cairn::incremental
