// SPDX-License-Identifier: BSD-3-Clause
#include "failing_updates.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"
#include "cairn/update/marginal_prior.hpp"

namespace cairn::test {

void ThrowingLoss::evaluate(std::span<const double> s, std::span<double> rho,
                            std::span<double> weight) const {
  fuse_->evaluate();
  for (std::size_t k = 0; k < s.size(); ++k) {
    const double root = std::sqrt(1.0 + s[k]);
    if (!rho.empty()) rho[k] = 2.0 * (root - 1.0);
    if (!weight.empty()) weight[k] = 1.0 / root;
  }
}

double ThrowingLoss::second_derivative(double s) const { return -0.5 / std::pow(1.0 + s, 1.5); }

namespace {

constexpr std::size_t kMostVariables = 16;

/// Everything that an estimator answers, as numbers.
std::vector<double> held_by(Estimator& estimator) {
  std::vector<double> all{static_cast<double>(estimator.variable_count()),
                          static_cast<double>(estimator.factor_count()), estimator.chi2()};
  const auto append = [&](std::span<const double> numbers) {
    all.insert(all.end(), numbers.begin(), numbers.end());
  };
  const std::vector<Id> variables = estimator.variables();
  for (const Id id : variables) {
    all.push_back(static_cast<double>(id));
    append(estimator.state(id));
  }
  for (const FactorId id : estimator.factors()) {
    const Factor factor = estimator.factor(id);
    all.push_back(static_cast<double>(id));
    append(factor.measurement);
    append(factor.information);
    all.push_back(factor.loss ? 1.0 : 0.0);
  }
  for (std::size_t k = 0; k < variables.size(); k += 3) {
    const Id a = variables[k], b = variables[variables.size() - 1 - k / 2];
    std::vector<double> block(static_cast<std::size_t>(estimator.type(a)->tangent_size()) *
                              static_cast<std::size_t>(estimator.type(b)->tangent_size()));
    all.push_back(estimator.covariance(a, b, block) ? 1.0 : 0.0);
    append(block);
  }
  return all;
}

bool same_bits(std::span<const double> a, std::span<const double> b) {
  return std::ranges::equal(
      a, b, [](double x, double y) { return x == y || (std::isnan(x) && std::isnan(y)); });
}

std::vector<double> information(double of_position, int n) {
  if (n == 2) return {of_position, 0.0, of_position};
  return {of_position, 0.0, 0.0, of_position, 0.0, 4.0 * of_position};
}

}  // namespace

FailingUpdates::FailingUpdates(Estimator& estimator, Estimator& twin, const ThrowingTypes& types,
                               unsigned seed, int at_most)
    : estimator_(estimator), twin_(twin), types_(types), random_(seed), at_most_(at_most) {
  if (chance(0.3)) lag_ = 6;
  const KeptMarginals kept[] = {KeptMarginals::none, KeptMarginals::last, KeptMarginals::diagonal};
  const KeptMarginals one = kept[up_to(3)];
  for (Estimator* each : {&estimator_, &twin_}) each->keep_marginals(one);
}

void FailingUpdates::run(int updates) {
  for (int k = 0; k < updates && !testing::Test::HasFailure(); ++k) {
    once();
    if (chance(0.08)) change_settings();
  }
}

void FailingUpdates::once() {
  const GraphUpdate update = propose();
  UpdateOptions options;
  options.defer = chance(0.2);
  options.full = !options.defer && chance(0.2);
  log_ += options.defer ? "  defer\n" : options.full ? "  full\n" : "";
  try_to_fail(update, options);
  if (testing::Test::HasFailure()) return;
  UpdateReport of_twin, report;
  std::string refused, of_twin_refused;
  try {
    of_twin = twin_.update(update, options);
  } catch (const Error& error) {  // on numbers
    of_twin_refused = error.what();
  }
  try {
    report = estimator_.update(update, options);
  } catch (const Error& error) {
    refused = error.what();
  }
  EXPECT_EQ(refused, of_twin_refused);
  EXPECT_EQ(report.ok, of_twin.ok);
  EXPECT_EQ(report.converged, of_twin.converged);
  EXPECT_EQ(report.first_factor, of_twin.first_factor);
  EXPECT_EQ(report.priors, of_twin.priors);
  EXPECT_EQ(report.notes, of_twin.notes);
  expect_twins();
}

/// Of a copy of the twin, which knows of no failure.
int FailingUpdates::evaluations_of(const GraphUpdate& update, const UpdateOptions& options) {
  const std::unique_ptr<Estimator> copy = twin_.clone();
  const int before = types_.fuse->evaluations;
  try {
    copy->update(update, options);
  } catch (const Error&) {  // on numbers
  }
  return types_.fuse->evaluations - before;
}

void FailingUpdates::try_to_fail(const GraphUpdate& update, const UpdateOptions& options) {
  const int all = evaluations_of(update, options);
  const int step = std::max(1, all / at_most_);
  for (int at = 1 + static_cast<int>(up_to(static_cast<std::size_t>(step))); at <= all;
       at += step) {
    types_.fuse->light(at);
    std::string problem;
    try {
      estimator_.update(update, options);
    } catch (const Error& error) {
      problem = error.what();
    }
    if (types_.fuse->burns()) {  // it was refused on numbers before, or evaluates fewer
      types_.fuse->light(0);
      ASSERT_FALSE(problem.empty()) << "evaluation " << at << " of " << all << " did not come";
    } else {
      ASSERT_NE(problem.find("burnt"), std::string::npos) << problem;
      ASSERT_TRUE(problem.starts_with("factor '") || problem.starts_with("the loss of factor '"))
          << problem;
    }
    ++failures_;
    SCOPED_TRACE(fmt::format("evaluation {} of {} has failed: {}", at, all, problem));
    expect_twins();
    if (testing::Test::HasFailure()) return;
  }
}

void FailingUpdates::change_settings() {
  const std::vector<Id> variables = twin_.variables();
  if (chance(0.5) || variables.empty()) {
    const std::shared_ptr<const Loss> loss = chance(0.7) ? types_.loss : nullptr;
    log_ += loss ? "loss\n" : "no loss\n";
    const FactorSelector which = chance(0.5) ? FactorSelector::loops() : FactorSelector();
    const std::unique_ptr<Estimator> copy = twin_.clone();
    const int before = types_.fuse->evaluations;
    copy->set_loss(loss, which);
    if (const int all = types_.fuse->evaluations - before; all > 0) {
      types_.fuse->light(1 + static_cast<int>(up_to(static_cast<std::size_t>(all))));
      EXPECT_THROW(estimator_.set_loss(loss, which), Error);
      expect_twins();
    }
    for (Estimator* each : {&twin_, &estimator_}) each->set_loss(loss, which);
  } else {
    const Id a = variables[up_to(variables.size())], b = variables[up_to(variables.size())];
    log_ += fmt::format("keep {} {}\n", a, b);
    for (Estimator* each : {&twin_, &estimator_}) each->keep_cross(a, b);
  }
  expect_twins();
}

void FailingUpdates::expect_twins() {
  EXPECT_EQ(estimator_.variables(), twin_.variables());
  EXPECT_EQ(estimator_.factors(), twin_.factors());
  if (testing::Test::HasFailure()) return;
  EXPECT_TRUE(same_bits(held_by(estimator_), held_by(twin_)))
      << "chi2 " << estimator_.chi2() << ", of the twin " << twin_.chi2();
}

// What may happen ---------------------------------------------------------------------------------

bool FailingUpdates::is_pose(Id id) const { return twin_.type(id)->tangent_size() == 3; }

std::optional<Id> FailingUpdates::some_variable(bool pose) {
  std::vector<Id> there = twin_.variables();
  std::erase_if(there, [&](Id id) { return is_pose(id) != pose; });
  if (there.empty()) return {};
  return there[up_to(there.size())];
}

GraphUpdate FailingUpdates::propose() {
  GraphUpdate update;
  const std::size_t count = twin_.variables().size();
  const double what = std::uniform_real_distribution<double>(0.0, 1.0)(random_);
  if (count < 3 || (what < 0.5 && count < kMostVariables)) {
    add_pose(update);
    if (chance(0.3)) add_point(update);
  } else if (what < 0.6) {
    const auto a = some_variable(true), b = some_variable(chance(0.6));
    if (a && b && *a != *b) add_between(update, *a, *b);
  } else if (what < 0.65) {
    if (const auto a = some_variable(true)) {
      const std::span<const double> x = twin_.state(*a);
      update.factors.push_back({types_.prior,
                                {*a},
                                {x[0] + noise(), x[1] + noise(), x[2] + noise()},
                                information(50, 3)});
      log_ += fmt::format("prior {}\n", *a);
    }
  } else if (what < 0.78) {
    change(update);
  } else {
    leave(update);
    if (chance(0.4)) add_pose(update);
  }
  return update;
}

void FailingUpdates::add_pose(GraphUpdate& update) {
  const std::optional<Id> leader = some_variable(true);
  const auto leaves = [&](Id id) {
    return std::ranges::count(update.marginalized, id) > 0 ||
           std::ranges::count(update.removed_variables, id) > 0;
  };
  const Id id = next_++;
  Variable variable{types_.plain.pose, id, {}, false};
  std::vector<Id> poses = twin_.variables();
  std::erase_if(poses, [&](Id other) { return !is_pose(other) || leaves(other); });
  log_ += fmt::format("pose {}\n", id);
  if (poses.empty()) {
    variable.state = {noise(), noise(), noise()};
    update.variables.push_back(std::move(variable));
    return;
  }
  if (chance(0.2)) variable.state = {3.0 * noise(), static_cast<double>(id), 9.0 * noise()};
  update.variables.push_back(std::move(variable));
  add_between(update, poses.back(), id);
  if (leader && !leaves(*leader) && *leader != poses.back() && chance(0.5))
    add_between(update, *leader, id);
  if (lag_ > 0 && std::ssize(poses) > lag_) {
    update.marginalized.push_back(poses.front());
    log_ += fmt::format("marginalize {}\n", poses.front());
    std::erase_if(update.factors, [&](const Factor& f) {
      return std::ranges::count(f.variables, poses.front()) > 0;
    });
  }
}

void FailingUpdates::add_point(GraphUpdate& update) {
  const Id id = next_++, from = update.variables.back().id;
  log_ += fmt::format("point {}\n", id);
  update.variables.push_back(
      {types_.plain.point, id, {1.0 + 9.0 * noise(), 1.0 + 9.0 * noise()}, false});
  add_between(update, from, id);
}

void FailingUpdates::add_between(GraphUpdate& update, Id a, Id b) {
  const auto is_new_pose = [&] {
    const auto there = std::ranges::find(update.variables, b, &Variable::id);
    return there != update.variables.end() && there->type == types_.plain.pose;
  };
  const bool pose = twin_.has(b) ? is_pose(b) : is_new_pose();
  log_ += fmt::format("factor {} {}\n", a, b);
  if (pose) {
    update.factors.push_back({types_.relative_pose,
                              {a, b},
                              {1.0 + noise(), noise(), 0.4 + noise()},
                              information(100.0, 3)});
  } else {
    update.factors.push_back(
        {types_.point_seen, {a, b}, {1.0 + noise(), 0.5 + noise()}, information(60.0, 2)});
  }
  if (chance(0.1)) update.factors.back().loss = types_.loss;
}

void FailingUpdates::change(GraphUpdate& update) {
  const std::vector<FactorId> factors = twin_.factors();
  if (factors.empty()) return;
  const FactorId id = factors[up_to(factors.size())];
  const Factor factor = twin_.factor(id);
  if (factor.type->tag() == MarginalPrior::kTag) return;
  ChangedFactor changed{id, factor.measurement, {}};
  for (double& number : changed.measurement) number += 2.0 * noise();
  if (chance(0.4)) changed.information = information(30.0, factor.type->residual_size());
  log_ += fmt::format("change {}\n", id);
  update.changed.push_back(std::move(changed));
}

void FailingUpdates::leave(GraphUpdate& update) {
  const double how = std::uniform_real_distribution<double>(0.0, 1.0)(random_);
  const std::vector<FactorId> factors = twin_.factors();
  if (how < 0.35 && !factors.empty()) {
    update.removed_factors.push_back(factors[up_to(factors.size())]);
    log_ += fmt::format("remove factor {}\n", update.removed_factors.back());
  } else if (how < 0.6) {
    if (const auto id = some_variable(chance(0.6))) {
      update.removed_variables.push_back(*id);
      log_ += fmt::format("remove {}\n", *id);
    }
  } else if (const auto id = some_variable(chance(0.7))) {
    update.marginalized.push_back(*id);
    log_ += fmt::format("marginalize {}\n", *id);
  }
}

}  // namespace cairn::test
