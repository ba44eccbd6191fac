// SPDX-License-Identifier: BSD-3-Clause
#include "growing_graph.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "cairn/lie/point.hpp"
#include "cairn/lie/se3.hpp"
#include "cairn/types/define_factor.hpp"
#include "support/planar_graph.hpp"

namespace cairn::incremental {
namespace {

struct RelativePose3 {
  static constexpr std::string_view kTag = "EDGE_SE3:QUAT";
  static constexpr int kResidual = 6, kMeasurement = 7;
  static constexpr bool kRelative = true;
  using Variables = std::tuple<Se3, Se3>;
  template <class S>
  static Vector<S, 6> residual(const Vector<S, 7>& a, const Vector<S, 7>& b,
                               const Vector<double, 7>& z) {
    return Se3::local<S>(z.template cast<S>(), Se3::between<S>(a, b));
  }
};

struct PosePrior3 {
  static constexpr std::string_view kTag = "EDGE_PRIOR_SE3:QUAT";
  static constexpr int kResidual = 6, kMeasurement = 7;
  using Variables = std::tuple<Se3>;
  template <class S>
  static Vector<S, 6> residual(const Vector<S, 7>& a, const Vector<double, 7>& z) {
    return Se3::local<S>(z.template cast<S>(), a);
  }
};

struct PointSeen3 {
  static constexpr std::string_view kTag = "EDGE_SE3_TRACKXYZ";
  static constexpr int kResidual = 3, kMeasurement = 3;
  using Variables = std::tuple<Se3, PointXYZ>;
  template <class S>
  static Vector<S, 3> residual(const Vector<S, 7>& pose, const Vector<S, 3>& point,
                               const Vector<double, 3>& z) {
    const Vector<S, 3> apart = point - Se3::translation<S>(pose);
    return so3::rotate_back<S>(Se3::quaternion<S>(pose), apart) - z.template cast<S>();
  }
};

}  // namespace

GrowingTypes planar_types() {
  const test::PlanarTypes types;
  return {types.pose, types.point, types.relative_pose, types.prior, types.point_seen};
}

GrowingTypes spatial_types() {
  return {define_variable<Se3>(), define_variable<PointXYZ>(), define_factor<RelativePose3>(),
          define_factor<PosePrior3>(), define_factor<PointSeen3>()};
}

void GrowingGraph::grow(Engine& engine) {
  if (happenings_.compacts && engine.mostly_dead()) engine.compact();
  const double what = uniform(0.0, 1.0);
  if (poses_.size() < 3 || what < 0.5) {
    add_pose(engine);
  } else if (what < 0.7) {
    add_loop(engine);
  } else if (what < 0.8) {
    happenings_.points ? add_point(engine) : add_pose(engine);
  } else if (what < 0.86) {
    happenings_.priors ? add_prior(engine) : add_loop(engine);
  } else if (what < 0.9) {
    change_measurement(engine);
  } else {
    remove(engine);
  }
}

void GrowingGraph::add_pose(Engine& engine) {
  const bool fixed = happenings_.priors && chance(0.05);
  const bool alone = poses_.empty() || (happenings_.cuts && chance(0.1));
  State step(static_cast<std::size_t>(types_.pose->tangent_size()), 0.0);
  step.front() = 1.0;
  for (std::size_t k = step.size() == 3 ? 2 : 3; k < step.size(); ++k) step[k] = uniform(-0.8, 0.8);
  State truth(static_cast<std::size_t>(types_.pose->ambient_size()));
  types_.pose->identity(truth.data());
  if (!poses_.empty()) truth = compose(poses_.back().truth, exp(step));
  if (alone) {
    const State x = noisy(truth);
    poses_.push_back({next_id_, truth});
    add_variable(engine, types_.pose, x, fixed);
    return;
  }
  const State z = noisy(between(poses_.back().truth, truth));
  const int before = *engine.graph().find(poses_.back().id);
  const State at = compose(engine.x(before), z);
  poses_.push_back({next_id_, truth});
  const int v = add_variable(engine, types_.pose, at, fixed);
  add_factor(engine, types_.relative_pose, {before, v}, z);
}

void GrowingGraph::add_loop(Engine& engine) {
  const Variable &a = any(poses_), &b = any(poses_);
  if (a.id == b.id) return;
  loops_.push_back(engine.next_id());
  add_factor(engine, types_.relative_pose, {*engine.graph().find(a.id), *engine.graph().find(b.id)},
             noisy(between(a.truth, b.truth)));
}

void GrowingGraph::add_loop_back(Engine& engine, std::size_t poses) {
  if (poses == 0 || poses >= poses_.size()) return;
  const Variable &a = poses_[poses_.size() - 1 - poses], &b = poses_.back();
  loops_.push_back(engine.next_id());
  add_factor(engine, types_.relative_pose, {*engine.graph().find(a.id), *engine.graph().find(b.id)},
             noisy(between(a.truth, b.truth)));
}

void GrowingGraph::add_precise_loop(Engine& engine, double more) {
  const int a = *engine.graph().find(poses_.front().id), b = *engine.graph().find(poses_.back().id);
  add_factor(engine, types_.relative_pose, {a, b}, between(engine.x(a), engine.x(b)), more);
}

/// One that is new or was seen before, from some pose.
void GrowingGraph::add_point(Engine& engine) {
  const Variable& from = any(poses_);
  const int pose = *engine.graph().find(from.id);
  if (points_.empty() || chance(0.4)) {
    State truth(static_cast<std::size_t>(types_.point->tangent_size()));
    for (double& value : truth) value = uniform(-5.0, 5.0);
    State x = truth;
    for (double& value : x) value += uniform(-0.1, 0.1);
    points_.push_back({next_id_, truth});
    add_variable(engine, types_.point, x, false);
  }
  const Variable& point = points_[std::min<std::size_t>(rng_() % 4, points_.size() - 1)];
  const Variable& seen_now = chance(0.5) ? points_.back() : point;
  add_factor(engine, types_.point_seen, {pose, *engine.graph().find(seen_now.id)},
             seen(from.truth, seen_now.truth));
}

void GrowingGraph::add_prior(Engine& engine) {
  const Variable& pose = any(poses_);
  add_factor(engine, types_.pose_prior, {*engine.graph().find(pose.id)}, noisy(pose.truth));
}

void GrowingGraph::change_measurement(Engine& engine) {
  std::erase_if(loops_, [&](FactorId id) { return engine.problem().place_of(id) < 0; });
  if (loops_.empty()) return;
  const int f = engine.problem().place_of(loops_[rng_() % loops_.size()]);
  log_ += fmt::format("change {}\n", engine.graph().describe_factor(f));
  const auto old = engine.graph().measurement(f);
  engine.problem().edit().set_measurement(f, noisy({old.begin(), old.end()}));
  engine.problem().change_factor(f);
}

void GrowingGraph::remove(Engine& engine) {
  std::erase_if(loops_, [&](FactorId id) { return engine.problem().place_of(id) < 0; });
  const std::vector<FactorId> factors = engine.problem().live_ids();
  if (happenings_.cuts && chance(0.5)) {
    remove_variable(engine, poses_);
  } else if (happenings_.cuts && !factors.empty() && chance(0.5)) {
    remove_factor(engine, engine.problem().place_of(factors[rng_() % factors.size()]));
  } else if (!points_.empty() && chance(0.3)) {
    remove_variable(engine, points_);
  } else if (!loops_.empty()) {
    remove_factor(engine, engine.problem().place_of(loops_[rng_() % loops_.size()]));
  }
}

void GrowingGraph::remove_factor(Engine& engine, int f) {
  log_ += fmt::format("remove {}\n", engine.graph().describe_factor(f));
  engine.problem().remove_factor(f);
}

/// Any of these, with all factors on it.
void GrowingGraph::remove_variable(Engine& engine, std::vector<Variable>& variables) {
  const auto leaves = variables.begin() + static_cast<std::ptrdiff_t>(rng_() % variables.size());
  const int v = *engine.graph().find(leaves->id);
  variables.erase(leaves);
  log_ += fmt::format("remove {}\n", engine.graph().describe_variable(v));
  const std::vector<std::int32_t> factors = engine.problem().factors_of(v);
  for (const std::int32_t f : factors) engine.problem().remove_factor(f);
  engine.problem().remove_variable(v);
  engine.problem().covariances.drop(v);
}

int GrowingGraph::add_variable(Engine& engine, const std::shared_ptr<const VariableType>& type,
                               const State& x, bool fixed) {
  log_ += fmt::format("add {}{}\n", next_id_, fixed ? ", fixed" : "");
  const int v = engine.problem().edit().add_variable(type, next_id_++, x);
  if (fixed) engine.problem().edit().set_fixed(v);
  engine.added_variable();
  return v;
}

void GrowingGraph::add_factor(Engine& engine, const std::shared_ptr<const FactorType>& type,
                              std::initializer_list<int> variables, const State& z,
                              double information_factor) {
  std::vector<double> information;
  const int n = type->residual_size();
  for (int row = 0; row < n; ++row) {
    for (int column = row; column < n; ++column)
      information.push_back((row == column ? uniform(0.5, 2.0) : uniform(-0.05, 0.05)) * 1e3 *
                            information_factor);
  }
  const int f =
      engine.problem().edit().add_factor(type, std::vector<int>(variables), z, information);
  log_ += fmt::format("{} as {}\n", engine.graph().describe_factor(f), engine.next_id());
  engine.added_factor();
}

GrowingGraph::State GrowingGraph::exp(std::span<const double> delta) const {
  State x(static_cast<std::size_t>(types_.pose->ambient_size()));
  types_.pose->lie_group()->exp(delta.data(), x.data());
  return x;
}

GrowingGraph::State GrowingGraph::compose(const State& a, const State& b) const {
  State ab(a.size());
  types_.pose->lie_group()->compose(a.data(), b.data(), ab.data());
  types_.pose->normalize(ab.data());
  return ab;
}

GrowingGraph::State GrowingGraph::between(const State& a, const State& b) const {
  State inverse(a.size());
  types_.pose->lie_group()->inverse(a.data(), inverse.data());
  return compose(inverse, b);
}

GrowingGraph::State GrowingGraph::noisy(const State& pose) {
  State delta(static_cast<std::size_t>(types_.pose->tangent_size()));
  for (double& value : delta)
    value = std::normal_distribution<double>(0.0, happenings_.noise)(rng_);
  return compose(pose, exp(delta));
}

/// A point as it is seen from a pose.
GrowingGraph::State GrowingGraph::seen(const State& pose, const State& point) {
  const std::size_t n = point.size();
  State R(n * n), t(n), z(n, 0.0);
  types_.pose->placement()->split(pose.data(), R.data(), t.data());
  for (std::size_t c = 0; c < n; ++c) {
    for (std::size_t r = 0; r < n; ++r) z[c] += R[c * n + r] * (point[r] - t[r]);
    z[c] += std::normal_distribution<double>(0.0, happenings_.noise)(rng_);
  }
  return z;
}

}  // namespace cairn::incremental
