// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz/targets/incremental_life.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "cairn/runtime/error.hpp"
#include "cairn/update/marginal_prior.hpp"
#include "support/dense_system.hpp"

namespace cairn::fuzz {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostVariables = 8, kMostSteps = 60;
/// The information of a measurement is about 1/kSigma².
constexpr double kSigma = 0.1;
/// H is far enough from singular for the dense solution to have digits to compare.
constexpr double kLargestCondition = 1e6;
/// A full step ends when chi2 hardly falls any more, as a fraction of it; and rounding.
constexpr double kConverged = 1e-6;
/// Of covariances at a new linearisation, as a fraction of the largest variance: rounding, times
/// the condition of H.
constexpr double kCovarianceRounding = 1e-4;
/// Relative change of a covariance per unit of a step [1/m, 1/rad], generously: what is measured is
/// about a metre away.
constexpr double kLargestChange = 10.0;

std::vector<double> copy(std::span<const double> x) { return {x.begin(), x.end()}; }

}  // namespace

/// First byte: bit 0 in space, bit 1 also badly conditioned graphs, bits 2 and 3 options, bits 4
/// and 5 the covariances that are kept.
IncrementalLife::IncrementalLife(Bytes bytes) : source_(bytes) {
  static constexpr std::array kEstimators = {
      "incremental_cholesky", "incremental_cholesky:accuracy=1e-6,significance=0",
      "incremental_cholesky:recent=0", "incremental_cholesky:full_every=3"};
  static constexpr std::array kAccuracies = {5e-3, 1e-6, 5e-3, 5e-3};
  static constexpr std::array kKept = {KeptMarginals::none, KeptMarginals::last,
                                       KeptMarginals::diagonal, KeptMarginals::none};
  const int choice = source_.byte();
  spatial_ = (choice & 1) != 0;
  only_well_posed_ = (choice & 2) == 0;
  Registry& types = registry();
  pose_ = types.variable_type(spatial_ ? "VERTEX_SE3:QUAT" : "VERTEX_SE2");
  point_ = types.variable_type(spatial_ ? "VERTEX_TRACKXYZ" : "VERTEX_XY");
  relative_pose_ = types.factor_type(spatial_ ? "EDGE_SE3:QUAT" : "EDGE_SE2");
  prior_ = types.factor_type(spatial_ ? "EDGE_PRIOR_SE3:QUAT" : "EDGE_PRIOR_SE2");
  point_seen_ = types.factor_type(spatial_ ? "EDGE_SE3_TRACKXYZ" : "EDGE_SE2_XY");
  const auto options = static_cast<std::size_t>(choice >> 2 & 3);
  estimator_ = types.make<Estimator>(kEstimators[options]);
  accuracy_ = kAccuracies[options];
  estimator_->keep_marginals(kKept[static_cast<std::size_t>(choice >> 4 & 3)]);
  log(fmt::format("{}, in {}", kEstimators[options], spatial_ ? "space" : "the plane"));
}

void IncrementalLife::run() {
  for (int step = 0; step < kMostSteps && !source_.empty(); ++step) propose();
  finish_update(Solve::full);
}

// What may happen ---------------------------------------------------------------------------------

void IncrementalLife::propose() {
  const int count = mirror_.variable_count() + static_cast<int>(update_.variables.size());
  const int what = source_.below(20);
  if (what < 6) {
    if (count < kMostVariables) add_pose(what > 0);
    if (what < 4) finish_update(Solve::ordinary);
  } else if (what == 6) {
    if (count < kMostVariables) add_point();
  } else if (what == 7) {
    const Id a = some(true), b = some(source_.below(3) > 0);
    if (a >= 0 && b >= 0 && a != b) add_measurement(a, b);
  } else if (what == 8) {
    if (const Id a = some(true); a >= 0) add_prior(a);
  } else if (what == 9) {
    change_factor();
  } else if (what == 10) {
    remove_factor();
  } else if (what == 11) {
    remove_variable();
  } else if (what < 14) {
    marginalize();
  } else if (what < 17) {
    finish_update(Solve::ordinary);
  } else if (what == 17) {
    finish_update(Solve::deferred);
  } else if (what == 18) {
    finish_update(Solve::full);
  } else {
    ask();
  }
}

bool IncrementalLife::is_pose(Id id) const {
  return std::ssize(truth_.at(id)) == pose_->ambient_size();
}

/// A variable that is there before the update, or is new in it.
Id IncrementalLife::some(bool pose) {
  std::vector<Id> there;
  for (int v = 0; v < mirror_.variable_count(); ++v) {
    if (is_pose(mirror_.id(v)) == pose) there.push_back(mirror_.id(v));
  }
  for (const Variable& variable : update_.variables) {
    if (is_pose(variable.id) == pose) there.push_back(variable.id);
  }
  return there.empty()
             ? -1
             : there[static_cast<std::size_t>(source_.below(static_cast<int>(there.size())))];
}

std::vector<double> IncrementalLife::random_pose() {
  VectorXd step(pose_->tangent_size());
  for (double& v : step) v = 3.0 * source_.unit();
  std::vector<double> x(static_cast<std::size_t>(pose_->ambient_size()));
  pose_->lie_group()->exp(step.data(), x.data());
  return x;
}

std::vector<double> IncrementalLife::noisy(const VariableType& type, std::vector<double> z) {
  VectorXd step(type.tangent_size());
  for (double& v : step) v = kSigma * source_.unit();
  const std::int64_t offset = 0;
  type.retract(1, z.data(), &offset, step.data(), z.data());
  return z;
}

/// Upper triangle, diagonally dominant.
std::vector<double> IncrementalLife::information(int size) {
  const double scale = 1.0 / (kSigma * kSigma);
  std::vector<double> packed;
  for (int row = 0; row < size; ++row) {
    for (int column = row; column < size; ++column)
      packed.push_back(scale * (row == column ? 1.25 + 0.75 * source_.unit() : 0.05));
  }
  return packed;
}

std::vector<double> IncrementalLife::measured(Id a, Id b) {
  const std::vector<double>&x = truth_.at(a), &y = truth_.at(b);
  if (is_pose(b)) {
    std::vector<double> inverse(x.size()), z(x.size());
    pose_->lie_group()->inverse(x.data(), inverse.data());
    pose_->lie_group()->compose(inverse.data(), y.data(), z.data());
    return noisy(*pose_, std::move(z));
  }
  std::vector<double> z(y.size());
  if (spatial_) {
    const Eigen::Quaterniond q(x[6], x[3], x[4], x[5]);
    Eigen::Map<Eigen::Vector3d>{z.data()} =
        q.conjugate() * (Eigen::Vector3d(y[0], y[1], y[2]) - Eigen::Vector3d(x[0], x[1], x[2]));
  } else {
    Eigen::Map<Eigen::Vector2d>{z.data()} =
        Eigen::Rotation2Dd(-x[2]) * Eigen::Vector2d(y[0] - x[0], y[1] - x[1]);
  }
  return noisy(*point_, std::move(z));
}

void IncrementalLife::add_pose(bool connected) {
  const Id id = next_id_++;
  const int how = source_.byte();
  if (last_pose_ < 0 || !mirror_.find(last_pose_)) last_pose_ = some(true);
  const bool odometry = connected && last_pose_ >= 0;
  truth_[id] = random_pose();
  Variable variable{pose_, id, {}, !odometry && how % 4 == 0};
  if (!odometry || how % 5 == 0) variable.state = noisy(*pose_, truth_[id]);
  log(fmt::format("pose {}{}{}", id, variable.fixed ? " fixed" : "",
                  variable.state.empty() ? "" : " with a state"));
  update_.variables.push_back(std::move(variable));
  if (odometry) add_measurement(last_pose_, id);
  last_pose_ = id;
}

void IncrementalLife::add_point() {
  const Id pose = some(true), other = some(true);
  if (pose < 0) return;
  const Id id = next_id_++;
  std::vector<double> x(static_cast<std::size_t>(point_->ambient_size()));
  for (double& v : x) v = 3.0 * source_.unit();
  truth_[id] = std::move(x);
  log(fmt::format("point {}", id));
  update_.variables.push_back({point_, id, noisy(*point_, truth_[id]), source_.below(16) == 1});
  add_measurement(pose, id);
  if (other != pose) add_measurement(other, id);
}

void IncrementalLife::add_measurement(Id a, Id b) {
  const auto& type = is_pose(b) ? relative_pose_ : point_seen_;
  log(fmt::format("{} {} {}", type->tag(), a, b));
  update_.factors.push_back({type, {a, b}, measured(a, b), information(type->residual_size())});
}

void IncrementalLife::add_prior(Id a) {
  log(fmt::format("prior {}", a));
  update_.factors.push_back(
      {prior_, {a}, noisy(*pose_, truth_.at(a)), information(prior_->residual_size())});
}

void IncrementalLife::change_factor() {
  if (mirror_.factor_count() == 0) return;
  const int f = source_.below(mirror_.factor_count());
  if (mirror_.factor_type(f).tag() == MarginalPrior::kTag) return;
  const auto on = mirror_.factor_variables(f);
  const Id a = mirror_.id(on[0]);
  ChangedFactor changed{
      ids_.id(f),
      on.size() == 1 ? noisy(*pose_, truth_.at(a)) : measured(a, mirror_.id(on[1])),
      {}};
  if (source_.below(2) == 0)
    changed.information = information(mirror_.factor_type(f).residual_size());
  log(fmt::format("change {}", changed.factor));
  update_.changed.push_back(std::move(changed));
}

void IncrementalLife::remove_factor() {
  if (mirror_.factor_count() == 0) return;
  update_.removed_factors.push_back(ids_.id(source_.below(mirror_.factor_count())));
  log(fmt::format("remove factor {}", update_.removed_factors.back()));
}

void IncrementalLife::remove_variable() {
  const Id id = some(source_.below(3) > 0);
  if (id < 0) return;
  update_.removed_variables.push_back(id);
  log(fmt::format("remove variable {}", id));
}

void IncrementalLife::marginalize() {
  const Id id = some(source_.below(4) > 0);
  if (id < 0) return;
  update_.marginalized.push_back(id);
  log(fmt::format("marginalize {}", id));
}

// Questions ---------------------------------------------------------------------------------------

void IncrementalLife::ask() {
  const int what = source_.below(7);
  log(fmt::format("ask {}", what));
  const auto before = states();
  if (before.empty()) return;
  const Id a = std::next(before.begin(), source_.below(static_cast<int>(before.size())))->first;
  if (what == 0) {
    expect_chi2();
  } else if (what == 1) {
    expect_same_graph(estimator_->graph());
  } else if (what == 2) {
    const auto b = std::next(before.begin(), source_.below(static_cast<int>(before.size())))->first;
    std::vector<double> block(static_cast<std::size_t>(estimator_->type(a)->tangent_size() *
                                                       estimator_->type(b)->tangent_size()));
    estimator_->covariance(a, b, block);
    estimator_->keep_cross(a, b);
  } else if (what == 3) {  // a copy goes on by itself
    const std::unique_ptr<Estimator> other = estimator_->clone();
    GraphUpdate alone;
    alone.variables.push_back({pose_, next_id_ + 1000, truth_.begin()->second, true});
    if (!is_pose(truth_.begin()->first)) return;
    alone.removed_variables = {a};
    other->update(alone, {.full = true});
    require(other->variable_count() == estimator_->variable_count(),
            [&] { return "a copy of another size"; });
  } else if (what == 4) {  // good so far, then a factor on nothing
    GraphUpdate bad;
    bad.marginalized = {a};
    bad.removed_factors = {ids_.next() + 5};
    bool taken = true;
    try {
      estimator_->update(bad);
    } catch (const Error& error) {
      taken = false;
      require(error.code() == ErrorCode::input, [&] { return error.what(); });
    }
    require(!taken, [&] { return "an update with a factor that is not there was taken"; });
  } else if (what == 5) {
    static constexpr std::array kKept = {KeptMarginals::none, KeptMarginals::last,
                                         KeptMarginals::diagonal};
    estimator_->keep_marginals(kKept[static_cast<std::size_t>(source_.below(3))]);
  } else {
    estimator_->reset();
    mirror_ = Graph();
    ids_ = FactorIds();
    update_ = {};
    require(estimator_->variable_count() == 0 && estimator_->factor_count() == 0,
            [&] { return "not reset"; });
    return;
  }
  expect_unchanged(before);
}

std::map<Id, std::vector<double>> IncrementalLife::states() {
  std::map<Id, std::vector<double>> all;
  for (int v = 0; v < mirror_.variable_count(); ++v)
    all[mirror_.id(v)] = copy(estimator_->state(mirror_.id(v)));
  return all;
}

void IncrementalLife::expect_unchanged(const std::map<Id, std::vector<double>>& states) {
  for (const auto& state : states) {
    require(copy(estimator_->state(state.first)) == state.second,
            [&] { return fmt::format("a question moved variable {}", state.first); });
  }
}

// Updates -----------------------------------------------------------------------------------------

void IncrementalLife::finish_update(Solve how) {
  GraphUpdate update = std::exchange(update_, {});
  static constexpr std::array kNames = {"solve", "defer", "full"};
  log(kNames[static_cast<std::size_t>(how)]);
  GraphUpdate checked = update;
  Graph after = mirror_.clone();
  FactorIds ids = ids_;
  AppliedUpdate applied;
  const auto before = states();
  try {
    check_update(after, ids, checked);
    applied = apply_update(checked, after, ids);
  } catch (const Error& error) {
    const std::string why = error.what();
    bool taken = true;
    try {
      estimator_->update(update);
    } catch (const Error& other) {
      taken = other.code() != error.code();
    }
    require(!taken, [&] { return "taken, though it is refused: " + why; });
    return expect_unchanged(before);
  }
  const bool good = well_posed(after);
  if (only_well_posed_ && !good) return;
  const UpdateReport report =
      estimator_->update(update, {.defer = how == Solve::deferred, .full = how == Solve::full});
  mirror_ = std::move(after);
  ids_ = std::move(ids);
  require(report.priors == applied.priors && report.first_factor == applied.first_factor,
          [&] { return "factors have other numbers"; });
  const Graph estimated = estimator_->graph();
  expect_same_graph(estimated);
  for (int v = 0; v < mirror_.variable_count(); ++v)
    mirror_.set_state(v, estimator_->state(mirror_.id(v)));
  if (!only_well_posed_) return;
  require(report.ok, [&] { return "a system that is well conditioned is called singular"; });
  expect_chi2();
  if (how == Solve::full && !report.converged) {
    // Steps of Gauss-Newton that converge too slowly for the limit of iterations, in large
    // residuals: it says so, and what they would still change is as little as after any update.
    require(std::ranges::any_of(
                report.notes,
                [](const std::string& note) { return note.starts_with("not converged"); }),
            [&] { return "not converged, without a word"; });
    expect_minimum(10.0 * accuracy_, 0.01);
  } else if (how == Solve::full) {
    expect_minimum(kConverged, kConverged);
    expect_covariances(estimated, kCovarianceRounding);
  } else if (how == Solve::ordinary && report.owed == 0) {
    // The accuracy is that of an estimate of what is left, of first order, and a hundredth of the
    // noise is no matter.
    expect_minimum(10.0 * accuracy_, 0.01);
  }
}

/// By the condition of H in the 1-norm.
bool IncrementalLife::well_posed(const Graph& graph) {
  const test::DenseSystem system = test::dense_system(graph);
  if (system.rows.empty()) return true;
  const MatrixXd Sigma = system.Sigma();
  const auto norm = [](const MatrixXd& A) { return A.cwiseAbs().colwise().sum().maxCoeff(); };
  return Sigma.allFinite() && norm(system.H) * norm(Sigma) < kLargestCondition;
}

// What must hold ----------------------------------------------------------------------------------

void IncrementalLife::expect_same_graph(const Graph& estimated) {
  require(estimator_->variable_count() == mirror_.variable_count() &&
              estimator_->factor_count() == mirror_.factor_count() &&
              estimated.variable_count() == mirror_.variable_count() &&
              estimated.factor_count() == mirror_.factor_count(),
          [&] { return "another number of variables or factors"; });
  for (int v = 0; v < mirror_.variable_count(); ++v) {
    const auto there = estimated.find(mirror_.id(v));
    require(there && estimator_->has(mirror_.id(v)) &&
                estimated.fixed(*there) == mirror_.fixed(v) &&
                copy(estimated.state(*there)) == copy(estimator_->state(mirror_.id(v))),
            [&] { return "differs: " + mirror_.describe_variable(v); });
  }
  for (int f = 0; f < mirror_.factor_count(); ++f)
    require(estimator_->has_factor(ids_.id(f)),
            [&] { return fmt::format("there is no factor {}", ids_.id(f)); });
}

/// chi2 is that of the estimate, whatever was deferred: a sum of a few terms, up to rounding.
void IncrementalLife::expect_chi2() {
  const double got = estimator_->chi2(), wanted = chi2(estimator_->graph());
  require(std::abs(got - wanted) <= 1e-9 * (1.0 + wanted),
          [&] { return fmt::format("chi2 is {}, and of the estimate {}", got, wanted); });
}

/// By how much a step would lower chi2, as a linear model of all factors at the estimate predicts
/// it: gᵀH⁻¹g. (Gauss-Newton's iterations need not converge where residuals are large.)
void IncrementalLife::expect_minimum(double fraction, double slack) {
  const Graph estimated = estimator_->graph();
  const test::DenseSystem system = test::dense_system(estimated);
  if (system.rows.empty()) return;
  const VectorXd step = system.Sigma() * system.g;
  const double decrease = system.g.dot(step), now = chi2(estimated);
  require(decrease <= fraction * now + slack, [&] {
    return fmt::format("chi2 is {}, and a step would lower it by {}", now, decrease);
  });
}

void IncrementalLife::expect_covariances(const Graph& graph, double tolerance) {
  const test::DenseSystem system = test::dense_system(graph);
  const MatrixXd Sigma = system.rows.empty() ? MatrixXd() : system.Sigma();
  // It is that of the last linearisation, a step before the estimate: where Gauss-Newton converges
  // slowly, in large residuals, that step is no rounding, and blocks change with it in proportion.
  const double step = Sigma.size() > 0 ? (Sigma * system.g).norm() : 0.0;
  const double allowed =
      (tolerance + kLargestChange * step) * (Sigma.size() > 0 ? Sigma.diagonal().maxCoeff() : 1.0);
  for (int a = 0; a < graph.variable_count(); ++a) {
    for (int b = 0; b < graph.variable_count(); ++b) {
      MatrixXd wanted = MatrixXd::Zero(graph.type(a).tangent_size(), graph.type(b).tangent_size());
      const auto row = system.rows.find(graph.id(a)), column = system.rows.find(graph.id(b));
      if (row != system.rows.end() && column != system.rows.end())
        wanted = Sigma.block(row->second.first, column->second.first, wanted.rows(), wanted.cols());
      MatrixXd block(wanted.rows(), wanted.cols());
      const bool there = estimator_->covariance(
          graph.id(a), graph.id(b), {block.data(), static_cast<std::size_t>(block.size())});
      require(there && (block - wanted).norm() <= allowed, [&] {
        return fmt::format("the covariance of {} and {} is wrong by {}", graph.id(a), graph.id(b),
                           there ? (block - wanted).norm() : -1.0);
      });
    }
  }
}

}  // namespace cairn::fuzz
