// SPDX-License-Identifier: BSD-3-Clause
// Filters against each other, against batch where the two must agree, and against dense formulas.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "../random_sequence.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/lie/point.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/types/define_factor.hpp"
#include "cairn/types/define_variable.hpp"
#include "support/components.hpp"
#include "support/sample_graphs.hpp"

namespace cairn::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Contains;
using testing::HasSubstr;

/// b - a, and a alone: factors that are linear.
struct Difference {
  static constexpr std::string_view kTag = "DIFFERENCE";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<PointXY, PointXY>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 2>& a, const Vector<S, 2>& b,
                               const Vector<double, 2>& z) {
    return {b[0] - a[0] - z[0], b[1] - a[1] - z[1]};
  }
};
struct Position {
  static constexpr std::string_view kTag = "POSITION";
  static constexpr int kResidual = 2, kMeasurement = 2;
  using Variables = std::tuple<PointXY>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 2>& a, const Vector<double, 2>& z) {
    return {a[0] - z[0], a[1] - z[1]};
  }
};

/// Not a number beyond x = 50.
struct Bounded {
  static constexpr std::string_view kTag = "BOUNDED";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<PointXY>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 2>& a, const Vector<double, 1>& z) {
    using std::sqrt;
    return Vector<S, 1>(sqrt(50.0 - a[0]) - z[0]);
  }
};

const std::vector<double> kCorrelated = {4.0, 1.0, 9.0};

class Filters : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    if (!registry_.has("estimator", GetParam())) GTEST_SKIP() << "not built";
    estimator_ = registry_.make<Estimator>(GetParam());
  }
  Variable point(Id id, double x = 0.0, double y = 0.0) const { return {point_, id, {x, y}}; }
  Factor difference(Id a, Id b, double x, double y) const {
    return {difference_, {a, b}, {x, y}, kCorrelated};
  }
  Factor position(Id a, double x, double y, std::vector<double> information = kCorrelated) const {
    return {position_, {a}, {x, y}, std::move(information)};
  }

  std::shared_ptr<const VariableType> point_ = define_variable<PointXY>();
  std::shared_ptr<const FactorType> difference_ = define_factor<Difference>();
  std::shared_ptr<const FactorType> position_ = define_factor<Position>();
  Registry registry_;
  std::unique_ptr<Estimator> estimator_;
};
INSTANTIATE_TEST_SUITE_P(Registered, Filters, testing::Values("ekf", "eif"),
                         [](const auto& named) { return named.param; });

MatrixXd covariance(Estimator& estimator) {
  const std::vector<Id> all = estimator.variables();
  const Graph graph = estimator.graph();
  MatrixXd Sigma(graph.tangent_size(), graph.tangent_size());
  Eigen::Index at = 0;
  for (const Id id : all) {
    const auto size = estimator.type(id)->tangent_size();
    EXPECT_TRUE(estimator.covariance_column(
        id, all, {Sigma.col(at).data(), static_cast<std::size_t>(Sigma.rows() * size)}));
    at += size;
  }
  return Sigma;
}

void expect_same(Estimator& a, Estimator& b, double tolerance) {
  ASSERT_EQ(a.variables(), b.variables());
  for (const Id id : a.variables()) {
    VectorXd apart(a.type(id)->tangent_size());
    a.type(id)->local(1, a.state(id).data(), b.state(id).data(), apart.data());
    EXPECT_LT(apart.norm(), tolerance) << id;
  }
  const MatrixXd P = covariance(a), Q = covariance(b);
  if (P.size() > 0) {
    EXPECT_LT((P - Q).cwiseAbs().maxCoeff(), tolerance * (1.0 + Q.cwiseAbs().maxCoeff()));
  }
}

TEST_P(Filters, AreBatchOnALinearGraphWhateverHappens) {
  CAIRN_NEEDS("estimator", "batch");
  CAIRN_NEEDS("optimizer", "gauss_newton");
  const auto batch =
      registry_.make<Estimator>("batch:optimizer=gauss_newton,tolerance=0,iterations=3");
  std::mt19937 rng(7);
  std::normal_distribution<double> noise(0.0, 0.3);
  for (int k = 0; k < 40; ++k) {
    GraphUpdate update;
    update.variables.push_back(point(k, 3.0 * noise(rng), 3.0 * noise(rng)));
    if (k == 0) update.factors.push_back(position(0, 1.0, 2.0));
    if (k > 0) update.factors.push_back(difference(k - 1, k, 1.0 + noise(rng), noise(rng)));
    if (k > 5 && k % 3 == 0)
      update.factors.push_back(difference(k - 5, k, 5.0 + noise(rng), noise(rng)));
    if (k == 20) update.changed.push_back({10, {1.5, 0.4}, {8.0, 0.0, 2.0}});
    if (k == 25) update.marginalized = {4, 5};
    if (k == 28) update.removed_factors = {30};
    if (k == 30) update.removed_variables = {11};
    if (k == 32) update.factors.push_back(position(20, 18.0, 1.0));
    const UpdateOptions options{.defer = k % 7 == 3};
    const UpdateReport report = estimator_->update(update, options);
    EXPECT_TRUE(report.ok);
    EXPECT_EQ(report.priors, batch->update(update, options).priors);
    if (!options.defer) expect_same(*estimator_, *batch, 1e-9);
  }
  const UpdateReport report = estimator_->update({}, {.full = true});
  EXPECT_TRUE(report.converged);
  EXPECT_NEAR(estimator_->chi2(), batch->chi2(), 1e-9 * batch->chi2());
}

/// What the definition says, in dense matrices: each factor linearised at the mean of its arrival,
/// the mean moved by the change of the displacement.
class DenseFilter {
 public:
  explicit DenseFilter(const Graph& graph)
      : graph_(graph.clone()), held_(resolve_gauge(graph).held) {
    int size = 0;
    for (int v = 0; v < graph.variable_count(); ++v) {
      offset_.push_back(held_[v] ? -1 : size);
      size += held_[v] ? 0 : graph.type(v).tangent_size();
    }
    Lambda_ = MatrixXd::Zero(size, size);
    eta_ = d_ = VectorXd::Zero(size);
  }
  void place(int variable, std::span<const double> x) { graph_.set_state(variable, x); }
  /// These factors, on the first `variables` variables.
  void update(const std::vector<int>& factors, int variables) {
    std::vector<std::pair<MatrixXd, VectorXd>> models;
    for (const int f : factors) take(f);
    int n = 0;
    for (int v = 0; v < variables; ++v) n += held_[v] ? 0 : graph_.type(v).tangent_size();
    const VectorXd next = Lambda_.topLeftCorner(n, n).ldlt().solve(eta_.head(n));
    for (int v = 0; v < variables; ++v) {
      if (held_[v]) continue;
      const VectorXd step = (next - d_.head(n)).segment(offset_[v], graph_.type(v).tangent_size());
      std::vector<double> x(graph_.state(v).size());
      const std::int64_t zero = 0;
      graph_.type(v).retract(1, graph_.state(v).data(), &zero, step.data(), x.data());
      graph_.set_state(v, x);
    }
    d_.head(n) = next;
    size_ = n;
  }
  const Graph& graph() const { return graph_; }
  MatrixXd Sigma() const { return Lambda_.topLeftCorner(size_, size_).inverse(); }
  int offset(int variable) const { return offset_[variable]; }

 private:
  void take(int f) {
    const FactorType& type = graph_.factor_type(f);
    const auto on = graph_.factor_variables(f);
    std::vector<const double*> x;
    std::vector<MatrixXd> J;
    std::vector<double*> to;
    for (std::size_t k = 0; k < on.size(); ++k) {
      x.push_back(graph_.state(on[k]).data());
      J.emplace_back(type.residual_size(), type.tangent_size(static_cast<int>(k)));
    }
    for (MatrixXd& block : J) to.push_back(block.data());
    VectorXd r(type.residual_size());
    type.evaluate(x.data(), graph_.measurement(f).data(), graph_.sqrt_information(f).data(),
                  r.data(), to.data());
    MatrixXd whole = MatrixXd::Zero(r.size(), eta_.size());
    for (std::size_t k = 0; k < on.size(); ++k) {
      if (!held_[on[k]]) whole.middleCols(offset_[on[k]], J[k].cols()) = J[k];
    }
    Lambda_ += whole.transpose() * whole;
    eta_ += whole.transpose() * (whole * d_ - r);
  }

  Graph graph_;
  std::vector<bool> held_;
  std::vector<int> offset_;
  MatrixXd Lambda_;
  VectorXd eta_, d_;
  int size_ = 0;
};

TEST_P(Filters, AreTheDenseFilterOnANonlinearGraph) {
  for (Graph& graph : std::array{ring_of_poses(30, 0.1), poses_and_points(16, 0.1)}) {
    graph.set_fixed(0);
    DenseFilter dense(graph);
    const auto estimator = registry_.make<Estimator>(GetParam());
    std::vector<bool> taken(static_cast<std::size_t>(graph.factor_count()), false);
    for (int v = 0; v < graph.variable_count(); ++v) {
      GraphUpdate update;
      update.variables.push_back(graph.variable(v));
      std::vector<int> factors;
      for (int f = 0; f < graph.factor_count(); ++f) {
        const auto on = graph.factor_variables(f);
        if (taken[f] || std::ranges::any_of(on, [&](std::int32_t each) { return each > v; }))
          continue;
        taken[f] = true;
        factors.push_back(f);
        update.factors.push_back(graph.factor(f));
      }
      ASSERT_TRUE(estimator->update(update).ok);
      dense.update(factors, v + 1);
    }
    const MatrixXd Sigma = dense.Sigma();
    for (int v = 1; v < graph.variable_count(); ++v) {
      const auto size = graph.type(v).tangent_size();
      VectorXd apart(size);
      graph.type(v).local(1, dense.graph().state(v).data(), estimator->state(graph.id(v)).data(),
                          apart.data());
      EXPECT_LT(apart.norm(), 1e-9) << graph.describe_variable(v);
      MatrixXd block(size, size);
      ASSERT_TRUE(estimator->covariance(graph.id(v), graph.id(v),
                                        {block.data(), static_cast<std::size_t>(block.size())}));
      const MatrixXd wanted = Sigma.block(dense.offset(v), dense.offset(v), size, size);
      EXPECT_LT((block - wanted).norm(), 1e-9 * wanted.norm()) << graph.describe_variable(v);
    }
  }
}

TEST_P(Filters, AreNotAtTheMinimumOfANonlinearGraphAndSaySo) {
  CAIRN_NEEDS("estimator", "batch");
  const Graph graph = ring_of_poses(40, 0.1);
  const auto batch = registry_.make<Estimator>("batch");
  for (int v = 0; v < graph.variable_count(); ++v) {
    GraphUpdate update;
    update.variables.push_back(graph.variable(v));
    for (int f = 0; f < graph.factor_count(); ++f) {
      if (std::ranges::max(graph.factor_variables(f)) == v)
        update.factors.push_back(graph.factor(f));
    }
    estimator_->update(update);
    batch->update(update);
  }
  const UpdateReport report = estimator_->update({}, {.full = true});
  EXPECT_FALSE(report.converged);
  EXPECT_THAT(report.notes, Contains(HasSubstr("linearises each factor once")));
  EXPECT_GT(estimator_->chi2(), batch->chi2() * (1.0 + 1e-6));
}

TEST_P(Filters, WaitForWhatDeterminesAVariable) {
  GraphUpdate update;
  update.variables = {point(0), point(1)};
  update.factors = {position(0, 1.0, 2.0), position(1, 3.0, 0.0, {1.0, 0.0, 0.0})};
  UpdateReport report = estimator_->update(update);
  EXPECT_FALSE(report.ok);
  EXPECT_THAT(report.notes, Contains(HasSubstr("VERTEX_XY 1 is free")));
  update = {};
  update.factors = {difference(0, 1, 2.0, 2.0)};
  report = estimator_->update(update);
  EXPECT_TRUE(report.ok);
  EXPECT_NEAR(estimator_->state(0)[0], 1.0, 1e-12);
  EXPECT_NEAR(estimator_->state(1)[0], 3.0, 1e-12);
  EXPECT_NEAR(estimator_->state(1)[1], 4.0, 1e-12);
}

TEST_P(Filters, AreAsTheyWereWhereAFactorCannotBeLinearised) {
  GraphUpdate update;
  update.variables = {point(0), point(1)};
  update.factors = {position(0, 1.0, 2.0), difference(0, 1, 2.0, 2.0)};
  estimator_->update(update);
  update = {};
  update.variables = {point(2, 60.0, 0.0)};
  update.factors = {difference(1, 2, 57.0, -4.0), {define_factor<Bounded>(), {2}, {1.0}, {1.0}}};
  EXPECT_THROW(estimator_->update(update), Error);
  EXPECT_EQ(estimator_->variable_count(), 2);
  EXPECT_EQ(estimator_->factor_count(), 2);
  update.factors.pop_back();
  EXPECT_EQ(estimator_->update(update).first_factor, 2);
  EXPECT_NEAR(estimator_->state(2)[0], 60.0, 1e-9);
  EXPECT_EQ(covariance(*estimator_).rows(), 6);
}

/// The same random life, in which everything happens that can happen to an estimator.
TEST(Filter, EkfAndEifAreTheSame) {
  Registry registry;
  CAIRN_NEEDS("estimator", "ekf");
  CAIRN_NEEDS("estimator", "eif");
  for (unsigned seed = 1; seed <= 100; ++seed) {
    const auto ekf = registry.make<Estimator>("ekf"), eif = registry.make<Estimator>("eif");
    RandomSequence(*ekf, seed, false).run(20);
    RandomSequence(*eif, seed, false).run(20);
    expect_same(*ekf, *eif, 1e-7);
    ASSERT_FALSE(testing::Test::HasFailure()) << "seed " << seed;
  }
}

TEST(Ekf, RefusesMoreThanItHasRoomFor) {
  Registry registry;
  CAIRN_NEEDS("estimator", "ekf");
  const auto ekf = registry.make<Estimator>("ekf:max_size=30");
  GraphUpdate update;
  const Graph graph = ring_of_poses(12, 0.1);
  for (int v = 0; v < graph.variable_count(); ++v) update.variables.push_back(graph.variable(v));
  for (int f = 0; f < graph.factor_count(); ++f) update.factors.push_back(graph.factor(f));
  try {
    ekf->update(update);
    ADD_FAILURE() << "it was taken";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("max_size=36"));
    EXPECT_THAT(error.what(), HasSubstr("eif"));
  }
  EXPECT_EQ(ekf->variable_count(), 0);
}

}  // namespace
}  // namespace cairn::test
