// SPDX-License-Identifier: BSD-3-Clause
#include "random_sequence.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include "cairn/lie/se2.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/update/marginal_prior.hpp"
#include "support/dense_system.hpp"

namespace cairn::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNoise = 0.03;
constexpr int kMostVariables = 14;
/// Estimators stop when chi2 hardly falls any more; a standard deviation is about 0.1.
constexpr double kFromMinimum = 1e-4;

/// Upper triangle of a random information of about 1/σ².
std::vector<double> information(std::mt19937& rng, int n) {
  std::uniform_real_distribution<double> uniform(0.5, 2.0);
  std::vector<double> packed;
  for (int row = 0; row < n; ++row) {
    for (int column = row; column < n; ++column)
      packed.push_back(row == column ? 100.0 * uniform(rng) : 10.0 * (uniform(rng) - 1.0));
  }
  return packed;
}

std::vector<double> copy(std::span<const double> x) { return {x.begin(), x.end()}; }

}  // namespace

RandomSequence::RandomSequence(Estimator& estimator, unsigned seed, bool smooths)
    : estimator_(estimator), rng_(seed), smooths_(smooths) {
  const KeptMarginals kept[] = {KeptMarginals::none, KeptMarginals::last, KeptMarginals::diagonal};
  estimator.keep_marginals(kept[rng_() % 3]);
}

void RandomSequence::run(int updates) {
  for (int k = 0; k < updates && !testing::Test::HasFailure(); ++k) {
    update_once();
    if (ended_) return;
    if (chance(0.05)) refuse_bad_update();
    if (chance(0.05)) what_if();
    if (chance(0.02)) {
      log_ += "reset\n";
      estimator_.reset();
      EXPECT_EQ(estimator_.variable_count(), 0);
      EXPECT_EQ(estimator_.factor_count(), 0);
      mirror_ = Graph();
      ids_ = FactorIds();
      last_pose_ = -1;
    }
  }
  if (testing::Test::HasFailure()) return;
  log_ += "full\n";
  estimator_.update({}, {.full = true});
  expect_solved();
}

void RandomSequence::update_once() {
  GraphUpdate update;
  propose(update);
  if (!well_posed(update)) return;
  UpdateOptions options;
  options.defer = chance(0.2);
  options.full = !options.defer && chance(0.3);
  if (options.defer) log_ += "  defer\n";
  if (options.full) log_ += "  full\n";

  const UpdateReport report = estimator_.update(update, options);
  EXPECT_TRUE(report.ok);
  EXPECT_EQ(report.first_factor, ids_.next());
  check_update(mirror_, ids_, update);
  const AppliedUpdate applied = apply_update(update, mirror_, ids_);
  if (!smooths_ && report.priors.size() != applied.priors.size()) {
    // Jacobians of different points contain information on the gauge, where measurements have none.
    ended_ = true;
    return;
  }
  EXPECT_EQ(report.priors, applied.priors);
  expect_same_graph(estimator_.graph());
  for (int v = 0; v < mirror_.variable_count() && !testing::Test::HasFailure(); ++v)
    mirror_.set_state(v, estimator_.state(mirror_.id(v)));
  if (options.full) expect_solved();
}

// What may happen ---------------------------------------------------------------------------------

void RandomSequence::propose(GraphUpdate& update) {
  const int count = mirror_.variable_count();
  if (last_pose_ < 0 || !mirror_.find(last_pose_)) last_pose_ = random_variable(true);
  const double what = uniform(0.0, 1.0);
  if (count < 2 || (what < 0.45 && count < kMostVariables)) {
    add_pose(update, count > 0 && !chance(0.05));
    if (chance(0.3) && count > 0) add_point(update);
  } else if (what < 0.55) {
    const Id a = random_variable(true), b = random_variable(chance(0.7));
    if (a >= 0 && b >= 0 && a != b) add_between(update, a, b);
  } else if (what < 0.62) {
    if (const Id a = random_variable(true); a >= 0) add_prior(update, a);
  } else if (what < 0.72) {
    change_factor(update);
  } else if (what < 0.82 && mirror_.factor_count() > 0) {
    update.removed_factors.push_back(
        ids_.id(static_cast<int>(rng_() % static_cast<unsigned>(mirror_.factor_count()))));
    log_ += fmt::format("remove factor {}\n", update.removed_factors.back());
  } else if (what < 0.88) {
    const Id leaves = random_variable(chance(0.6));
    if (leaves >= 0) update.removed_variables.push_back(leaves);
    log_ += fmt::format("remove variable {}\n", leaves);
  } else {
    for (int k = 0; k < 1 + static_cast<int>(rng_() % 2); ++k) {
      const Id leaves = random_variable(chance(0.8));
      if (leaves < 0 || std::ranges::count(update.marginalized, leaves) > 0) continue;
      update.marginalized.push_back(leaves);
      log_ += fmt::format("marginalize {}\n", leaves);
    }
    if (chance(0.5) && count < kMostVariables && last_pose_ >= 0 &&
        std::ranges::count(update.marginalized, last_pose_) == 0)
      add_pose(update, true);
  }
}

Id RandomSequence::random_variable(bool pose) {
  std::vector<Id> there;
  for (int v = 0; v < mirror_.variable_count(); ++v) {
    if (truth_.at(mirror_.id(v)).pose == pose) there.push_back(mirror_.id(v));
  }
  return there.empty() ? -1 : there[rng_() % there.size()];
}

std::vector<double> RandomSequence::noisy(VectorXd z) {
  std::normal_distribution<double> normal(0.0, kNoise);
  for (double& v : z) v += normal(rng_);
  return {z.begin(), z.end()};
}

std::vector<double> RandomSequence::measured(const Truth& a, const Truth& b) {
  if (b.pose) {
    return noisy(Se2::between<double>(a.x, b.x));
  }
  const double c = std::cos(a.x[2]), s = std::sin(a.x[2]);
  const Eigen::Vector2d d = b.x.head<2>() - a.x.head<2>();
  return noisy(Eigen::Vector2d(c * d[0] + s * d[1], c * d[1] - s * d[0]));
}

void RandomSequence::add_pose(GraphUpdate& update, bool connected) {
  const Id id = next_id_++;
  Truth truth{true, {uniform(-3, 3), uniform(-3, 3), uniform(-3, 3)}};
  Variable variable{types_.pose, id, {}, false};
  const bool odometry = connected && last_pose_ >= 0;
  if (odometry && chance(0.7)) {
    truth.x = Se2::compose<double>(truth_.at(last_pose_).x,
                                   Eigen::Vector3d(1.0, uniform(-0.3, 0.3), uniform(-0.6, 0.6)));
  }
  truth_.emplace(id, truth);
  if (!odometry || chance(0.2)) variable.state = noisy(truth.x);
  variable.fixed = !odometry && chance(0.3);
  log_ += fmt::format("pose {}{}{}\n", id, variable.fixed ? " fixed" : "",
                      variable.state.empty() ? "" : " with state");
  update.variables.push_back(std::move(variable));
  if (odometry) add_between(update, last_pose_, id);
  if (const Id other = random_variable(true);
      odometry && other >= 0 && other != last_pose_ && chance(0.4))
    add_between(update, other, id);
  last_pose_ = id;
}

void RandomSequence::add_point(GraphUpdate& update) {
  const Id id = next_id_++;
  truth_.emplace(id, Truth{false, {uniform(-3, 3), uniform(-3, 3), 0.0}});
  log_ += fmt::format("point {}\n", id);
  update.variables.push_back({types_.point, id, noisy(truth_.at(id).x.head<2>()), chance(0.05)});
  add_between(update, last_pose_, id);
  if (const Id other = random_variable(true); other >= 0 && other != last_pose_ && chance(0.5))
    add_between(update, other, id);
}

void RandomSequence::add_between(GraphUpdate& update, Id a, Id b) {
  const bool pose = truth_.at(b).pose;
  log_ += fmt::format("factor {} {}\n", a, b);
  update.factors.push_back({pose ? types_.relative_pose : types_.point_seen,
                            {a, b},
                            measured(truth_.at(a), truth_.at(b)),
                            information(rng_, pose ? 3 : 2)});
}

void RandomSequence::add_prior(GraphUpdate& update, Id a) {
  log_ += fmt::format("prior {}\n", a);
  update.factors.push_back({types_.prior, {a}, noisy(truth_.at(a).x), information(rng_, 3)});
}

void RandomSequence::change_factor(GraphUpdate& update) {
  if (mirror_.factor_count() == 0) return;
  const int f = static_cast<int>(rng_() % static_cast<unsigned>(mirror_.factor_count()));
  const FactorType& type = mirror_.factor_type(f);
  if (type.tag() == MarginalPrior::kTag) return;
  const auto on = mirror_.factor_variables(f);
  const Truth& a = truth_.at(mirror_.id(on[0]));
  ChangedFactor changed{
      ids_.id(f), on.size() == 1 ? noisy(a.x) : measured(a, truth_.at(mirror_.id(on[1]))), {}};
  if (chance(0.5)) changed.information = information(rng_, type.residual_size());
  log_ += fmt::format("change {}\n", changed.factor);
  update.changed.push_back(std::move(changed));
}

/// Whether H will be far from singular, and the graph still something.
bool RandomSequence::well_posed(const GraphUpdate& update) const {
  Graph graph = mirror_.clone();
  FactorIds ids = ids_;
  GraphUpdate checked = update;
  check_update(graph, ids, checked);
  apply_update(checked, graph, ids);
  const DenseSystem system = dense_system(graph);
  if (system.rows.empty()) return true;
  const VectorXd eigenvalues =
      Eigen::SelfAdjointEigenSolver<MatrixXd>(system.H, Eigen::EigenvaluesOnly).eigenvalues();
  return eigenvalues[0] > 1e-5 * eigenvalues[eigenvalues.size() - 1];
}

// What must not matter ----------------------------------------------------------------------------

void RandomSequence::refuse_bad_update() {
  if (mirror_.variable_count() == 0) return;
  const Graph before = estimator_.graph();
  GraphUpdate update;
  const Id there = mirror_.id(0);
  switch (rng_() % 5) {
    case 0:  // good so far, then a factor on nothing
      update.variables.push_back({types_.pose, next_id_ + 1000, {1.0, 2.0, 0.5}, false});
      update.factors.push_back({types_.relative_pose,
                                {next_id_ + 1000, next_id_ + 2000},
                                {0, 0, 0},
                                information(rng_, 3)});
      break;
    case 1:
      update.variables.push_back({types_.point, there, {1.0, 2.0}, false});
      break;
    case 2:
      update.removed_factors = {ids_.next() + 5};
      update.marginalized = {there};
      break;
    case 3:
      update.variables.push_back({types_.pose, next_id_ + 1000, {}, false});  // nowhere
      break;
    default:
      update.removed_variables = {there, there};
  }
  log_ += "bad update\n";
  try {
    estimator_.update(update);
    ADD_FAILURE() << "it was taken";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input) << error.what();
  }
  expect_same_graph(estimator_.graph());
  for (int v = 0; v < before.variable_count(); ++v)
    EXPECT_EQ(copy(estimator_.state(before.id(v))), copy(before.state(v)));
}

/// A copy goes on by itself, and neither knows of the other.
void RandomSequence::what_if() {
  if (mirror_.variable_count() == 0) return;
  log_ += "what if\n";
  const Graph before = estimator_.graph();
  {
    const std::unique_ptr<Estimator> copied = estimator_.clone();
    GraphUpdate update;
    update.variables.push_back({types_.pose, next_id_ + 1000, {5.0, 5.0, 1.0}, true});
    if (const Id pose = random_variable(true); pose >= 0) {
      update.factors.push_back(
          {types_.relative_pose, {pose, next_id_ + 1000}, {1.0, 0.0, 0.0}, information(rng_, 3)});
    }
    EXPECT_EQ(copied->update(update, {.full = true}).first_factor, ids_.next());
    EXPECT_EQ(copied->variable_count(), mirror_.variable_count() + 1);
  }
  expect_same_graph(estimator_.graph());
  for (int v = 0; v < before.variable_count(); ++v)
    EXPECT_EQ(copy(estimator_.state(before.id(v))), copy(before.state(v)));
}

// What must hold ----------------------------------------------------------------------------------

void RandomSequence::expect_same_graph(const Graph& estimated) const {
  ASSERT_EQ(estimator_.variable_count(), mirror_.variable_count());
  ASSERT_EQ(estimator_.factor_count(), mirror_.factor_count());
  ASSERT_EQ(estimated.variable_count(), mirror_.variable_count());
  ASSERT_EQ(estimated.factor_count(), mirror_.factor_count());
  for (int v = 0; v < mirror_.variable_count(); ++v) {
    ASSERT_TRUE(estimator_.has(mirror_.id(v)));
    const auto there = estimated.find(mirror_.id(v));
    ASSERT_TRUE(there) << mirror_.describe_variable(v);
    EXPECT_EQ(estimated.fixed(*there), mirror_.fixed(v));
    EXPECT_EQ(copy(estimated.state(*there)), copy(estimator_.state(mirror_.id(v))));
  }
  const auto described = [](const Graph& graph) {
    std::multimap<std::string, std::vector<double>> factors;
    for (int f = 0; f < graph.factor_count(); ++f)
      factors.emplace(graph.describe_factor(f), copy(graph.measurement(f)));
    return factors;
  };
  const auto a = described(estimated), b = described(mirror_);
  ASSERT_TRUE(std::ranges::equal(
      a, b, {}, [](const auto& f) { return f.first; }, [](const auto& f) { return f.first; }));
}

void RandomSequence::expect_solved() {
  Graph solved = estimator_.graph();
  double chi2 = 0.0;
  for (const double norm : squared_norms(solved)) chi2 += norm;
  EXPECT_NEAR(estimator_.chi2(), chi2, 1e-9 * (1.0 + chi2));
  if (!smooths_) return;
  solve_densely(solved);
  for (int v = 0; v < solved.variable_count(); ++v) {
    const VariableType& type = solved.type(v);
    VectorXd apart(type.tangent_size());
    type.local(1, solved.state(v).data(), estimator_.state(solved.id(v)).data(), apart.data());
    EXPECT_LT(apart.norm(), kFromMinimum)
        << solved.describe_variable(v) << " is away from the minimum";
  }
  if (!testing::Test::HasFailure()) expect_covariances(estimator_.graph());
}

void RandomSequence::expect_covariances(const Graph& graph) {
  const DenseSystem system = dense_system(graph);
  const MatrixXd Sigma = system.rows.empty() ? MatrixXd() : system.Sigma();
  const auto expected = [&](int a, int b) {
    MatrixXd block = MatrixXd::Zero(graph.type(a).tangent_size(), graph.type(b).tangent_size());
    const auto row = system.rows.find(graph.id(a)), column = system.rows.find(graph.id(b));
    if (row != system.rows.end() && column != system.rows.end())
      block = Sigma.block(row->second.first, column->second.first, block.rows(), block.cols());
    return block;
  };
  const double tolerance = 1e-4 * (Sigma.size() > 0 ? Sigma.diagonal().maxCoeff() : 1.0);
  std::vector<Id> all;
  for (int v = 0; v < graph.variable_count(); ++v) all.push_back(graph.id(v));
  for (int a = 0; a < graph.variable_count(); ++a) {
    MatrixXd column(graph.tangent_size(), graph.type(a).tangent_size());
    ASSERT_TRUE(estimator_.covariance_column(
        graph.id(a), all, {column.data(), static_cast<std::size_t>(column.size())}));
    Eigen::Index row = 0;
    for (int b = 0; b < graph.variable_count(); ++b) {
      const MatrixXd wanted = expected(b, a);
      MatrixXd block(wanted.rows(), wanted.cols());
      ASSERT_TRUE(estimator_.covariance(graph.id(b), graph.id(a),
                                        {block.data(), static_cast<std::size_t>(block.size())}));
      EXPECT_LT((block - wanted).norm(), tolerance)
          << "covariance of " << graph.id(b) << " and " << graph.id(a);
      EXPECT_LT((column.middleRows(row, wanted.rows()) - wanted).norm(), tolerance)
          << "covariance column of " << graph.id(a) << ", rows of " << graph.id(b);
      row += wanted.rows();
    }
  }
  if (all.size() > 1 && chance(0.2)) estimator_.keep_cross(all.front(), all.back());
}

}  // namespace cairn::test
