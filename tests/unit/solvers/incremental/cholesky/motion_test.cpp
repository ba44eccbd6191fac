// SPDX-License-Identifier: BSD-3-Clause
// What moving as a whole does: a chain whose far part is carried along by a loop at its beginning.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "cairn/graph/graph.hpp"
#include "dense.hpp"
#include "factorization.hpp"
#include "growing_graph.hpp"
#include "models.hpp"
#include "states.hpp"
#include "substitution.hpp"
#include "tree.hpp"

namespace cairn::incremental {
namespace {

/// Those up to kLast are ordered last, and what follows hangs below.
constexpr int kPoses = 120, kLoop = 12, kLast = 20;

/// Poses that are where their odometry has them, but for a loop from pose 2 to pose kLoop that says
/// otherwise; the first is held. Beyond the loop each is joined with the one before the last as
/// well, so that separators have two variables. Linearised once.
class Chain {
 public:
  Chain(const GrowingTypes& types, bool prior_at_the_end = false)
      : type_(types.pose), tree_(*kernel_sets().back()) {
    const auto tangent = static_cast<std::size_t>(type_->tangent_size());
    std::vector<double> delta(tangent, 0.0), x(static_cast<std::size_t>(type_->ambient_size()));
    delta.front() = 1.0;
    delta.back() = 0.15;
    std::vector<double> step(x.size());
    type_->lie_group()->exp(delta.data(), step.data());
    type_->identity(x.data());
    for (int k = 0; k < kPoses; ++k) {
      graph_.add_variable(type_, k, x);
      states_.add(type_, graph_.state(k));
      system_.add_variable(type_->tangent_size());
      tree_.add_variable();
      held_.push_back(k == 0);
      type_->lie_group()->compose(x.data(), step.data(), x.data());
    }
    tree_.bind(1, 1);  // by its factor to the first
    for (int k = 1; k < kPoses; ++k) add(types.relative_pose, {k - 1, k}, between(k - 1, k));
    for (int k = kLoop + 2; k < kPoses; ++k)
      add(types.relative_pose, {k - 2, k}, between(k - 2, k));
    std::vector<double> off = between(2, kLoop), bend(tangent, 0.0), turned(x.size());
    bend.front() = 0.2;
    bend.back() = 0.3;
    type_->lie_group()->exp(bend.data(), step.data());
    type_->lie_group()->compose(off.data(), step.data(), turned.data());
    add(types.relative_pose, {2, kLoop}, turned);
    if (prior_at_the_end) {
      const auto last = graph_.state(kPoses - 1);
      add(types.pose_prior, {kPoses - 1}, {last.begin(), last.end()});
      tree_.bind(kPoses - 1, 1);
    }
    std::vector<std::int64_t> touched_at(kPoses, 0);
    std::fill_n(touched_at.begin(), kLast + 1, 1);
    for (int k = 1; k < kPoses; ++k) tree_.touch(k);
    tree_.restructure(system_, {touched_at, 1, {}});
    EXPECT_EQ(Factorization().compute(system_, tree_), -1);
  }
  Chain(const Chain&) = delete;
  Chain& operator=(const Chain&) = delete;

  /// Solves and moves; returns how many steps were computed.
  std::size_t solve(double tolerance) {
    for (int v = 1; v < kPoses; ++v) {
      models_.right_hand_side(system_, states_, v);
      system_.mark_solved(v);
      if (std::any_of(system_.g(v), system_.g(v) + system_.size(v),
                      [](double g) { return std::abs(g) > 1e-9; }))
        sources_.push_back(v);
    }
    steps_.values.resize(static_cast<std::size_t>(system_.scalars()), 0.0);
    substitution_.solve(system_, tree_, states_, motions_, sources_, tolerance, steps_);
    sources_.clear();
    const std::size_t count = move();
    for (const Motions::Turn& turn : motions_.turns()) {
      for (int f = 0; f < models_.size(); ++f) {
        const auto below = [&](std::int32_t v) { return tree_.below(v, turn.node); };
        if (std::ranges::any_of(models_.variables(f), below))
          models_.move(f, turn.variable, motions_.turned_steps().data() + turn.step);
      }
    }
    return count;
  }
  /// What is owed everywhere.
  void follow_all() {
    for (int v = 1; v < kPoses; ++v) {
      substitution_.follow(system_, tree_, states_, motions_, v, steps_);
      move();
    }
  }
  std::size_t move() {
    const std::size_t count = steps_.changed.size();
    states_.move(steps_.changed, steps_.values.data());
    steps_.clear(system_);
    return count;
  }
  void undo() {
    states_.undo(
        [&](std::int32_t node, std::span<const double> lead) { motions_.undo(tree_, node, lead); });
  }
  /// Pulls once more, somewhere in the loop.
  void pull(double by) {
    for (int k = 0; k < system_.size(5); ++k) system_.pending(5)[k] = -by * (k + 1);
  }
  bool leads() const {
    return std::ranges::any_of(tree_.nodes(), [](const Node& node) { return !node.lead.empty(); });
  }
  /// Largest ‖local‖ from any state of this chain to that of another.
  double distance(const Chain& other) const {
    double largest = 0.0;
    for (int v = 0; v < kPoses; ++v) {
      std::vector<double> delta(static_cast<std::size_t>(type_->tangent_size()));
      type_->local(1, states_.x(v), other.states_.x(v), delta.data());
      largest =
          std::max(largest, Eigen::Map<Eigen::VectorXd>(delta.data(), std::ssize(delta)).norm());
    }
    return largest;
  }
  /// ‖Σ Jᵀ J (t − t₀)‖ over the factors of a variable: what steps have changed in its gradient, by
  /// the models.
  double change_of_gradient(std::int32_t variable) const {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(type_->tangent_size());
    for (int f = 0; f < models_.size(); ++f) {
      const auto variables = models_.variables(f);
      const auto at = std::ranges::find(variables, variable);
      if (at == variables.end()) continue;
      const Eigen::Index rows = models_.rows(f);
      const double* J = models_.jacobian(f) + (at - variables.begin()) * rows * sum.size();
      const Eigen::Map<const Eigen::VectorXd> change(models_.change(f, states_), rows);
      sum += Eigen::Map<const Eigen::MatrixXd>(J, rows, sum.size()).transpose() * change;
    }
    return sum.norm();
  }
  bool turns() const { return !motions_.turns().empty(); }
  const double* travelled(std::int32_t v) const { return states_.travelled(v); }
  void settle(std::int32_t v) { motions_.settle(tree_, states_, v); }
  void settle_all() { motions_.settle_all(tree_, states_); }
  const Tree& tree() const { return tree_; }
  States& states() { return states_; }

 private:
  std::vector<double> between(int a, int b) const {
    std::vector<double> z(static_cast<std::size_t>(type_->ambient_size()));
    type_->lie_group()->inverse(states_.x(a), z.data());
    type_->lie_group()->compose(z.data(), states_.x(b), z.data());
    return z;
  }
  void add(const std::shared_ptr<const FactorType>& type, const std::vector<int>& variables,
           const std::vector<double>& z) {
    const int n = type->residual_size();
    std::vector<double> information;
    for (int row = 0; row < n; ++row) {
      for (int column = row; column < n; ++column) information.push_back(100.0 * (row == column));
    }
    const int f = graph_.add_factor(type, variables, z, information);
    models_.add(graph_, f);
    models_.linearize(f, graph_, states_);
    if (variables.size() == 2 && !held_[static_cast<std::size_t>(variables[0])])
      system_.connect(variables[0], variables[1]);
    models_.add_to(system_, states_, f, 1.0, held_);
  }

  std::shared_ptr<const VariableType> type_;
  Graph graph_;
  System system_;
  States states_;
  Models models_;
  std::vector<std::uint8_t> held_;
  Tree tree_;
  Substitution substitution_;
  Motions motions_;
  std::vector<std::int32_t> sources_;
  Steps steps_;
};

class MovingAsAWhole : public testing::TestWithParam<bool> {
 protected:
  GrowingTypes types_ = GetParam() ? spatial_types() : planar_types();
};

TEST_P(MovingAsAWhole, IsWhatSolvingEverythingComesTo) {
  Chain start(types_), exact(types_), moved(types_);
  EXPECT_EQ(exact.solve(0.0), std::size_t{kPoses - 1});
  EXPECT_LT(moved.solve(1e-6), std::size_t{kPoses - 1} / 2);
  EXPECT_TRUE(moved.leads());
  EXPECT_GT(moved.distance(exact), 1.0) << "what hangs below has not been moved yet";
  moved.settle_all();
  EXPECT_FALSE(moved.leads());
  EXPECT_GT(start.distance(exact), 1.0);
  EXPECT_LT(moved.distance(exact), 1e-2);
  moved.follow_all();
  EXPECT_LT(moved.distance(exact), 1e-5);
}

TEST_P(MovingAsAWhole, AddsUpOverManySteps) {
  Chain exact(types_), moved(types_);
  for (int k = 0; k < 20; ++k) {
    const double by = k % 3 - 0.6;
    for (Chain* chain : {&exact, &moved}) chain->pull(by);
    exact.solve(0.0);
    moved.solve(1e-6);
    if (k % 5 == 2) moved.settle(kPoses / 2 + k);
  }
  EXPECT_TRUE(moved.leads());
  moved.settle_all();
  EXPECT_LT(moved.distance(exact), 2e-2);
  moved.follow_all();
  EXPECT_LT(moved.distance(exact), 1e-4);
}

TEST_P(MovingAsAWhole, SettlesAVariableAndWhatIsAboveIt) {
  Chain all(types_), one(types_);
  for (Chain* chain : {&all, &one}) chain->solve(1e-6);
  all.settle_all();
  for (const int v : {kPoses - 1, 20, 5, kPoses / 2}) {
    one.settle(v);
    const std::size_t ambient = static_cast<std::size_t>(one.states().ambient(v));
    EXPECT_EQ(std::vector(one.states().x(v), one.states().x(v) + ambient),
              std::vector(all.states().x(v), all.states().x(v) + ambient));
  }
}

TEST_P(MovingAsAWhole, CanBeUndone) {
  Chain start(types_), chain(types_);
  chain.states().remember();
  chain.solve(1e-6);
  chain.settle(kLast + 1);
  EXPECT_TRUE(chain.leads());
  chain.undo();
  EXPECT_FALSE(chain.leads());
  EXPECT_EQ(chain.distance(start), 0.0);
  chain.settle_all();
  EXPECT_EQ(chain.distance(start), 0.0);

  // And if there was a motion before, then that remains.
  Chain twice(types_), once(types_);
  once.solve(1e-6);
  twice.solve(1e-6);
  twice.states().remember();
  twice.pull(1.0);
  twice.solve(1e-6);
  twice.settle(kLast + 1);
  twice.undo();
  twice.settle_all();
  once.settle_all();
  EXPECT_LT(twice.distance(once), 1e-12);
}

/// Beyond the loop measurements agree with each other, so that no step changes a gradient there, if
/// all that is owed is counted: the same bits of it as the states have moved by.
TEST_P(MovingAsAWhole, ChangesNoGradientByTheModels) {
  Chain chain(types_);
  chain.solve(1e-6);
  ASSERT_TRUE(chain.turns()) << "the motion is so small that it turns nothing";
  chain.settle_all();
  chain.follow_all();
  for (std::int32_t v = kLast + 1; v < kPoses; ++v) {
    EXPECT_GT(std::abs(*chain.travelled(v)), 1e-3);
    EXPECT_LT(chain.change_of_gradient(v), 1e-8) << "at pose " << v;
  }
}

/// However far a variable has been, and come back from by being undone.
TEST_P(MovingAsAWhole, WhatHasTravelledIsCountedFromTheFrame) {
  Chain chain(types_);
  chain.states().remember();
  chain.solve(0.0);
  EXPECT_NE(*chain.travelled(5), 0.0);
  chain.undo();
  chain.states().put_frame_here(5);
  EXPECT_EQ(*chain.travelled(5), 0.0);
}

TEST_P(MovingAsAWhole, IsNotForWhatIsTiedToTheWorld) {
  Chain tied(types_, true), exact(types_, true);
  for (std::int32_t n = tied.tree().node_of(kPoses - 1); n >= 0;) {
    const Node& node = tied.tree().nodes()[static_cast<std::size_t>(n)];
    EXPECT_FALSE(node.movable);
    n = node.parent;
  }
  tied.solve(1e-6);
  exact.solve(0.0);
  tied.settle_all();
  EXPECT_LT(tied.distance(exact), 1e-2);
}

INSTANTIATE_TEST_SUITE_P(Chains, MovingAsAWhole, testing::Bool(), [](const auto& spatial) {
  return std::string(spatial.param ? "InSpace" : "InThePlane");
});

}  // namespace
}  // namespace cairn::incremental
