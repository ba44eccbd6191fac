// SPDX-License-Identifier: BSD-3-Clause
#include "compact_pose.hpp"

#include <cmath>
#include <functional>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"
#include "cairn/solve/optimizer.hpp"
#include "support/policy_runs.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::all_ids;
using test::difference;
using test::Draw;
using test::planar_types;
using test::PolicyRun;
using test::PoseWorld;
using test::run;
using test::simulate;
using test::spatial_types;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Key;
using testing::SizeIs;
using Pose = PoseWorld::Pose;
using Pair = std::pair<Id, Id>;

std::string message_of(const std::function<void()>& call, ErrorCode code) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return {};
}

/// Drives in the plane, knows where it truly is, and tells a policy.
class Robot {
 public:
  Robot(Registry& registry, const std::string& policy, unsigned seed = 1)
      : world_(planar_types(registry)),
        policy_(registry.make<PosePolicy>("compact_pose:reuse=false" +
                                          (policy.empty() ? "" : "," + policy))),
        draw_(seed) {
    policy_->add_pose(world_.variable(0, world_.identity()), {});
    truth_.push_back(world_.identity());
  }
  PosePolicy& policy() { return *policy_; }
  const PoseWorld& world() const { return world_; }
  Draw& draw() { return draw_; }
  Id newest() const { return static_cast<Id>(truth_.size()) - 1; }
  MatrixXd odometry_covariance() const {
    return Eigen::Vector3d(0.05 * 0.05, 0.05 * 0.05, 0.02 * 0.02).asDiagonal();
  }

  Factor odometry() { return measured(newest(), newest() + 1, step_, odometry_covariance()); }
  /// Ends the newest pose and begins the next.
  PoseReport advance() {
    const PoseReport report = policy_->end_pose();
    begin();
    return report;
  }
  void begin() {
    const Factor moved = odometry();
    policy_->add_pose(world_.variable(newest() + 1), {&moved, 1});
    truth_.push_back(world_.compose(truth_.back(), step_));
  }
  void turn(double forwards, double angle) { step_ = {forwards, 0.0, angle}; }
  /// From an earlier pose to the newest.
  Factor right(Id other, double sigma = 0.02) {
    return measured(other, newest(), world_.between(truth_[other], truth_.back()), Sigma(sigma));
  }
  Factor wrong(Id other, const Pose& motion, double sigma = 0.02) const {
    return world_.edge(other, newest(), motion, Sigma(sigma));
  }
  LinkReport offer(const Factor& factor) {
    return policy_->offer(
        factor.variables[0] == newest() ? factor.variables[1] : factor.variables[0], {&factor, 1});
  }
  /// From the truth [m, rad].
  double error(std::span<const double> x, Id id) const {
    return world_.log(world_.between(x, truth_[static_cast<std::size_t>(id)])).norm();
  }
  double newest_error() const { return error(policy_->newest_state(), newest()); }

 private:
  static MatrixXd Sigma(double sigma) { return sigma * sigma * MatrixXd::Identity(3, 3); }
  Factor measured(Id from, Id to, const Pose& motion, const MatrixXd& covariance) {
    return world_.edge(from, to, world_.moved(motion, draw_.error(covariance)), covariance);
  }

  PoseWorld world_;
  std::unique_ptr<PosePolicy> policy_;
  Draw draw_;
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

// Strategies --------------------------------------------------------------------------------------

TEST_F(CompactPoseTest, AllPosesAndAllLoopsAreTheWholeGraph) {
  for (const char* generator :
       {"manhattan:poses=150,streets=4", "sphere:turns=5,poses_per_turn=12"}) {
    Simulation world = simulate(registry, generator);
    const PolicyRun all =
        run(registry, world, "compact_pose:strategy=apal,search=untested", "recorded");
    EXPECT_EQ(all.kept(), all_ids(world.graph));
    const Graph graph = all.policy->estimator().graph();
    EXPECT_EQ(graph.variable_count(), world.graph.variable_count());
    EXPECT_EQ(graph.factor_count(), world.graph.factor_count());
    const Summary summary = registry.make<Optimizer>("levenberg_marquardt")->optimize(world.graph);
    EXPECT_NEAR(all.policy->estimator().chi2(), summary.final_chi2, 1e-6 * summary.final_chi2);
    for (const OdometryChain& chain : all.policy->chains()) EXPECT_THAT(chain.steps, SizeIs(1));
  }
}

TEST_F(CompactPoseTest, EachStrategyTakesFewerThanTheOneBefore) {
  const Simulation world = simulate(registry, "manhattan:poses=250,streets=5");
  std::vector<std::size_t> poses, links;
  for (const std::string strategy : {"apal", "apfl", "fpfl"}) {
    const PolicyRun one =
        run(registry, world, "compact_pose:range=3,angle=3.15,strategy=" + strategy,
            "simulated:range=3");
    poses.push_back(one.kept().size());
    links.push_back(one.links().size());
  }
  EXPECT_EQ(poses[0], 250U);
  EXPECT_EQ(poses[1], 250U);
  EXPECT_LT(poses[2], 200U);
  EXPECT_GT(poses[2], 20U);
  EXPECT_GT(links[0], 2 * links[1]);
  EXPECT_GT(links[2], 10U);
}

TEST_F(CompactPoseTest, TheWayIsInTheChainsAndEveryPoseOnce) {
  for (const char* generator :
       {"manhattan:poses=250,streets=5", "sphere:turns=6,poses_per_turn=16"}) {
    const Simulation world = simulate(registry, generator);
    const PolicyRun few = run(
        registry, world, "compact_pose:reuse=false,range=20,angle=3.15,pose_gain=4", "recorded");
    std::vector<Id> ids{few.policy->chains().front().from};
    Id last = ids.back();
    for (const OdometryChain& chain : few.policy->chains()) {
      EXPECT_EQ(chain.from, last);
      for (const ChainStep& step : chain.steps) ids.push_back(step.pose);
      last = chain.to;
      EXPECT_EQ(ids.back(), last);
    }
    EXPECT_EQ(ids, all_ids(world.graph));
    EXPECT_LT(few.policy->chains().size(), ids.size() - 20);
    EXPECT_EQ(few.policy->estimator().variable_count(),
              static_cast<int>(few.policy->chains().size()) + 1);
  }
}

TEST_F(CompactPoseTest, WithoutThresholdsTakesThoseOfALinkAsGoodAsTheOdometry) {
  struct Case {
    std::string generator;
    double freedoms;
  };
  for (const auto& [generator, n] : {Case{"manhattan:poses=200,streets=5", 3.0},
                                     Case{"sphere:turns=6,poses_per_turn=16,radius=6", 6.0}}) {
    const Simulation world = simulate(registry, generator);
    const auto power = [n = n](double p) {
      return std::to_string(std::pow(0.5 * n * std::log(2.0) + 1.0, p) - 1.0);
    };
    const std::string policy = "compact_pose:reuse=false,range=4,angle=3.15";
    const PolicyRun given =
        run(registry, world, policy + ",loop_gain=" + power(1.36) + ",pose_gain=" + power(1.7),
            "recorded");
    const PolicyRun left = run(registry, world, policy, "recorded");
    EXPECT_EQ(given.kept(), left.kept());
    EXPECT_EQ(given.links(), left.links());
    for (const std::string& other : {",loop_gain=" + power(1.6), ",pose_gain=" + power(1.9)}) {
      const PolicyRun changed = run(registry, world, policy + other, "recorded");
      EXPECT_TRUE(changed.kept() != left.kept() || changed.links() != left.links()) << other;
    }
  }
}

TEST_F(CompactPoseTest, ConcatenatesToTheOrderThatIsChosen) {
  const PoseWorld world(spatial_types(registry));
  Draw draw(1);
  const Pose z = world.random(draw, 1.0, 1.0);
  const MatrixXd Sigma = draw.covariance(6, 0.3);
  for (const auto order : {CompositionOrder::first, CompositionOrder::fourth}) {
    const auto policy =
        make(std::string("composition=") + (order == CompositionOrder::first ? "first" : "fourth") +
             ",range=1e6,angle=3.15,probability=0,pose_gain=1e9");
    policy->add_pose(world.variable(0, world.identity()), {});
    Motion expected = world.motion(z, Sigma);
    for (Id id = 0; id < 5; ++id) {
      policy->end_pose();
      const Factor moved = world.edge(id, id + 1, z, Sigma);
      policy->add_pose(world.variable(id + 1), {&moved, 1});
      if (id > 0) expected = world.motions().compose(expected, world.motion(z, Sigma), order);
    }
    policy->end_pose();
    policy->finish();
    const Graph graph = policy->estimator().graph();
    ASSERT_EQ(graph.factor_count(), 1);
    const Motion taken =
        world.motions().of_factor(*world.types().edge, graph.measurement(0), graph.information(0));
    EXPECT_LT(difference(to_matrix(taken.covariance, 6), to_matrix(expected.covariance, 6)), 1e-9);
  }
}

TEST_F(CompactPoseTest, WhereNothingIsNearAPoseIsKept) {
  Robot robot(registry, "range=0.1,angle=3.15");
  for (int k = 0; k < 10; ++k) EXPECT_TRUE(robot.advance().kept);
}

TEST_F(CompactPoseTest, FixedPosesAreKept) {
  Simulation world = simulate(registry, "manhattan:poses=60,streets=3,noise=0.1");
  for (const Id id : {17, 18, 40}) world.graph.set_fixed(*world.graph.find(id));
  for (const Id id : {17, 18, 40})
    world.graph.set_state(*world.graph.find(id), world.truth.state(*world.truth.find(id)));
  FunctionRegistration none([](Id, Id) { return std::vector<Factor>(); });
  const PolicyRun few =
      run(make("range=1e6,angle=3.15,probability=0,pose_gain=1e9"), none, world.graph);
  EXPECT_THAT(few.kept(), ElementsAre(0, 17, 18, 40));
  std::vector<Id> variables;
  const Graph graph = few.policy->estimator().graph();
  for (int v = 0; v < graph.variable_count(); ++v) {
    variables.push_back(graph.id(v));
    if (graph.id(v) < 17 || graph.id(v) > 40) continue;
    EXPECT_TRUE(graph.fixed(v));
    EXPECT_THAT(graph.state(v),
                testing::Pointwise(testing::DoubleNear(1e-12),
                                   world.truth.state(*world.truth.find(graph.id(v)))));
  }
  EXPECT_THAT(variables, ElementsAre(0, 17, 18, 40, 59));
}

TEST_F(CompactPoseTest, TheNewestStateIsOdometryFromTheLastKeptPose) {
  const PoseWorld world(planar_types(registry));
  const auto policy = make("range=1e6,angle=3.15,probability=0,pose_gain=1e9");
  Draw draw(1);
  Pose x = world.random(draw, 2.0, 1.0);
  policy->add_pose(world.variable(0, x), {});
  for (Id id = 0; id < 20; ++id) {
    policy->end_pose();
    const Pose z = world.random(draw, 2.0, 1.0);
    const Factor moved = world.edge(id, id + 1, z, MatrixXd::Identity(3, 3));
    policy->add_pose(world.variable(id + 1), {&moved, 1});
    x = world.compose(x, z);
    EXPECT_LT(world.log(world.between(x, policy->newest_state())).norm(), 1e-12);
  }
  EXPECT_THAT(policy->chains(), IsEmpty());
}

// Links -------------------------------------------------------------------------------------------

TEST_F(CompactPoseTest, ProposesWhatTellsMostAndDoesNotProposeItAgain) {
  Robot robot(registry, "strategy=apfl,range=30,angle=3.15,loop_gain=0.2");
  for (int k = 0; k < 30; ++k) robot.advance();
  double last = std::numeric_limits<double>::infinity();
  std::set<Id> proposed;
  while (const auto match = robot.policy().next_match()) {
    EXPECT_EQ(match->later, robot.newest());
    EXPECT_LT(match->earlier, robot.newest() - 1);
    EXPECT_LE(match->gain, last);
    last = match->gain;
    EXPECT_TRUE(proposed.insert(match->earlier).second);
    const VectorXd off = robot.world().log(
        robot.world().between(match->expected.mean, robot.right(match->earlier).measurement));
    const MatrixXd S = Eigen::Map<const MatrixXd>(match->expected.covariance.data(), 3, 3);
    EXPECT_LT(off.dot((S + 4e-4 * MatrixXd::Identity(3, 3)).llt().solve(off)), 30.0);
    const LinkReport report = robot.policy().offer(match->earlier, {});
    EXPECT_EQ(report.verdict, LinkVerdict::unmatched);
    EXPECT_EQ(report.expected_gain, match->gain);
  }
  EXPECT_GT(proposed.size(), 10U);
  const PoseReport report = robot.policy().end_pose();
  EXPECT_FALSE(report.closed_loop);
  EXPECT_THAT(report.links, SizeIs(proposed.size()));
}

TEST_F(CompactPoseTest, TakesOrLeavesWhatItDidNotAskFor) {
  for (const bool near : {true, false}) {
    Robot robot(registry, near ? "strategy=apfl,range=100,angle=3.15" : "strategy=apfl,range=0.5");
    for (int k = 0; k < 40; ++k) robot.advance();
    // Far out of range if that is 0.5 m.
    const LinkReport taken = robot.offer(robot.right(3));
    EXPECT_EQ(taken.verdict, LinkVerdict::linked);
    EXPECT_GT(taken.gain, 3.0);
    EXPECT_LT(robot.newest_error(), 0.5);
    // The same once more tells nothing new, or nearly.
    const LinkReport again = robot.offer(robot.right(3, 0.05));
    EXPECT_EQ(again.verdict, LinkVerdict::uninformative);
    EXPECT_LT(again.gain, 1.0);
    EXPECT_EQ(robot.policy().offer(4, {}).verdict, LinkVerdict::unmatched);
    // Nobody is asked about it any more.
    while (const auto match = robot.policy().next_match()) {
      EXPECT_NE(match->earlier, 3);
      EXPECT_NE(match->earlier, 4);
      robot.policy().offer(match->earlier, {});
    }
    const PoseReport report = robot.policy().end_pose();
    EXPECT_TRUE(report.kept && report.closed_loop);
  }
}

// Far out of range: its covariance was never asked for, and it is from some poses ago.
TEST_F(CompactPoseTest, KnowsWhatALinkTellsWhereverItComesFrom) {
  std::vector<double> gains;
  for (const std::string options : {"range=0.5", "range=1000,angle=3.15"}) {
    Robot robot(registry, "strategy=apfl,loop_gain=0.3," + options);
    gains.clear();
    for (int k = 0; k < 120; ++k) {
      robot.advance();
      if (k % 10 == 9) {
        for (const Id other : {Id{5}, Id{2}, robot.newest() / 2}) {
          const LinkReport report = robot.offer(robot.right(other));
          gains.push_back(report.gain);
          gains.push_back(report.innovation);
        }
      }
    }
    static std::vector<double> first;
    if (first.empty()) first = gains;
    EXPECT_THAT(gains, testing::Pointwise(testing::DoubleNear(1e-6), first));
  }
}

TEST_F(CompactPoseTest, ALinkKeepsItsPose) {
  Robot robot(registry, "range=1e6,angle=3.15,probability=0,pose_gain=1e9");
  for (int k = 0; k < 30; ++k) robot.advance();
  EXPECT_EQ(robot.offer(robot.right(0)).verdict, LinkVerdict::linked);
  EXPECT_TRUE(robot.policy().end_pose().kept);
  ASSERT_THAT(robot.policy().chains(), SizeIs(1));
  EXPECT_THAT(robot.policy().chains().front().steps, SizeIs(30));
  EXPECT_THAT(message_of([&] { robot.policy().offer(15, {}); }, ErrorCode::usage),
              HasSubstr("without a pose"));
}

TEST_F(CompactPoseTest, EdgesMayPointBackwards) {
  const Simulation world = simulate(registry, "manhattan:poses=200,streets=4");
  const PoseWorld poses(planar_types(registry));
  Graph backwards;
  for (int v = 0; v < world.graph.variable_count(); ++v)
    backwards.add_variable(poses.types().pose, world.graph.id(v), world.graph.state(v));
  for (int f = 0; f < world.graph.factor_count(); ++f) {
    const Factor factor = world.graph.factor(f);
    const Id from = factor.variables[0], to = factor.variables[1];
    const Factor turned =
        poses.motions().to_factor(factor.type, to, from, poses.motions().of_factor(factor, to));
    backwards.add_factor(turned.type, std::array{*backwards.find(to), *backwards.find(from)},
                         turned.measurement, turned.information);
  }
  const std::string policy = "compact_pose:reuse=false,range=3,angle=3.15";
  const auto registration = registry.make<Registration>("recorded");
  registration->begin({.recording = &world.graph});
  const PolicyRun one = run(registry.make<PosePolicy>(policy), *registration, world.graph);
  const auto turned = registry.make<Registration>("recorded");
  turned->begin({.recording = &backwards});
  const PolicyRun other = run(registry.make<PosePolicy>(policy), *turned, backwards);
  EXPECT_EQ(one.kept(), other.kept());
  EXPECT_EQ(one.links(), other.links());
  EXPECT_GT(one.links().size(), 5U);
  EXPECT_LT(one.kept().size(), 190U);
  const Graph a = one.policy->estimator().graph(), b = other.policy->estimator().graph();
  double most = 0.0;  // not nothing: EDGE_SE2's error is no logarithm, and so has a direction
  for (int v = 0; v < a.variable_count(); ++v)
    most = std::max(most, poses.log(poses.between(a.state(v), b.state(v))).norm());
  EXPECT_LT(most, 0.01);
}

TEST_F(CompactPoseTest, SeveralMeasurementsOfOneMotionCountAsOne) {
  const PoseWorld world(planar_types(registry));
  const auto policy = make("range=1e6,angle=3.15,probability=0,pose_gain=1e9");
  policy->add_pose(world.variable(0, world.identity()), {});
  policy->end_pose();
  Draw draw(1);
  const MatrixXd S_1 = draw.covariance(3, 0.1), S_2 = draw.covariance(3, 0.2);
  const Pose z_1{1.0, 0.1, 0.2}, z_2{1.05, 0.05, 0.25};
  const Motion fused = world.motions().fuse(world.motion(z_1, S_1), world.motion(z_2, S_2));
  const Factor both[] = {
      world.edge(0, 1, z_1, S_1),
      world.motions().to_factor(world.types().edge, 1, 0,
                                world.motions().inverse(world.motion(z_2, S_2)))};
  policy->add_pose(world.variable(1), both);
  EXPECT_LT(world.log(world.between(policy->newest_state(), fused.mean)).norm(), 1e-9);
  policy->end_pose();
  policy->finish();
  ASSERT_EQ(policy->estimator().factor_count(), 1);
  const Graph graph = policy->estimator().graph();
  const Motion taken =
      world.motions().of_factor(*world.types().edge, graph.measurement(0), graph.information(0));
  EXPECT_LT(difference(to_matrix(taken.covariance, 3), to_matrix(fused.covariance, 3)), 1e-9);
}

// Errors ------------------------------------------------------------------------------------------

TEST_F(CompactPoseTest, GoesOnAfterABadCallAsIfItHadNotBeen) {
  Robot disturbed(registry, "range=20,angle=3.15,pose_gain=2", 3),
      quiet(registry, "range=20,angle=3.15,pose_gain=2", 3);
  PosePolicy& policy = disturbed.policy();
  const PoseWorld& world = disturbed.world();
  const MatrixXd I = MatrixXd::Identity(3, 3);
  const auto refuse = [&](const Variable& pose, const std::vector<Factor>& odometry) {
    return message_of([&] { policy.add_pose(pose, odometry); }, ErrorCode::input);
  };
  for (int k = 0; k < 60; ++k) {
    const Id n = disturbed.newest();
    EXPECT_THAT(message_of([&] { policy.add_pose(world.variable(n + 1), {}); }, ErrorCode::usage),
                HasSubstr("ended"));
    EXPECT_THROW(policy.finish(), Error);
    EXPECT_THAT(message_of([&] { policy.offer(1'000, {}); }, ErrorCode::input),
                HasSubstr("1000 is not in the compact graph"));
    EXPECT_THROW(policy.offer(n, {}), Error);  // the newest
    if (n > 0) {
      const Factor elsewhere = world.edge(0, n + 7, world.identity(), I);
      message_of([&] { policy.offer(0, {&elsewhere, 1}); }, ErrorCode::input);
      const Factor unequal{world.types().edge, {0, n}, {1.0, 2.0}, {1, 0, 0, 1, 0, 1}};
      message_of([&] { policy.offer(0, {&unequal, 1}); }, ErrorCode::input);
      const Factor vague{world.types().edge, {0, n}, {1.0, 2.0, 0.0}, {1, 0, 0, -1, 0, 1}};
      message_of([&] { policy.offer(0, {&vague, 1}); }, ErrorCode::input);
      // It has been asked about 0 now, and so has the other.
      quiet.policy().offer(0, {});
      policy.offer(0, {});
    }
    for (Robot* robot : {&disturbed, &quiet}) {
      while (const auto match = robot->policy().next_match()) {
        const Factor link = robot->right(match->earlier);
        if (match->earlier % 3 == 0) {
          robot->offer(link);
        } else {
          robot->policy().offer(match->earlier, {});
        }
      }
    }
    const PoseReport a = policy.end_pose(), b = quiet.policy().end_pose();
    EXPECT_EQ(a.kept, b.kept);
    EXPECT_EQ(a.candidates, b.candidates);
    EXPECT_EQ(a.least_gain, b.least_gain);
    EXPECT_EQ(a.closed_loop, b.closed_loop);
    EXPECT_EQ(a.links.size(), b.links.size());

    EXPECT_THROW(policy.end_pose(), Error);
    EXPECT_THROW(policy.next_match(), Error);
    EXPECT_THROW(policy.offer(0, {}), Error);
    EXPECT_THAT(refuse(world.variable(n + 1), {}), HasSubstr("without odometry from pose"));
    EXPECT_THAT(refuse(world.variable(n), {world.edge(n, n + 1, world.identity(), I)}),
                HasSubstr("is there already"));
    EXPECT_THAT(refuse(world.variable(0), {world.edge(n, n + 1, world.identity(), I)}),
                HasSubstr("is there already"));
    EXPECT_THAT(refuse(world.variable(n + 1), {world.edge(n + 2, n + 1, world.identity(), I)}),
                HasSubstr("not between poses"));
    EXPECT_THAT(refuse({registry.variable_type("VERTEX_SE3:QUAT"), n + 1, {}, false},
                       {world.edge(n, n + 1, world.identity(), I)}),
                HasSubstr("VERTEX_SE3:QUAT"));
    refuse(world.variable(n + 1),
           {Factor{registry.factor_type("EDGE_SE2_XY"), {n, n + 1}, {1, 2}, {1, 0, 1}}});
    refuse(world.variable(n + 1),
           {Factor{world.types().edge, {n, n + 1}, {1, 2, NAN}, {1, 0, 0, 1, 0, 1}}});
    disturbed.begin();
    quiet.begin();
    EXPECT_EQ(policy.newest_state(), quiet.policy().newest_state());
  }
  policy.end_pose();
  policy.finish();
  quiet.policy().end_pose();
  quiet.policy().finish();
  EXPECT_EQ(policy.estimator().chi2(), quiet.policy().estimator().chi2());
  EXPECT_GT(policy.estimator().factor_count(), policy.estimator().variable_count());
}

TEST_F(CompactPoseTest, TheFirstPoseHasNotMoved) {
  const PoseWorld world(planar_types(registry));
  const auto policy = make("range=2");
  const Factor moved = world.edge(0, 1, world.identity(), MatrixXd::Identity(3, 3));
  EXPECT_THAT(message_of(
                  [&] {
                    policy->add_pose(world.variable(1), {&moved, 1});
                  },
                  ErrorCode::input),
              HasSubstr("first"));
  policy->add_pose(world.variable(1), {});
  EXPECT_TRUE(policy->end_pose().kept);
  EXPECT_EQ(policy->newest_state(), world.identity());
}

TEST_F(CompactPoseTest, RefusesASensorThatIsNoCovariance) {
  for (const std::string sensor :
       {"1 2 3", "0 0", "0.1 0", "nan 1", "1 0 0 -1 0 1", "1 2 0 1 0 1", "inf inf", "0.1 x"}) {
    const PoseWorld world(planar_types(registry));
    EXPECT_THAT(message_of(
                    [&] {
                      const auto policy = registry.make<PosePolicy>(
                          ComponentSpec{"compact_pose", {{"sensor", sensor}}});
                      policy->add_pose(world.variable(0, world.identity()), {});
                    },
                    ErrorCode::usage),
                HasSubstr("sensor"))
        << sensor;
  }
}

TEST_F(CompactPoseTest, ATypeThatIsNoRigidMotionIsRefused) {
  const auto policy = make("range=2");
  const Variable point{registry.variable_type("VERTEX_XY"), 0, {1.0, 2.0}, false};
  message_of([&] { policy->add_pose(point, {}); }, ErrorCode::usage);
  const PoseWorld world(planar_types(registry));
  policy->add_pose(world.variable(0, world.identity()), {});  // goes on
  EXPECT_TRUE(policy->end_pose().kept);
}

// Consistency -------------------------------------------------------------------------------------

// Once around: the way back is known to a metre or so, and a false match may well fit.
class FarFromKnown : public CompactPoseTest {
 protected:
  Robot driven(int steps, unsigned seed) {
    Robot robot(registry, "strategy=apfl,range=5,angle=3.15,loop_gain=0.5,gate=0.999,trust=0.01",
                seed);
    for (int k = 0; k < steps; ++k) robot.advance();
    return robot;
  }
  static constexpr int kLap = 126;  // steps of 0.1 rad: twice around
};

TEST_F(FarFromKnown, ALinkWaitsForASecondThatAgrees) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    Robot robot = driven(kLap, seed);
    const LinkReport first = robot.offer(robot.right(2));
    ASSERT_EQ(first.verdict, LinkVerdict::waiting);
    EXPECT_GT(first.gain, 1.0);
    EXPECT_FALSE(robot.advance().closed_loop);
    robot.advance();
    const LinkReport second = robot.offer(robot.right(4));
    EXPECT_EQ(second.verdict, LinkVerdict::linked);
    const PoseReport report = robot.policy().end_pose();
    ASSERT_THAT(report.links, SizeIs(2));
    EXPECT_EQ(report.links[1].earlier, 2);
    EXPECT_EQ(report.links[1].later, first.later);
    EXPECT_NE(report.links[1].verdict, LinkVerdict::waiting);
    EXPECT_NE(report.links[1].verdict, LinkVerdict::inconsistent);
    EXPECT_TRUE(report.closed_loop);
    EXPECT_LT(robot.newest_error(), 0.4);
  }
}

TEST_F(FarFromKnown, AFalseLinkDoesNotFreeTheOneThatWaits) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    Robot robot = driven(kLap, seed);
    ASSERT_EQ(robot.offer(robot.right(2)).verdict, LinkVerdict::waiting);
    robot.advance();
    const Pose off = robot.world().compose(robot.right(3).measurement, Pose{-0.7, 0.9, 0.15});
    EXPECT_THAT(robot.offer(robot.wrong(3, off)).verdict,
                testing::AnyOf(LinkVerdict::waiting, LinkVerdict::inconsistent));
    EXPECT_FALSE(robot.advance().closed_loop);
    // The next right one agrees with the first; then it is known that the second is false.
    EXPECT_EQ(robot.offer(robot.right(4)).verdict, LinkVerdict::linked);
    const PoseReport report = robot.policy().end_pose();
    for (const LinkReport& link : report.links) {
      if (link.earlier == 3) {
        EXPECT_EQ(link.verdict, LinkVerdict::inconsistent);
      }
    }
    EXPECT_LT(robot.newest_error(), 0.4);
  }
}

TEST_F(FarFromKnown, WithoutAGateTheFirstIsTaken) {
  Robot robot(registry, "strategy=apfl,range=5,angle=3.15,loop_gain=0.5");
  for (int k = 0; k < kLap; ++k) robot.advance();
  EXPECT_EQ(robot.offer(robot.wrong(2, Pose{3.0, 3.0, 1.0})).verdict, LinkVerdict::linked);
}

TEST_F(FarFromKnown, WhatIsFarOffIsInconsistentAtOnce) {
  Robot robot = driven(10, 1);
  const LinkReport report = robot.offer(robot.wrong(2, Pose{0.0, 0.0, 3.0}));
  EXPECT_EQ(report.verdict, LinkVerdict::inconsistent);
  EXPECT_GT(report.innovation, 100.0);
  EXPECT_FALSE(robot.policy().end_pose().closed_loop);
}

// Finding thresholds ------------------------------------------------------------------------------

TEST_F(CompactPoseTest, FindsThresholdsThatLoseNoLoopOfTheSample) {
  const Simulation world = simulate(registry, "manhattan:poses=250,streets=5");
  auto policy = make("range=1,angle=0.1,probability=0.1");
  auto* finder = query<OptionFinder>(*policy);
  ASSERT_NE(finder, nullptr);
  EXPECT_THAT(message_of([&] { finder->found(); }, ErrorCode::input), HasSubstr("no loop"));
  OptionValues watching = finder->watching();
  watching["probability"] = "0.1";
  const auto registration = registry.make<Registration>("simulated:range=2.5,angle=1");
  registration->begin({.recording = &world.graph, .truth = &world.truth});
  const PolicyRun sample = run(registry.make<PosePolicy>(ComponentSpec{"compact_pose", watching}),
                               *registration, world.graph);
  EXPECT_EQ(sample.kept().size(), 250U);
  const OptionValues found = query<OptionFinder>(*sample.policy)->found();
  // Loops are found out to 2.5 m and 1 rad, and the sensor is as good as the odometry.
  const double range = std::stod(found.at("range")), angle = std::stod(found.at("angle"));
  EXPECT_GT(range, 1.9);
  EXPECT_LT(range, 4.0);
  EXPECT_LT(angle, 1.1);
  EXPECT_THAT(found, Contains(Key("sensor")));

  // With all poses and all loops, the same are found again.
  OptionValues chosen = found;
  chosen["strategy"] = "apal";
  const PolicyRun again = run(registry.make<PosePolicy>(ComponentSpec{"compact_pose", chosen}),
                              *registration, world.graph);
  const auto linked = sample.links();
  EXPECT_EQ(std::set<Pair>(linked.begin(), linked.end()).size(), linked.size());
  const auto found_again = again.links();
  EXPECT_GT(found_again.size(), 50U);
  EXPECT_EQ(std::set<Pair>(linked.begin(), linked.end()),
            std::set<Pair>(found_again.begin(), found_again.end()));
}

}  // namespace
}  // namespace cairn::compact
