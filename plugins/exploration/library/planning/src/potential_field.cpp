// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/potential_field.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <numbers>
#include <string>

#include <Eigen/Core>

#include "cairn/grid/cell_traversal.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"
#include "potential_grid.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Length of a step, and the shortest to which it is cut [cells].
constexpr double kStep = 0.5, kLeastStep = 1.0 / 32;

/// ψ between the middles of cells, at a point in cells and orientations.
class Interpolation {
 public:
  Interpolation(const ConfigurationSpace& space, const std::vector<double>& values, double weight)
      : space_(space), values_(values), weight_(weight) {}

  struct Sample {
    double value = 0.0;
    Vector3d gradient = Vector3d::Zero();
  };

  Sample at(const Vector3d& point) const {
    const Vector3d low = point.array().floor();
    const Vector3d part = point - low;
    const std::array<double, 8> corner = corners(low.cast<int>());
    Sample sample;
    for (int k = 0; k < 8; ++k) {
      const Vector3d side(k & 1, (k >> 1) & 1, (k >> 2) & 1);
      // Weights along each axis, and their derivatives.
      const Vector3d share =
          side.cwiseProduct(part) + (Vector3d::Ones() - side).cwiseProduct(Vector3d::Ones() - part);
      const Vector3d slope = 2.0 * side - Vector3d::Ones();
      const double value = corner[static_cast<std::size_t>(k)];
      sample.value += value * share.prod();
      sample.gradient +=
          value * Vector3d(slope.x() * share.y() * share.z(), share.x() * slope.y() * share.z(),
                           share.x() * share.y() * slope.z());
    }
    return sample;
  }

 private:
  /// Of the eight configurations around a point; where the body does not fit, the mean of the
  /// others of that orientation, divided by the weight.
  std::array<double, 8> corners(const Eigen::Vector3i& low) const {
    std::array<double, 8> result{};
    for (std::size_t turn = 0; turn < 2; ++turn) {
      std::array<std::int32_t, 4> numbers{};
      double sum = 0.0;
      int fitting = 0;
      for (std::size_t k = 0; k < 4; ++k) {
        numbers[k] =
            space_.number(low.x() + static_cast<int>(k % 2), low.y() + static_cast<int>(k / 2));
        if (numbers[k] < 0) continue;
        const double value = values_[space_.index(numbers[k], low.z() + static_cast<int>(turn))];
        result[4 * turn + k] = value;
        sum += value;
        ++fitting;
      }
      for (std::size_t k = 0; k < 4; ++k)
        if (numbers[k] < 0 && fitting > 0) result[4 * turn + k] = sum / fitting / weight_;
    }
    return result;
  }

  const ConfigurationSpace& space_;
  const std::vector<double>& values_;
  double weight_;
};

Vector3d to_point(const ConfigurationSpace& space, const Pose2& pose) {
  const Vector2d cell = space.frame().to_cells(pose.translation());
  const double turns = pose.theta() / (2.0 * std::numbers::pi);
  return {cell.x() - 0.5, cell.y() - 0.5, turns * space.orientations()};
}

Pose2 to_pose(const ConfigurationSpace& space, const Vector3d& point) {
  const Vector2d at = space.frame().to_world({point.x() + 0.5, point.y() + 0.5});
  return {at.x(), at.y(), 2.0 * std::numbers::pi * point.z() / space.orientations()};
}

}  // namespace

PotentialField::PotentialField(const ConfigurationSpace& space, std::span<const float> decrease,
                               const PotentialFieldOptions& options, std::string_view kernels)
    : space_(space),
      options_(options),
      values_(space.size()),
      fixed_(space.size()),
      relax_row_(choose_relax_row(kernels)) {
  if (!relax_row_) {
    throw Error(ErrorCode::usage, "a potential field: there are no kernels '" +
                                      std::string(kernels) + "' that this machine can run");
  }
  if (decrease.size() != space.size())
    throw Error(ErrorCode::usage, "a potential field needs one value per configuration");
  float largest = 0.0F;
  for (const float value : decrease) largest = std::max(largest, value);
  const double least = options.attractor * largest;
  for (std::size_t k = 0; k < decrease.size(); ++k) {
    if (!(decrease[k] > 0.0F) || decrease[k] < least) continue;
    fixed_[k] = 1;
    values_[k] = decrease[k];
  }
}

PotentialField::Solution PotentialField::solve(double weight, double seconds,
                                               const std::atomic<bool>* interrupt) {
  const auto begin = std::chrono::steady_clock::now();
  if (!(weight >= 1.0))
    throw Error(ErrorCode::usage, "the weight of obstacles in a potential field is at least 1");
  weight_ = weight;
  PotentialGrid grid;
  grid.orientations = space_.orientations();
  const int width = space_.frame().width;
  for (const std::int32_t cell : space_.cells()) grid.cells.push_back({cell % width, cell / width});
  grid.connect();
  grid.fixed = fixed_;
  for (std::size_t k = 0; k < values_.size(); ++k)
    if (fixed_[k] == 0) values_[k] = 0.0;
  grid.keep_unconnected();
  grid.values = std::move(values_);
  const auto goes_on = [&] {
    if (interrupt && interrupt->load(std::memory_order_relaxed)) return false;
    return std::isinf(seconds) || seconds_since(begin) < seconds;
  };
  const SweepCount count = cairn::solve(grid, weight,
                                        {.tolerance = options_.tolerance,
                                         .most = options_.sweeps,
                                         .relax_row = relax_row_,
                                         .goes_on = goes_on});
  values_ = std::move(grid.values);
  return {count.sweeps, count.change, count.change <= options_.tolerance};
}

PotentialField::Descent PotentialField::descend(const Pose2& from) const {
  const Interpolation potential(space_, values_, weight_);
  Descent descent;
  Vector3d point = to_point(space_, from);
  descent.path.push_back(from);
  const GridFrame& frame = space_.frame();
  const int most = 40 * (frame.width + frame.height + space_.orientations());
  double step = kStep;
  for (int k = 0; k < most && step >= kLeastStep; ++k) {
    const Interpolation::Sample here = potential.at(point);
    const double slope = here.gradient.norm();
    if (!(slope > 0.0)) break;
    const Vector3d next = point + step * here.gradient / slope;
    if (potential.at(next).value <= here.value) {
      step *= 0.5;
      continue;
    }
    const Vector2d cell = (next.head<2>().array() + 0.5).floor();
    point = next;
    if (space_.number(static_cast<int>(cell.x()), static_cast<int>(cell.y())) < 0) {
      descent.end = End::collision;
      return descent;
    }
    descent.path.push_back(to_pose(space_, point));
    step = kStep;
  }
  const auto last = space_.nearest(to_pose(space_, point));
  descent.end = last && fixed_[*last] != 0 ? End::minimum : End::elsewhere;
  return descent;
}

std::vector<Vector2d> straightened(const ConfigurationSpace& space, std::span<const Pose2> path) {
  const GridFrame& frame = space.frame();
  const auto fits = [&](const Vector2d& from, const Vector2d& to) {
    return traverse_cells(frame.to_cells(from), frame.to_cells(to),
                          [&](int x, int y) { return space.number(x, y) >= 0; });
  };
  const auto near = [&](std::size_t first, std::size_t last) {
    const Vector2d from = path[first].translation();
    const Vector2d along = path[last].translation() - from;
    const double square = along.squaredNorm();
    for (std::size_t k = first + 1; k < last; ++k) {
      const Vector2d apart = path[k].translation() - from;
      const double part = square > 0.0 ? std::clamp(apart.dot(along) / square, 0.0, 1.0) : 0.0;
      if ((apart - part * along).norm() > frame.resolution) return false;
    }
    return true;
  };
  std::vector<Vector2d> corners;
  if (path.empty()) return corners;
  corners.push_back(path.front().translation());
  for (std::size_t first = 0; first + 1 < path.size();) {
    std::size_t last = first + 1;
    while (last + 1 < path.size() && near(first, last + 1) &&
           fits(path[first].translation(), path[last + 1].translation()))
      ++last;
    corners.push_back(path[last].translation());
    first = last;
  }
  return corners;
}

}  // namespace cairn
