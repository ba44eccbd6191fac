// SPDX-License-Identifier: BSD-3-Clause
#include "compact_graph.hpp"

#include <algorithm>
#include <limits>
#include <ostream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "cairn/runtime/error.hpp"
#include "support/dense_system.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::difference;
using test::Draw;
using test::numerical_jacobian;
using test::planar_types;
using test::PoseWorld;
using test::spatial_types;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using Pose = PoseWorld::Pose;

/// Which types, and in how much noise.
struct Setting {
  std::string name;
  int dimension;
  std::string metric;
  CompositionOrder order;
  double noise;  ///< part of the standard deviation that measurements are off
};

std::ostream& operator<<(std::ostream& out, const Setting& setting) { return out << setting.name; }

/// A compact graph, and beside it what it stands for: a graph in which all kept poses and the
/// newest are variables.
class Grown {
 public:
  Grown(const Setting& setting, unsigned seed, const std::string& estimator)
      : noise_(setting.noise),
        order_(setting.order),
        draw_(seed),
        world_(setting.dimension == 2 ? planar_types(registry_)
                                      : spatial_types(registry_, setting.metric)),
        graph_(registry_.make<Estimator>(estimator), setting.order) {
    truth_ = world_.random(draw_, 1.0, 1.0);
    graph_.start(world_.variable(0, truth_), seconds_);
    ways_.push_back({0, truth_});
  }

  CompactGraph& graph() { return graph_; }
  const PoseWorld& world() const { return world_; }
  Draw& draw() { return draw_; }
  Id newest() const { return next_ - 1; }

  void advance(bool fixed = false) {
    const Pose step = world_.random(draw_, 1.0, 0.7);
    truth_ = world_.compose(truth_, step);
    const MatrixXd Sigma = draw_.covariance(world_.tangent(), 0.05);
    const Motion motion = world_.motion(world_.moved(step, noise_ * draw_.error(Sigma)), Sigma);
    if (graph_.newest().kept) {
      odometry_.push_back({graph_.newest().id(), next_, motion});
    } else {
      Chain& last = odometry_.back();
      last = {last.from, next_, world_.motions().compose(last.motion, motion, order_)};
      ways_.pop_back();
    }
    graph_.advance(world_.variable(next_, fixed ? truth_ : Pose(), fixed), motion,
                   world_.types().edge);
    ways_.push_back({next_++, truth_});
    if (fixed) {
      fixed_ids_.push_back(newest());
      graph_.keep(seconds_);
    }
  }
  void keep() { graph_.keep(seconds_); }
  Factor measured(int pose) {
    const MatrixXd Sigma = draw_.covariance(world_.tangent(), 0.04);
    const Pose z = world_.between(ways_[pose].truth, ways_.back().truth);
    return world_.edge(ways_[pose].id, newest(), world_.moved(z, noise_ * draw_.error(Sigma)),
                       Sigma);
  }
  void link(int pose) {
    links_.push_back(measured(pose));
    graph_.link({&links_.back(), 1}, seconds_);
  }

  /// With everything, at the states that the compact graph has.
  Graph dense() const {
    Graph dense;
    for (const Way& way : ways_) {
      const int kept = graph_.kept().find(way.id);
      const State& x = kept >= 0 ? graph_.kept().state(kept) : graph_.newest().state();
      const int v = dense.add_variable(world_.types().pose, way.id, graph_.group().view(x));
      dense.set_fixed(v, std::ranges::find(fixed_ids_, way.id) != fixed_ids_.end());
    }
    for (const Chain& chain : odometry_) {
      add(world_.motions().to_factor(world_.types().edge, chain.from, chain.to, chain.motion),
          dense);
    }
    for (const Factor& link : links_) add(link, dense);
    return dense;
  }
  /// Whether all covariances from kept poses to the newest are those of the dense graph.
  void compare(double tolerance) {
    compare_near();
    const Graph whole = dense();
    const test::DenseSystem system = test::dense_system(whole);
    const MatrixXd Sigma = system.Sigma();
    const std::vector<int> poses = graph_.near(std::numeric_limits<double>::infinity());
    graph_.prepare(poses, seconds_);
    for (const int pose : poses) {
      const Displacement d = graph_.displacement(pose);
      const MatrixXd expected =
          displacement_covariance(whole, system, Sigma, graph_.kept().id(pose));
      ASSERT_LT(difference(d.covariance, expected), tolerance)
          << "pose " << pose << " of " << graph_.kept().size() << ", newest "
          << (graph_.newest().kept ? "kept" : "not kept") << "\n"
          << d.covariance << "\n\n"
          << expected;
    }
  }

  /// Whether the poses within some radius are those that are there by their states.
  void compare_near() {
    const double radius = draw_.uniform(0.0, 3.0);
    const Eigen::Vector3d here = world_.split(graph_.group().view(graph_.newest().state())).second;
    std::vector<int> expected;
    for (const int pose : graph_.near(std::numeric_limits<double>::infinity())) {
      const auto at = world_.split(graph_.group().view(graph_.kept().state(pose))).second;
      if ((at - here).norm() <= radius) expected.push_back(pose);
    }
    EXPECT_EQ(graph_.near(radius), expected);
  }

 private:
  struct Way {
    Id id;
    Pose truth;
  };
  struct Chain {
    Id from, to;
    Motion motion;
  };

  static void add(const Factor& factor, Graph& graph) {
    const std::vector<int> on{*graph.find(factor.variables[0]), *graph.find(factor.variables[1])};
    graph.add_factor(factor.type, on, factor.measurement, factor.information);
  }
  /// From a pose to the newest, with numerical Jacobians.
  MatrixXd displacement_covariance(const Graph& whole, const test::DenseSystem& system,
                                   const MatrixXd& Sigma, Id id) const {
    const int n = world_.tangent();
    const auto x = whole.state(*whole.find(id)), y = whole.state(*whole.find(newest()));
    const Pose back = world_.inverse(world_.between(x, y));
    const MatrixXd J = numerical_jacobian(2 * n, [&](const VectorXd& step) {
      return world_.log(world_.compose(
          back, world_.between(world_.moved(x, step.head(n)), world_.moved(y, step.tail(n)))));
    });
    MatrixXd joint = MatrixXd::Zero(2 * n, 2 * n);
    const Id ids[] = {id, newest()};
    for (int a = 0; a < 2; ++a) {
      for (int b = 0; b < 2; ++b) {
        const auto row = system.rows.find(ids[a]), column = system.rows.find(ids[b]);
        if (row == system.rows.end() || column == system.rows.end()) continue;
        joint.block(a * n, b * n, n, n) =
            Sigma.block(row->second.first, column->second.first, n, n);
      }
    }
    return J * joint * J.transpose();
  }

  double noise_;
  CompositionOrder order_;
  Draw draw_;
  Registry registry_;
  PoseWorld world_;
  CompactGraph graph_;
  PolicySeconds seconds_;
  Pose truth_;
  Id next_ = 1;
  std::vector<Way> ways_;  ///< of the kept poses and the newest
  std::vector<Chain> odometry_;
  std::vector<Factor> links_;
  std::vector<Id> fixed_ids_;
};

class CompactGraphIn : public testing::TestWithParam<Setting> {};
const auto kFirst = CompositionOrder::first;
INSTANTIATE_TEST_SUITE_P(
    Settings, CompactGraphIn,
    testing::Values(Setting{"plane", 2, "", kFirst, 1.0},
                    Setting{"plane_fourth", 2, "", CompositionOrder::fourth, 1.0},
                    Setting{"space_logarithm", 3, "logarithm", kFirst, 1.0},
                    Setting{"space_g2o", 3, "g2o", kFirst, 1.0},
                    Setting{"space_rotation_vector", 3, "rotation_vector", kFirst, 1.0},
                    Setting{"space_fourth", 3, "logarithm", CompositionOrder::fourth, 1.0}),
    [](const auto& setting) { return setting.param.name; });

TEST_P(CompactGraphIn, KnowsCovariancesAsIfEveryPoseWereAVariable) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    Grown grown(GetParam(), seed, "batch");
    int kinds[4]{};  // newest: not kept, kept by odometry alone, linked; several poses ahead
    for (int k = 0; k < 40 && !testing::Test::HasFatalFailure(); ++k) {
      grown.advance();
      grown.compare(1e-8);
      ++kinds[0];
      if (grown.draw().chance(0.5)) {
        grown.keep();
        grown.compare(1e-8);
        ++kinds[1];
      }
      while (grown.graph().newest().predecessor > 0 && grown.draw().chance(0.2)) {
        grown.link(grown.draw().integer(grown.graph().newest().predecessor));
        grown.compare(1e-8);
        ++kinds[2];
      }
      if (grown.draw().chance(0.1)) {
        grown.graph().estimator();  // takes all in
        grown.compare(1e-8);
        ++kinds[3];
      }
    }
    for (const int count : kinds) EXPECT_GT(count, 1);
  }
}

// What is exact needs no relinearisation, so that an incremental estimator is just as right.
TEST_P(CompactGraphIn, ReadsTheIncrementalEstimatorRightWhileNothingIsRelinearised) {
  Setting exact = GetParam();
  exact.noise = 0.0;
  Grown grown(exact, 4, "incremental_cholesky");
  for (int k = 0; k < 60 && !testing::Test::HasFatalFailure(); ++k) {
    grown.advance();
    if (grown.draw().chance(0.5)) grown.keep();
    if (grown.graph().newest().predecessor > 0 && grown.draw().chance(0.3))
      grown.link(grown.draw().integer(grown.graph().newest().predecessor));
    grown.compare(1e-7);
  }
}

TEST_P(CompactGraphIn, FixedPosesAreCertainFromThenOn) {
  Setting exact = GetParam();
  exact.noise = 0.0;  // or the poses before would not be where they are linearised
  Grown grown(exact, 5, "batch");
  for (int k = 0; k < 20 && !testing::Test::HasFatalFailure(); ++k) {
    grown.advance(/*fixed=*/k % 6 == 5);
    grown.compare(1e-8);
    if (k % 3 == 0) grown.keep();
    grown.compare(1e-8);
  }
}

TEST_P(CompactGraphIn, ALinkTellsHalfTheLogarithmOfWhatItDoesToTheDeterminant) {
  Setting exact = GetParam();
  exact.noise = 0.0;  // so that the link moves no point of linearisation
  Grown grown(exact, 6, "batch");
  PolicySeconds seconds;
  const auto log_determinant = [](const Graph& graph) {
    return 2.0 * test::dense_system(graph).H.llt().matrixLLT().diagonal().array().log().sum();
  };
  for (int k = 0; k < 30; ++k) {
    grown.advance();
    if (grown.draw().chance(0.6)) grown.keep();
    CompactGraph& graph = grown.graph();
    if (graph.newest().predecessor < 1 || grown.draw().chance(0.5)) continue;
    const int pose = grown.draw().integer(graph.newest().predecessor);
    const double before = log_determinant(grown.dense());
    graph.prepare({&pose, 1}, seconds);
    const Displacement d = graph.displacement(pose);
    grown.link(pose);
    const Graph after = grown.dense();
    const int last = after.factor_count() - 1;
    const Motion taken = grown.world().motions().of_factor(
        *grown.world().types().edge, after.measurement(last), after.information(last));
    const double gain =
        mutual_information(to_matrix(taken.covariance, graph.group().tangent_size()), d.covariance);
    EXPECT_NEAR(gain, 0.5 * (log_determinant(after) - before), 1e-6 * (1.0 + gain));
  }
}

TEST_P(CompactGraphIn, KnowsTheCovarianceBetweenTwoKeptPoses) {
  Grown grown(GetParam(), 7, "batch");
  for (int k = 0; k < 12; ++k) {
    grown.advance();
    grown.keep();
    if (k % 4 == 3) grown.link(grown.draw().integer(k));
  }
  const std::vector<int> poses = grown.graph().near(std::numeric_limits<double>::infinity());
  PolicySeconds seconds;
  const int last = grown.graph().kept().size() - 1;
  for (const int pose : poses) {
    const Displacement forwards = grown.graph().between(pose, last);
    grown.graph().prepare({&pose, 1}, seconds);
    const Displacement d = grown.graph().displacement(pose);
    EXPECT_LT(difference(forwards.covariance, d.covariance), 1e-9);
    // Back, it is the same motion's inverse: Ad(d) Σ Ad(d)ᵀ.
    const Displacement back = grown.graph().between(last, pose);
    EXPECT_LT(difference(back.covariance, forwards.adjoint.inverse() * forwards.covariance *
                                              forwards.adjoint.inverse().transpose()),
              1e-8);
  }
  EXPECT_LT(grown.graph().between(2, 2).covariance.norm(), 1e-15);
}

TEST_P(CompactGraphIn, PosesThatAreNotKeptLeaveNothingBehind) {
  Grown grown(GetParam(), 8, "batch");
  for (int k = 0; k < 5; ++k) grown.advance();
  EXPECT_EQ(grown.graph().kept().size(), 1);
  EXPECT_THAT(grown.graph().chains(), IsEmpty());
  EXPECT_EQ(grown.graph().estimator().variable_count(), 1);
  grown.keep();
  grown.keep();
  ASSERT_THAT(grown.graph().chains(), testing::SizeIs(1));
  const OdometryChain& chain = grown.graph().chains().front();
  EXPECT_EQ(chain.from, 0);
  EXPECT_EQ(chain.to, 5);
  std::vector<Id> ids;
  Pose x = grown.world().identity();
  for (const ChainStep& step : chain.steps) {
    ids.push_back(step.pose);
    x = grown.world().compose(x, step.motion);
  }
  EXPECT_THAT(ids, ElementsAre(1, 2, 3, 4, 5));
  Estimator& estimator = grown.graph().estimator();
  EXPECT_EQ(estimator.variable_count(), 2);
  EXPECT_EQ(estimator.factor_count(), 1);
  EXPECT_LT(grown.world()
                .log(grown.world().between(
                    x, grown.world().between(estimator.state(0), estimator.state(5))))
                .norm(),
            1e-9);
}

TEST_P(CompactGraphIn, FusesSeveralMeasurementsEitherWayRound) {
  Grown grown(GetParam(), 9, "batch");
  const PoseWorld& world = grown.world();
  const int n = world.tangent();
  const Pose z = world.random(grown.draw(), 1.0, 0.7);
  const MatrixXd S_1 = grown.draw().covariance(n, 0.1), S_2 = grown.draw().covariance(n, 0.2);
  const Factor one = world.edge(3, 4, z, S_1);
  const Motion back = world.motions().inverse(world.motion(z, S_2));
  const Factor other = world.motions().to_factor(world.types().edge, 4, 3, back);
  const Factor both[] = {one, other};
  const CompactGraph& graph = grown.graph();
  const Motion fused = graph.group().fuse(both, 3, 4);
  EXPECT_LT(world.log(world.between(fused.mean, z)).norm(), 1e-9);
  const MatrixXd expected = (S_1.inverse() + S_2.inverse()).inverse();
  EXPECT_LT(difference(to_matrix(fused.covariance, n), expected), 1e-8);
  EXPECT_THROW(graph.group().fuse(both, 3, 5), Error);
}

/// Takes one pose out of a chain, of which `before` and `after` are the factors; the factor in its
/// place goes from the later pose to the earlier.
class Backwards final : public PoseRemover {
 public:
  Backwards(const PoseWorld& world, FactorId before, FactorId after)
      : world_(world), before_(before), after_(after) {}
  Removal remove(Estimator&, std::span<const Id>) override { return {}; }
  Removal make_room(Estimator& estimator, int, const GraphUpdate&) override {
    const MotionGroup& motions = world_.motions();
    const Factor before = estimator.factor(before_), after = estimator.factor(after_);
    const Id from = before.variables[0], gone = before.variables[1], to = after.variables[1];
    const Motion way =
        motions.compose(motions.of_factor(before, from), motions.of_factor(after, gone));
    Removal removal;
    removal.update.removed_variables = {gone};
    removal.update.removed_factors = {before_, after_};
    removal.update.factors = {motions.to_factor(before.type, to, from, motions.inverse(way))};
    return removal;
  }

 private:
  const PoseWorld& world_;
  FactorId before_, after_;
};

TEST_P(CompactGraphIn, FusesWithAFactorThatGoesTheOtherWayWherePosesHaveLeft) {
  const Setting& setting = GetParam();
  Registry registry;
  const PoseWorld world(setting.dimension == 2 ? planar_types(registry)
                                               : spatial_types(registry, setting.metric));
  Draw draw(11);
  const MatrixXd Sigma = draw.covariance(world.tangent(), 0.05);
  CompactGraph graph(registry.make<Estimator>("batch"), setting.order);
  PolicySeconds seconds;
  std::vector<Pose> truth{world.random(draw, 1.0, 1.0)};
  graph.start(world.variable(0, truth[0]), seconds);
  for (Id id = 1; id <= 4; ++id) {
    const Pose step = world.random(draw, 1.0, 0.7);
    truth.push_back(world.compose(truth.back(), step));
    graph.advance(world.variable(id), world.motion(step, Sigma), world.types().edge);
    if (id < 4) graph.keep(seconds);
  }
  graph.estimator();  // takes all in: factor k leads from pose k to the next
  Backwards remover(world, 1, 2);
  ASSERT_THAT(graph.make_room(remover, 3, {}, seconds).poses, ElementsAre(2));
  graph.relocate(1, world.motion(world.between(truth[1], truth[4]), Sigma), 0.5, 0.0, seconds);
  Estimator& estimator = graph.estimator();
  const Factor bridge = estimator.factor(3);
  EXPECT_THAT(bridge.variables, ElementsAre(3, 1));
  const Motion fused = world.motions().of_factor(bridge, 1);
  EXPECT_LT(world.log(world.between(fused.mean, world.between(truth[1], truth[3]))).norm(), 1e-9);
  for (const Id id : {1, 3}) {
    const auto x = estimator.state(id);
    EXPECT_LT(world.log(world.between(x, truth[static_cast<std::size_t>(id)])).norm(), 1e-6) << id;
  }
}

TEST(CompactGraph, RefusesMeasurementsOfSomethingElse) {
  Registry registry;
  const PoseWorld plane(planar_types(registry)), space(spatial_types(registry));
  CompactGraph graph(registry.make<Estimator>("batch"), CompositionOrder::first);
  PolicySeconds seconds;
  graph.start(plane.variable(0), seconds);
  const Factor turned = space.edge(0, 1, space.identity(), MatrixXd::Identity(6, 6));
  try {
    graph.group().fuse({&turned, 1}, 0, 1);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input);
    EXPECT_THAT(error.what(), HasSubstr("VERTEX_SE2"));
  }
  const Factor seen{registry.factor_type("EDGE_SE2_XY"), {0, 1}, {1.0, 2.0}, {1.0, 0.0, 1.0}};
  EXPECT_THROW(graph.group().fuse({&seen, 1}, 0, 1), Error);
}

}  // namespace
}  // namespace cairn::compact
