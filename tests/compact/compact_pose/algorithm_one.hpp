// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <boost/math/distributions/normal.hpp>

#include "cairn/geometry/pose_chain.hpp"
#include "cairn/policy/registration.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/update/recorded_graph.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {

using test::numerical_jacobian;
using test::PoseWorld;

struct Thresholds {
  std::array<double, 3> v{};  ///< of the translation, along each axis [m]
  double angle = 0.0;         ///< of the rotation's magnitude [rad]
  double s = 0.0;
  double g_loop = 0.0, g_pose = 0.0;  ///< [nats]
};

/// Algorithm 1 of Ila et al. 2017 word by word: every pose is a variable at once, one that is not
/// kept is taken out again, all poses are tested, and all gains are computed anew after every link.
class AlgorithmOne {
 public:
  AlgorithmOne(PoseWorld world, std::unique_ptr<Estimator> estimator, const Thresholds& thresholds,
               std::optional<Eigen::MatrixXd> expected)
      : world_(std::move(world)),
        estimator_(std::move(estimator)),
        thresholds_(thresholds),
        expected_(std::move(expected)) {}

  std::vector<Id> kept;
  std::vector<std::pair<Id, Id>> links;
  std::vector<double> gains;  ///< of those

  void run(const Graph& recording, Registration& registration) {
    const std::vector<Arrival> way = pose_chain(recording);
    GraphUpdate first;
    first.variables.push_back(recording.variable(way[0].pose()));
    estimator_->update(first);
    kept = {first.variables[0].id};
    bool keep_pose = true;
    Id newest = kept.back();
    Motion e;  // (μ_e, Σ_e)
    for (std::size_t n = 1; n < way.size(); ++n) {
      const Id id = recording.id(way[n].pose());
      const Factor odometry = recording.factor(way[n].odometry[0]);
      const Motion u = world_.motions().of_factor(odometry, newest);
      GraphUpdate update;
      if (keep_pose) {
        e = u;
      } else {
        e = world_.motions().compose(e, u);
        update.removed_variables = {newest};
        kept.pop_back();
      }
      const Id predecessor = kept.back();
      update.variables.push_back(world_.variable(id));
      update.factors.push_back(world_.motions().to_factor(odometry.type, predecessor, id, e));
      estimator_->update(update);
      newest = id;
      // What the policy learns of matches that are all alike, as they are here.
      const Eigen::MatrixXd Sigma_y =
          expected_ ? *expected_ : matrix(matched_.empty() ? u.covariance : matched_);
      kept.push_back(id);
      keep_pose = close_loops(newest, predecessor, Sigma_y, registration);
    }
  }

 private:
  struct Candidate {
    Id id;
    double gain;
  };

  Eigen::MatrixXd matrix(const std::vector<double>& numbers) const {
    return Eigen::Map<const Eigen::MatrixXd>(numbers.data(), world_.tangent(), world_.tangent());
  }

  /// Lines 14 to 32.
  bool close_loops(Id newest, Id predecessor, const Eigen::MatrixXd& Sigma_y,
                   Registration& registration) {
    std::vector<Candidate> C;
    double least = std::numeric_limits<double>::infinity();
    for (const Id id : kept) {
      if (id == newest || !close(id, newest)) continue;
      C.push_back({id, gain(id, newest, Sigma_y)});
      least = std::min(least, C.back().gain);
    }
    bool loop_closed = false;
    while (!C.empty()) {
      const auto best = std::max_element(
          C.begin(), C.end(), [](const auto& a, const auto& b) { return a.gain < b.gain; });
      const Candidate i = *best;
      C.erase(best);
      if (i.id == predecessor || !(i.gain > thresholds_.g_loop)) continue;
      const std::vector<Factor> measured = registration.match(i.id, newest);
      if (measured.empty()) continue;
      const Motion y = world_.motions().of_factor(measured.front(), i.id);
      matched_ = y.covariance;
      const double told = gain(i.id, newest, matrix(y.covariance));
      if (!(told > thresholds_.g_loop)) continue;
      GraphUpdate update;
      update.factors = measured;
      estimator_->update(update);
      for (Candidate& other : C) other.gain = gain(other.id, newest, Sigma_y);
      loop_closed = true;
      links.emplace_back(i.id, newest);
      gains.push_back(told);
    }
    return loop_closed || least > thresholds_.g_pose;
  }

  PoseWorld::Pose state(Id id) const {
    const auto x = estimator_->state(id);
    return {x.begin(), x.end()};
  }

  /// Equations 16 and 17, with numerical Jacobians.
  std::pair<PoseWorld::Pose, Eigen::MatrixXd> displacement(Id a, Id b) const {
    const int n = world_.tangent();
    const PoseWorld::Pose x = state(a), y = state(b), d = world_.between(x, y);
    const Eigen::MatrixXd J = numerical_jacobian(2 * n, [&](const Eigen::VectorXd& step) {
      return world_.log(world_.between(
          d, world_.between(world_.moved(x, step.head(n)), world_.moved(y, step.tail(n)))));
    });
    Eigen::MatrixXd Sigma(2 * n, 2 * n), block(n, n);
    const Id ids[] = {a, b};
    for (int r = 0; r < 2; ++r) {
      for (int c = 0; c < 2; ++c) {
        estimator_->covariance(ids[r], ids[c],
                               {block.data(), static_cast<std::size_t>(block.size())});
        Sigma.block(r * n, c * n, n, n) = block;
      }
    }
    return {d, J * Sigma * J.transpose()};
  }

  /// Equation 18 in every dimension.
  bool close(Id a, Id b) const {
    const auto [d, Sigma] = displacement(a, b);
    const auto dimensions = [&](const PoseWorld::Pose& x) {
      const auto [R, t] = world_.split(x);
      Eigen::VectorXd all(4);
      all << t, Eigen::AngleAxisd(R).angle();
      return all;
    };
    const Eigen::MatrixXd J =
        numerical_jacobian(world_.tangent(), [&, &mean = d](const Eigen::VectorXd& step) {
          return dimensions(world_.moved(mean, step));
        });
    const Eigen::VectorXd mu = dimensions(d);
    const Eigen::MatrixXd S = J * Sigma * J.transpose();
    const int translations = world_.tangent() / 2 + (world_.tangent() == 3 ? 1 : 0);
    for (int r = 0; r < 4; ++r) {
      if (r >= translations && r < 3) continue;
      const double v = r < 3 ? thresholds_.v[r] : thresholds_.angle;
      const boost::math::normal normal(mu[r], std::sqrt(S(r, r)));
      if (!(cdf(normal, v) - cdf(normal, -v) > thresholds_.s)) return false;
    }
    return true;
  }

  /// Equation 22.
  double gain(Id a, Id b, const Eigen::MatrixXd& Sigma_y) const {
    const Eigen::MatrixXd Sigma_d = displacement(a, b).second;
    return 0.5 * std::log((Sigma_y + Sigma_d).determinant() / Sigma_y.determinant());
  }

  PoseWorld world_;
  std::unique_ptr<Estimator> estimator_;
  Thresholds thresholds_;
  std::optional<Eigen::MatrixXd> expected_;
  std::vector<double> matched_;  ///< covariance of the latest match
};

}  // namespace cairn::compact
