// SPDX-License-Identifier: BSD-3-Clause
#include "triangulation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <utility>

#include "cairn/geometry/pose.hpp"
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"
#include "observations.hpp"
#include "temporary_poses.hpp"

namespace cairn::compact {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// The search: so many directions, and so many distances along each, from a quarter of the distance
// between the poses on.
constexpr int kDirectionsInPlane = 24, kDirectionsInSpace = 60;
constexpr int kDistances = 12;
constexpr double kNearest = 0.25, kFarther = 2.0;
/// Directions that are closer than this are neighbours [rad].
constexpr double kNeighboursInPlane = 0.3, kNeighboursInSpace = 0.55;

constexpr int kMostSteps = 60;
constexpr double kMostDamping = 1e12, kDone = 1e-10;
/// Steps of this many standard deviations are no steps.
constexpr double kSmallStep = 1e-5;
/// A part of the largest eigenvalue: less is nothing.
constexpr double kNothing = 1e-12;
/// How much ½ eᵀ V⁻¹ e may differ from the linear model's [nats].
constexpr double kLinear = 0.5;

/// All views at a place, one below the other.
struct Rows {
  VectorXd e;
  MatrixXd J_poses, J_point;
};

class Views {
 public:
  Views(const VariableType& type, std::span<const PlacedView> views)
      : type_(type), placement_(*type.placement()), views_(views) {}

  Rows at(const std::vector<double>& point) const {
    Rows all;
    std::vector<ObservationRows> each;
    Index rows = 0, columns = 0;
    for (const PlacedView& view : views_) {
      each.push_back(linearized(view.factors, view.pose, view.x.data(), point.data()));
      rows += each.back().e.size();
      columns += each.back().J_pose.cols();
    }
    all.e.resize(rows);
    all.J_poses = MatrixXd::Zero(rows, columns);
    all.J_point.resize(rows, type_.tangent_size());
    Index row = 0, column = 0;
    for (const ObservationRows& one : each) {
      const Index n = one.e.size();
      all.e.segment(row, n) = one.e;
      all.J_poses.block(row, column, n, one.J_pose.cols()) = one.J_pose;
      all.J_point.middleRows(row, n) = one.J_landmark;
      row += n;
      column += one.J_pose.cols();
    }
    return all;
  }

  /// ‖e‖², with the poses where they are estimated.
  double squared(const std::vector<double>& point) const {
    double sum = 0.0;
    for (const PlacedView& view : views_) {
      for (const Measured& factor : view.factors) {
        const bool from_pose = factor.factor().variables.front() == view.pose;
        const double* const states[] = {from_pose ? view.x.data() : point.data(),
                                        from_pose ? point.data() : view.x.data()};
        sum += factor.squared_norm(states);
      }
    }
    return sum;
  }

  std::vector<double> point_at(const Vector3d& position) const {
    std::vector<double> point(static_cast<std::size_t>(type_.ambient_size()));
    const Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    type_.identity(point.data());
    placement_.join(R.data(), position.data(), point.data());
    return point;
  }
  std::vector<double> moved(const std::vector<double>& point, const VectorXd& step) const {
    std::vector<double> there(point.size());
    const std::int64_t first = 0;
    type_.retract(1, point.data(), &first, step.data(), there.data());
    return there;
  }

 private:
  const VariableType& type_;
  const Placement& placement_;
  std::span<const PlacedView> views_;
};

/// Evenly over the circle, or about so over the sphere (a spiral of golden angles).
std::vector<Vector3d> directions(int dimension) {
  std::vector<Vector3d> all;
  if (dimension == 2) {
    for (int k = 0; k < kDirectionsInPlane; ++k) {
      const double angle = 2.0 * std::numbers::pi * (k + 0.5) / kDirectionsInPlane;
      all.emplace_back(std::cos(angle), std::sin(angle), 0.0);
    }
    return all;
  }
  const double turn = std::numbers::pi * (3.0 - std::sqrt(5.0));
  for (int k = 0; k < kDirectionsInSpace; ++k) {
    const double z = 1.0 - (2.0 * k + 1.0) / kDirectionsInSpace, r = std::sqrt(1.0 - z * z);
    all.emplace_back(r * std::cos(turn * k), r * std::sin(turn * k), z);
  }
  return all;
}

/// Points from which to search: along each direction the best, and of neighbours the best.
std::vector<std::vector<double>> starts(const Views& views, std::span<const Vector3d> centers,
                                        int dimension) {
  double size = 0.0;
  for (const Vector3d& center : centers) size = std::max(size, (center - centers.back()).norm());
  if (!(size > 0.0)) size = 1.0;
  const std::vector<Vector3d> towards = directions(dimension);
  std::vector<std::vector<double>> best;
  std::vector<double> squared;
  for (const Vector3d& direction : towards) {
    best.emplace_back();
    squared.push_back(std::numeric_limits<double>::infinity());
    double distance = kNearest * size;
    for (int k = 0; k < kDistances; ++k, distance *= kFarther) {
      std::vector<double> point = views.point_at(centers.back() + distance * direction);
      if (const double there = views.squared(point); there < squared.back()) {
        squared.back() = there;
        best.back() = std::move(point);
      }
    }
  }
  const double neighbours = dimension == 2 ? kNeighboursInPlane : kNeighboursInSpace;
  std::vector<std::vector<double>> chosen;
  for (std::size_t k = 0; k < towards.size(); ++k) {
    bool least = !best[k].empty();
    for (std::size_t other = 0; other < towards.size() && least; ++other) {
      if (towards[k].dot(towards[other]) < std::cos(neighbours)) continue;
      least = squared[k] <= squared[other];
    }
    if (least) chosen.push_back(std::move(best[k]));
  }
  return chosen;
}

/// A point seen in the mirror that is the line in the plane, or the plane in space, which fits the
/// poses best: where all are on it, distances do not tell the two apart.
Vector3d mirrored(std::span<const Vector3d> centers, const Vector3d& point, int dimension) {
  Vector3d middle = Vector3d::Zero();
  for (const Vector3d& center : centers) middle += center / static_cast<double>(centers.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Vector3d& center : centers)
    spread += (center - middle) * (center - middle).transpose();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(
      MatrixXd(spread.topLeftCorner(dimension, dimension)));
  Vector3d normal = Vector3d::Zero();
  normal.head(dimension) = solver.eigenvectors().col(0);
  return point - 2.0 * normal.dot(point - middle) * normal;
}

/// Levenberg-Marquardt on ‖e‖².
std::vector<double> least_squares(const Views& views, std::vector<double> point) {
  double lambda = 1e-3, now = views.squared(point);
  for (int step = 0; step < kMostSteps && lambda < kMostDamping;) {
    const Rows rows = views.at(point);
    const VectorXd g = rows.J_point.transpose() * rows.e;
    const MatrixXd H = rows.J_point.transpose() * rows.J_point;
    for (; lambda < kMostDamping && step < kMostSteps; lambda *= 10.0) {
      ++step;
      MatrixXd damped = H;
      damped.diagonal() +=
          lambda * H.diagonal() + VectorXd::Constant(H.rows(), kNothing * H.trace());
      const VectorXd delta = -Eigen::LLT<MatrixXd>(damped).solve(g);
      std::vector<double> next = views.moved(point, delta);
      const double then = views.squared(next);
      if (!(then < now)) continue;
      const bool done = now - then < kDone * now;
      point = std::move(next);
      now = then;
      lambda = std::max(lambda / 10.0, 1e-12);
      if (done) return point;
      break;
    }
  }
  return point;
}

/// A place of the point, with the uncertainty of the poses.
struct Place {
  std::vector<double> point;
  Rows rows;
  Eigen::LLT<MatrixXd> V;
  MatrixXd Lambda;
  double squared = 0.0;  ///< eᵀ V⁻¹ e
};

/// The covariance of the steps of all poses beside the last: B Σ Bᵀ.
MatrixXd beside_last(std::span<const PlacedView> views, const MatrixXd& covariance) {
  const Index n = covariance.rows() / std::ssize(views), last = covariance.rows() - n;
  MatrixXd B = MatrixXd::Identity(covariance.rows(), covariance.cols());
  B.bottomRightCorner(n, n).setZero();
  for (Index row = 0; row < last; row += n)
    B.block(row, last, n, n) = -views[static_cast<std::size_t>(row / n)].to_last;
  return B * covariance * B.transpose();
}

Place weighted(const Views& views, const MatrixXd& relative, std::vector<double> point) {
  Place place{.point = std::move(point), .rows = {}, .V = {}, .Lambda = {}};
  place.rows = views.at(place.point);
  const MatrixXd& J = place.rows.J_poses;
  place.V.compute(MatrixXd(MatrixXd::Identity(J.rows(), J.rows()) + J * relative * J.transpose()));
  place.Lambda = place.rows.J_point.transpose() * place.V.solve(place.rows.J_point);
  place.squared = place.rows.e.dot(place.V.solve(place.rows.e));
  return place;
}

/// Gauss-Newton with V: where J_lᵀ V⁻¹ e = 0. Nothing: it does not get there.
std::optional<Place> refined(const Views& views, const MatrixXd& relative,
                             const std::vector<double>& point) {
  Place place = weighted(views, relative, point);
  for (int step = 0; step < kMostSteps; ++step) {
    const VectorXd g = place.rows.J_point.transpose() * place.V.solve(place.rows.e);
    const Eigen::LLT<MatrixXd> llt(place.Lambda);
    if (llt.info() != Eigen::Success || !g.allFinite()) return std::nullopt;
    const VectorXd delta = -llt.solve(g);
    if (!delta.allFinite()) return std::nullopt;
    if (std::sqrt(std::abs(delta.dot(g))) < kSmallStep) return place;
    place = weighted(views, relative, views.moved(place.point, delta));
  }
  return std::nullopt;
}

/// Whether the measurements are linear within one standard deviation of the point.
bool is_linear(const Views& views, const Place& place) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(place.Lambda);
  const VectorXd values = solver.eigenvalues();
  if (!(values.minCoeff() > kNothing * values.maxCoeff())) return false;
  for (Index k = 0; k < values.size(); ++k) {
    for (const double side : {-1.0, 1.0}) {
      const VectorXd step = solver.eigenvectors().col(k) * (side / std::sqrt(values[k]));
      const VectorXd e = views.at(views.moved(place.point, step)).e;
      const VectorXd linear = place.rows.e + place.rows.J_point * step;
      const double difference = 0.5 * (e.dot(place.V.solve(e)) - linear.dot(place.V.solve(linear)));
      if (!(std::abs(difference) < kLinear)) return false;
    }
  }
  return true;
}

/// `fit` of `Triangulation`.
MeasuredFit fit_of(const Rows& rows, const MatrixXd& covariance) {
  const Index d = rows.J_point.cols();
  MatrixXd J(rows.e.size(), d + 1 + rows.J_poses.cols());
  J << rows.J_point, rows.e, rows.J_poses;
  const MatrixXd rest = eliminate(J, d);
  const MatrixXd R = rest.rightCols(rows.J_poses.cols());
  MeasuredFit fit = compare(rest.col(0), R * covariance * R.transpose(), R);
  // Where the landmark explains everything, R is rounding: beside J_p, it measures nothing.
  const auto squares = [](const MatrixXd& M) {
    return Eigen::SelfAdjointEigenSolver<MatrixXd>(MatrixXd(M * M.transpose()),
                                                   Eigen::EigenvaluesOnly)
        .eigenvalues();
  };
  const double nothing = kNothing * squares(rows.J_poses).maxCoeff();
  fit.dof = static_cast<int>((squares(R).array() > nothing).count());
  return fit;
}

}  // namespace

std::optional<Triangulation> triangulate(const VariableType& type,
                                         std::span<const PlacedView> views,
                                         const MatrixXd& covariance, double trust) {
  const Views all(type, views);
  std::vector<Vector3d> centers;
  for (const PlacedView& view : views) centers.push_back(view.at);
  const MatrixXd relative = beside_last(views, covariance);
  const int dimension = type.placement()->dimension();
  std::vector<Place> places;
  const auto search_from = [&](const std::vector<double>& start) {
    std::optional<Place> place = refined(all, relative, least_squares(all, start));
    if (place) places.push_back(std::move(*place));
  };
  for (const std::vector<double>& start : starts(all, centers, dimension)) search_from(start);
  if (places.empty()) return std::nullopt;
  const Vector3d first =
      position(type, std::ranges::min_element(places, {}, &Place::squared)->point);
  search_from(all.point_at(mirrored(centers, first, dimension)));
  const auto best = std::ranges::min_element(places, {}, &Place::squared);
  if (!is_linear(all, *best)) return std::nullopt;
  const double rival = best->squared - 2.0 * std::log(trust);
  VectorXd apart(type.tangent_size());
  for (const Place& other : places) {
    type.local(1, best->point.data(), other.point.data(), apart.data());
    const bool same = apart.dot(best->Lambda * apart) < 1.0;
    if (!same && other.squared < rival) return std::nullopt;
  }
  return Triangulation{.state = best->point, .fit = fit_of(best->rows, covariance)};
}

}  // namespace cairn::compact
