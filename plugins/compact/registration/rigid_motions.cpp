// SPDX-License-Identifier: BSD-3-Clause
#include "rigid_motions.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <string>
#include <utility>

#include "cairn/geometry/pose.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::registration {
namespace {

double norm(std::span<const double> v) {
  return std::sqrt(std::inner_product(v.begin(), v.end(), v.begin(), 0.0));
}

/// Uniform in the unit ball of as many dimensions.
void draw_in_ball(PairRandom& random, std::span<double> v) {
  do {
    for (double& coordinate : v) coordinate = random.uniform(-1.0, 1.0);
  } while (norm(v) > 1.0);
}

/// A rotation vector, so that the rotations by at most `most` are equally likely. In the plane its
/// number is uniform. In space a volume of rotation vectors has more rotations the nearer it is to
/// no rotation at all: (sin(θ/2) / (θ/2))², which decides what is kept.
void draw_rotation(PairRandom& random, double most, std::span<double> w) {
  double half, sine;
  do {
    draw_in_ball(random, w);
    for (double& coordinate : w) coordinate *= most;
    half = 0.5 * norm(w);
    sine = std::sin(half);
  } while (w.size() > 1 && random.uniform() * half * half > sine * sine);
}

const VariableType& pose_type(const VariableType& type) {
  if (is_pose(type)) return type;
  throw Error(
      ErrorCode::usage,
      "registration: " + std::string(type.tag()) +
          " is not a pose whose relative poses can be simulated: its type must have the abilities "
          "LieGroup and Placement, with an orientation, as VERTEX_SE2 has");
}

}  // namespace

RigidMotions::RigidMotions(std::shared_ptr<const VariableType> type)
    : group_(pose_type(*type)), type_(std::move(type)) {
  for (int k = 0; k < group_.tangent_size(); ++k) {
    const Extent moved = extent(group_.exp(Eigen::VectorXd::Unit(group_.tangent_size(), k)));
    if (moved.angle > 0.5) {
      rotations_.push_back(k);
    } else if (moved.length > 0.5) {
      translations_.push_back(k);
    }
  }
}

std::vector<double> RigidMotions::between(std::span<const double> x,
                                          std::span<const double> y) const {
  return group_.normalized(group_.between(x, y));
}

std::vector<double> RigidMotions::perturbed(std::span<const double> z,
                                            const Eigen::VectorXd& xi) const {
  return group_.normalized(group_.compose(z, group_.exp(xi)));
}

Extent RigidMotions::extent(std::span<const double> motion) const {
  const Pose pose = pose_of(*type_, motion);
  return {norm({pose.t.data(), 3}), rotation_angle(pose.R)};
}

std::vector<double> RigidMotions::draw(const Extent& within, PairRandom& random) const {
  std::vector<double> w(rotations_.size());
  draw_rotation(random, std::min(within.angle, std::numbers::pi), w);
  Eigen::VectorXd xi = Eigen::VectorXd::Zero(group_.tangent_size());
  for (std::size_t k = 0; k < w.size(); ++k) xi[rotations_[k]] = w[k];
  std::vector<double> x = group_.exp(xi);

  const Placement& placement = *type_->placement();
  std::array<double, 9> R{};  // dimension × dimension
  std::array<double, 3> t{};
  placement.split(x.data(), R.data(), t.data());
  draw_in_ball(random, std::span(t).first(placement.dimension()));
  for (double& coordinate : t) coordinate *= within.length;
  placement.join(R.data(), t.data(), x.data());
  return group_.normalized(std::move(x));
}

}  // namespace cairn::registration
