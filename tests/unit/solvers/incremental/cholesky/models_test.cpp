// SPDX-License-Identifier: BSD-3-Clause
// What becomes of linear models while variables move, against models of the same factors that are
// linearised where the variables are then.
#include "models.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include <Eigen/Dense>

#include "cairn/graph/graph.hpp"
#include "growing_graph.hpp"
#include "states.hpp"
#include "system.hpp"

namespace cairn::incremental {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

using Held = std::vector<std::uint8_t>;
const Held kNone = {0, 0, 0};

/// Two poses and a point that the first one sees, away from where measurements have them. Factor 0
/// is between the poses, factor 1 to the point.
class Three {
 public:
  explicit Three(const GrowingTypes& types, unsigned seed) : rng_(seed) {
    for (const auto& type : {types.pose, types.pose, types.point}) {
      std::vector<double> x(static_cast<std::size_t>(type->ambient_size()));
      type->identity(x.data());
      const int v = graph_.add_variable(type, graph_.variable_count(), x);
      states_.add(type, graph_.state(v));
    }
    for (const std::int32_t v : {0, 1, 2}) {
      move(v);
      states_.put_frame_here(v);
    }
    add(types.relative_pose, {0, 1});
    add(types.point_seen, {0, 2});
  }

  /// A step of one variable; returns it.
  VectorXd move(std::int32_t v) {
    VectorXd all = VectorXd::Zero(scalars());
    VectorXd step(size(v));
    for (double& number : step) number = std::uniform_real_distribution<double>(-0.3, 0.3)(rng_);
    all.segment(offset(v), size(v)) = step;
    const std::int32_t one[] = {v};
    states_.move(one, all.data());
    return all;
  }

  /// Both factors in a system of their own.
  System system_of(const Models& models, const Held& held) const {
    System system;
    for (int v = 0; v < 3; ++v) system.add_variable(size(v));
    for (const std::int32_t other : {1, 2}) {
      if (!held[0] && !held[static_cast<std::size_t>(other)]) system.connect(0, other);
    }
    for (const int f : {0, 1}) models.add_to(system, states_, f, 1.0, held);
    return system;
  }
  /// H and g of a system.
  MatrixXd H(const System& system) const {
    MatrixXd H = MatrixXd::Zero(scalars(), scalars());
    for (int v = 0; v < 3; ++v) {
      H.block(offset(v), offset(v), size(v), size(v)) =
          Eigen::Map<const MatrixXd>(system.diagonal(v), size(v), size(v));
      for (const System::Link& link : system.links(v)) {
        if (link.other < v) continue;
        const Eigen::Map<const MatrixXd> block(system.block(link.entry), size(v), size(link.other));
        H.block(offset(v), offset(link.other), size(v), size(link.other)) = block;
        H.block(offset(link.other), offset(v), size(link.other), size(v)) = block.transpose();
      }
    }
    return H;
  }
  VectorXd g(System& system, const Models& models) const {
    for (int v = 0; v < 3; ++v) models.right_hand_side(system, states_, v);
    return Eigen::Map<const VectorXd>(system.g().data(), scalars());
  }
  /// As a solution leaves it: the gradient has changed by H δ.
  static void note_step(System& system, const MatrixXd& H, const VectorXd& step) {
    Eigen::Map<VectorXd>(system.change(0), step.size()) += H * step;
  }
  /// Models that are linearised here.
  Models linearized() const {
    Models models;
    for (const int f : {0, 1}) {
      models.add(graph_, f);
      models.linearize(f, graph_, states_);
    }
    return models;
  }
  const Graph& graph() const { return graph_; }
  const States& states() const { return states_; }
  Eigen::Index scalars() const { return offset(2) + size(2); }

 private:
  int size(std::int32_t v) const { return graph_.type(v).tangent_size(); }
  Eigen::Index offset(std::int32_t v) const { return v * graph_.type(0).tangent_size(); }
  void add(const std::shared_ptr<const FactorType>& type, const std::vector<int>& variables) {
    std::vector<double> z(static_cast<std::size_t>(type->measurement_size()), 0.4), information;
    type->normalize(z.data());
    for (int row = 0; row < type->residual_size(); ++row) {
      for (int column = row; column < type->residual_size(); ++column)
        information.push_back(row == column ? 20.0 + row : 1.0);
    }
    graph_.add_factor(type, variables, z, information);
  }

  std::mt19937 rng_;
  Graph graph_;
  States states_;
};

class LinearModels : public testing::TestWithParam<bool> {
 protected:
  /// Calls test(three, moving) for every choice of variables that move.
  template <class Test>
  void for_all_motions(Test test) {
    for (unsigned moving = 0; moving < 8; ++moving) {
      SCOPED_TRACE(moving);
      Three three(GetParam() ? spatial_types() : planar_types(), moving);
      test(three, moving);
    }
  }
  /// Moves what is to move, twice, and keeps the system up to date.
  static void move(Three& three, unsigned moving, System& system) {
    const MatrixXd H = three.H(system);
    for (const std::int32_t v : {0, 1, 2, 0, 1, 2}) {
      if ((moving >> v) % 2 == 1) Three::note_step(system, H, three.move(v));
    }
  }
};

TEST_P(LinearModels, LeaveNothingWhereTheyAreTakenOut) {
  for_all_motions([](Three& three, unsigned moving) {
    const Models models = three.linearized();
    System system = three.system_of(models, kNone);
    const double size = three.H(system).norm();
    EXPECT_GT(three.g(system, models).norm(), 1.0);
    move(three, moving, system);
    for (const int f : {0, 1}) models.add_to(system, three.states(), f, -1.0, kNone);
    EXPECT_LT(three.H(system).norm(), 1e-13 * size);
    EXPECT_LT(three.g(system, models).norm(), 1e-12 * size);
  });
}

TEST_P(LinearModels, HaveTheGradientOfTheEstimateWhenTheyAreEvaluatedAgain) {
  for_all_motions([](Three& three, unsigned moving) {
    Models models = three.linearized();
    System system = three.system_of(models, kNone);
    const MatrixXd H = three.H(system);
    move(three, moving, system);
    for (const std::int32_t f : {0, 1}) {
      const std::int32_t one[] = {f};
      models.correct(one, three.graph(), three.states(), system, kNone);
      EXPECT_NEAR(models.cost(f), models.cost_now(f, three.graph(), three.states().estimate()),
                  1e-12 * H.norm());
    }
    const Models anew = three.linearized();
    System other = three.system_of(anew, kNone);
    EXPECT_LT((three.g(system, models) - three.g(other, anew)).norm(), 1e-12 * H.norm());
    EXPECT_EQ(three.H(system), H);
  });
}

/// A variable that was constant when its factors were evaluated, and is so no more.
TEST_P(LinearModels, HaveTheGradientOfWhatWasConstantToo) {
  for_all_motions([](Three& three, unsigned moving) {
    for (const Held& held : {Held{1, 0, 0}, Held{0, 1, 0}, Held{0, 0, 1}}) {
      Models models = three.linearized();
      System with_constant = three.system_of(models, held);
      move(three, moving, with_constant);
      for (const std::int32_t f : {0, 1}) {
        const std::int32_t one[] = {f};
        models.correct(one, three.graph(), three.states(), with_constant, held);
      }
      const Models anew = three.linearized();
      System system = three.system_of(models, kNone), other = three.system_of(anew, kNone);
      EXPECT_LT((three.g(system, models) - three.g(other, anew)).norm(),
                1e-12 * three.H(other).norm());
    }
  });
}

INSTANTIATE_TEST_SUITE_P(In, LinearModels, testing::Bool(),
                         [](const auto& test) { return test.param ? "Space" : "ThePlane"; });

}  // namespace
}  // namespace cairn::incremental
