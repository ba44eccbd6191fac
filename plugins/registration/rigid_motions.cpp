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

using Rotation = std::array<double, 9>;     // D × D, column-major
using Translation = std::array<double, 3>;  // D

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

}  // namespace

RigidMotions::RigidMotions(std::shared_ptr<const VariableType> type)
    : type_(std::move(type)), group_(type_->lie_group()), placement_(type_->placement()) {
  if (!is_pose(*type_)) {
    throw Error(
        ErrorCode::usage,
        "registration: " + std::string(type_->tag()) +
            " is no pose whose relative poses can be simulated: its type must have the abilities "
            "LieGroup and Placement, with an orientation, as VERTEX_SE2 has");
  }
  std::vector<double> unit(static_cast<std::size_t>(type_->tangent_size())), x = state();
  for (int k = 0; k < type_->tangent_size(); ++k) {
    unit[k] = 1.0;
    group_->exp(unit.data(), x.data());
    unit[k] = 0.0;
    const Extent moved = extent(x);
    if (moved.angle > 0.5) {
      rotations_.push_back(k);
    } else if (moved.length > 0.5) {
      translations_.push_back(k);
    }
  }
}

std::vector<double> RigidMotions::state() const {
  return std::vector<double>(static_cast<std::size_t>(type_->ambient_size()));
}

std::vector<double> RigidMotions::between(std::span<const double> x,
                                          std::span<const double> y) const {
  std::vector<double> back = state(), motion = state();
  group_->inverse(x.data(), back.data());
  group_->compose(back.data(), y.data(), motion.data());
  type_->normalize(motion.data());
  return motion;
}

std::vector<double> RigidMotions::perturbed(std::span<const double> z, const double* xi) const {
  std::vector<double> step = state(), motion = state();
  group_->exp(xi, step.data());
  group_->compose(z.data(), step.data(), motion.data());
  type_->normalize(motion.data());
  return motion;
}

Extent RigidMotions::extent(std::span<const double> motion) const {
  const Pose pose = pose_of(*placement_, motion.data());
  return {norm({pose.t.data(), 3}), rotation_angle(pose.R)};
}

std::vector<double> RigidMotions::draw(const Extent& within, PairRandom& random) const {
  std::vector<double> w(rotations_.size());
  draw_rotation(random, std::min(within.angle, std::numbers::pi), w);
  std::vector<double> xi(static_cast<std::size_t>(type_->tangent_size())), x = state();
  for (std::size_t k = 0; k < w.size(); ++k) xi[rotations_[k]] = w[k];
  group_->exp(xi.data(), x.data());

  Rotation R;
  Translation t;
  placement_->split(x.data(), R.data(), t.data());
  draw_in_ball(random, std::span(t).first(placement_->dimension()));
  for (double& coordinate : t) coordinate *= within.length;
  placement_->join(R.data(), t.data(), x.data());
  type_->normalize(x.data());
  return x;
}

}  // namespace cairn::registration
