// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/solve/estimator.hpp"
#include "cairn/update/graph_update.hpp"
#include "support/planar_graph.hpp"

namespace cairn::test {

/// Drives an estimator through a random life on a small planar graph: poses and points come and go,
/// measurements arrive, change and are withdrawn, old variables are marginalised, copies are made
/// and go their own way. Beside it, the same is done to a plain graph. After every update, that
/// both hold the same variables and factors is expected; after one that solved everything, that the
/// estimate and the covariances are those of a dense solve of the estimator's graph.
///
/// Everything follows from the seed. Graphs are such that H is well conditioned at any time.
class RandomSequence {
 public:
  /// `smooths`: the estimator linearises again, and so is at the minimum after it solved
  /// everything.
  RandomSequence(Estimator& estimator, unsigned seed, bool smooths = true);
  void run(int updates);
  /// What was done, for a failure's message.
  std::string log() const { return log_; }

 private:
  struct Truth {
    bool pose;
    Eigen::Vector3d x;
  };

  void update_once();
  void propose(GraphUpdate& update);
  void add_pose(GraphUpdate& update, bool connected);
  void add_point(GraphUpdate& update);
  void add_between(GraphUpdate& update, Id a, Id b);
  void add_prior(GraphUpdate& update, Id a);
  void change_factor(GraphUpdate& update);
  Id random_variable(bool pose);
  std::vector<double> noisy(Eigen::VectorXd z);
  std::vector<double> measured(const Truth& a, const Truth& b);

  bool well_posed(const GraphUpdate& update) const;
  void refuse_bad_update();
  void what_if();
  void expect_same_graph(const Graph& estimated) const;
  void expect_solved();
  void expect_covariances(const Graph& graph);

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(rng_);
  }
  bool chance(double probability) { return uniform(0.0, 1.0) < probability; }

  Estimator& estimator_;
  std::mt19937 rng_;
  bool smooths_;
  bool ended_ = false;  ///< the graph beside it is not the same any more
  PlanarTypes types_;
  std::map<Id, Truth> truth_;  ///< of all variables ever
  Graph mirror_;
  FactorIds ids_;
  Id next_id_ = 0;
  Id last_pose_ = -1;
  std::string log_;
};

}  // namespace cairn::test
