// SPDX-License-Identifier: BSD-3-Clause
// Alignment and errors: compare of trajectory.hpp.
#include "cairn/evaluation/trajectory.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <utility>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "cairn/geometry/pose.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/result_fields.hpp"
#include "cairn/runtime/threads.hpp"

namespace cairn {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kDegrees = 57.295779513082320877;  // of a radian

Pose pose_of(const TrajectoryPose& pose) {
  return {Eigen::Map<const Matrix3d>(pose.R.data()), Eigen::Map<const Vector3d>(pose.t.data())};
}

struct Pairs {
  std::vector<Pose> estimate, truth;
  bool planar = false;
  std::size_t size() const { return truth.size(); }
};

Pairs pairs_of(const TrajectoryPairs& poses) {
  Pairs pairs;
  for (const TrajectoryPose& pose : poses.estimate) pairs.estimate.push_back(pose_of(pose));
  for (const TrajectoryPose& pose : poses.truth) pairs.truth.push_back(pose_of(pose));
  pairs.planar = is_planar(poses.estimate) && is_planar(poses.truth);
  return pairs;
}

// Alignment ---------------------------------------------------------------------------------------

Vector3d centroid(const std::vector<Pose>& poses) {
  Vector3d sum = Vector3d::Zero();
  for (const Pose& pose : poses) sum += pose.t;
  return sum / static_cast<double>(poses.size());
}

Matrix3d about_z(double angle) {
  return Eigen::AngleAxisd(angle, Vector3d::UnitZ()).toRotationMatrix();
}

/// The rotation R that maximises tr(Rᵀ M) (Kabsch 1976, Umeyama 1991). The smallest direction is
/// turned around where the best orthogonal matrix would be a reflection.
Matrix3d nearest_rotation(const Eigen::JacobiSVD<Matrix3d>& svd) {
  Matrix3d U = svd.matrixU();
  if ((U * svd.matrixV().transpose()).determinant() < 0.0) U.col(2) = -U.col(2);
  return U * svd.matrixV().transpose();
}

/// How near a singular value must be to zero for its direction to be counted as undetermined.
constexpr double kDegenerate = 1e-10;

/// In the plane the alignment is a rotation about z even where one in space, which may turn the
/// plane over, would fit better. `M` = Σ (truth)(estimate)ᵀ.
Matrix3d planar_rotation(const Matrix3d& M, const Matrix3d& orientations, double spread) {
  const auto angle = [](const Matrix3d& A) {
    return std::atan2(A(1, 0) - A(0, 1), A(0, 0) + A(1, 1));
  };
  const double determined = std::hypot(M(1, 0) - M(0, 1), M(0, 0) + M(1, 1));
  return about_z(angle(determined > kDegenerate * spread ? M : orientations));
}

/// Positions on a line leave the rotation about it open, positions in one point all of it: what
/// positions leave open, the orientations decide.
Matrix3d spatial_rotation(const Matrix3d& M, const Matrix3d& orientations, double spread) {
  const Eigen::JacobiSVD<Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Vector3d s = svd.singularValues();
  const double least = kDegenerate * spread;
  if (s[0] <= least) {
    return nearest_rotation(
        Eigen::JacobiSVD<Matrix3d>(orientations, Eigen::ComputeFullU | Eigen::ComputeFullV));
  }
  const Matrix3d R0 = nearest_rotation(svd);
  if (s[1] > least) return R0;
  // R(φ) = Rot(a, φ) R0 for every φ; tr(R(φ)ᵀ M_R) = A cos φ + B sin φ + C with M_R the
  // orientations'.
  const Vector3d a = svd.matrixU().col(0);
  const Matrix3d N = orientations * R0.transpose();  // tr(Rot(a, φ)ᵀ N)
  const double A = N.trace() - a.dot(N * a);
  const double B = a.dot(Vector3d(N(2, 1) - N(1, 2), N(0, 2) - N(2, 0), N(1, 0) - N(0, 1)));
  return Eigen::AngleAxisd(std::atan2(B, A), a).toRotationMatrix() * R0;
}

/// The rigid motion (R, t) that minimises Σ ‖truth - (R estimate + t)‖² over positions, and the
/// sums that it follows from, of positions relative to their centroids.
struct Aligned {
  Pose motion;
  double product = 0.0;                              ///< Σ truth · R estimate [m²]
  double estimate_spread = 0.0, truth_spread = 0.0;  ///< Σ ‖·‖² [m²]
  double spread() const { return std::sqrt(estimate_spread * truth_spread); }
};

Aligned align(const Pairs& pairs) {
  const Vector3d estimate_centre = centroid(pairs.estimate), truth_centre = centroid(pairs.truth);
  Aligned result;
  Matrix3d M = Matrix3d::Zero(), orientations = Matrix3d::Zero();
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const Vector3d e = pairs.estimate[k].t - estimate_centre, t = pairs.truth[k].t - truth_centre;
    M += t * e.transpose();
    orientations += pairs.truth[k].R * pairs.estimate[k].R.transpose();
    result.estimate_spread += e.squaredNorm();
    result.truth_spread += t.squaredNorm();
  }
  const Matrix3d R = pairs.planar ? planar_rotation(M, orientations, result.spread())
                                  : spatial_rotation(M, orientations, result.spread());
  result.motion = {R, truth_centre - R * estimate_centre};
  result.product = (R.transpose() * M).trace();
  return result;
}

/// None where one trajectory is in one point.
std::optional<double> scale_of(const Aligned& aligned) {
  if (!(aligned.product > kDegenerate * aligned.spread())) return std::nullopt;
  return aligned.product / aligned.estimate_spread;
}

}  // namespace

Pose align(const TrajectoryPairs& pairs) { return align(pairs_of(pairs)).motion; }

double aligning_scale(const TrajectoryPairs& pairs) {
  const std::optional<double> scale = scale_of(align(pairs_of(pairs)));
  if (!scale) {
    throw Error(ErrorCode::input,
                "cannot align with scale: all positions of the estimate, or of the truth, are one "
                "point");
  }
  return *scale;
}

std::optional<double> explaining_scale(const TrajectoryPairs& poses) {
  constexpr std::size_t kFewest = 4;
  constexpr double kLeast = 0.02, kLeft = 0.25, kSure = 300.0;
  if (poses.truth.size() < kFewest) return std::nullopt;
  const Aligned aligned = align(pairs_of(poses));
  const std::optional<double> scale = scale_of(aligned);
  if (!scale || std::abs(*scale - 1.0) <= kLeast) return std::nullopt;
  // Σ ‖t - s R e‖² with s = 1, and with the scale.
  const double rigid = aligned.truth_spread - 2.0 * aligned.product + aligned.estimate_spread;
  const double similar = aligned.truth_spread - *scale * aligned.product;
  // Per degree of freedom that is left: few poses must agree the better.
  const double freedom = 3.0 * static_cast<double>(poses.truth.size()) - 7.0;
  const bool explains =
      similar <= kLeft * kLeft * rigid && (rigid - similar) * freedom >= kSure * similar;
  return explains ? scale : std::nullopt;
}

namespace {

// Errors ------------------------------------------------------------------------------------------

/// Sums of squared errors: translations [m²] and rotation angles [rad²].
struct Squares {
  double translation = 0.0;
  double rotation = 0.0;
  Squares& operator+=(const Squares& other) {
    translation += other.translation;
    rotation += other.rotation;
    return *this;
  }
};

/// So many pairs at once, which the compiler turns into vectors.
template <int N>
using Lanes = Eigen::Array<double, N, 1>;

/// asin²(√v) = ½ Σ (4v)ⁿ / (n² (2n over n)), n = 1, 2 …; here 64 times that. These terms give all
/// digits of a double up to v = 0.15.
constexpr std::array<double, 19> kSquaredArcSine = [] {
  std::array<double, 19> terms{64.0};
  for (std::size_t k = 1; k < terms.size(); ++k) {
    const auto n = static_cast<double>(k);
    terms[k] = terms[k - 1] * 2.0 * n * n / ((n + 1.0) * (2.0 * n + 1.0));
  }
  return terms;
}();

/// Squared angles [rad²] between orientations from the squared chords between their unit
/// quaternions, θ = 4 asin(chord/2): precise for small angles too, where an arc cosine is not. With
/// u = chord²/4 ≤ ½ and asin(√u) = 2 asin(√v) a short series is enough.
template <int N>
Lanes<N> squared_angles(const Lanes<N>& squared_chords) {
  const Lanes<N> u = 0.25 * squared_chords;
  const Lanes<N> v = 0.5 * u / (1.0 + (1.0 - u).sqrt());
  Lanes<N> sum = Lanes<N>::Constant(kSquaredArcSine.back());
  for (std::size_t k = kSquaredArcSine.size() - 1; k-- > 0;) sum = sum * v + kSquaredArcSine[k];
  return sum * v;
}

double squared_angle(const Eigen::Vector4d& p, const Eigen::Vector4d& q) {
  const double squared_chord = std::min((p - q).squaredNorm(), (p + q).squaredNorm());
  return squared_angles<1>(Lanes<1>(squared_chord))[0];
}

Eigen::Vector4d quaternion(const Matrix3d& R) { return Quaterniond(R).normalized().coeffs(); }

Squares absolute_errors(const Pairs& pairs) {
  const Pose motion = align(pairs).motion;
  Squares sum;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const Pose &e = pairs.estimate[k], &t = pairs.truth[k];
    sum.translation += (t.t - (motion.R * e.t + motion.t)).squaredNorm();
    sum.rotation += squared_angle(quaternion(t.R), quaternion(motion.R * e.R));
  }
  return sum;
}

/// The error of the motion from i to j is E = (Tᵢ⁻¹ Tⱼ)⁻¹ (T̂ᵢ⁻¹ T̂ⱼ), T true and T̂ estimated. With
/// D = R R̂ᵀ its translation has the norm of (tⱼ - tᵢ) - Dᵢ (t̂ⱼ - t̂ᵢ), and its rotation the angle
/// between Dᵢ and Dⱼ: so that a pair costs one rotated vector and a difference of quaternions.
/// There are n²/2 pairs, so everything lies by coordinates, for several j at once.
class RelativeErrors {
 public:
  explicit RelativeErrors(const Pairs& pairs)
      : size_(static_cast<Index>(pairs.size())),
        D_(pairs.size()),
        q_(size_, 4),
        truth_(size_, 3),
        estimate_(size_, 3) {
    for (Index k = 0; k < size_; ++k) {
      const Pose &t = pairs.truth[k], &e = pairs.estimate[k];
      D_[k] = t.R * e.R.transpose();
      q_.row(k) = quaternion(D_[k]).transpose();
      truth_.row(k) = t.t.transpose();
      estimate_.row(k) = e.t.transpose();
    }
  }

  Index size() const { return size_; }

  /// The sum over the pairs (i, j), begin ≤ j < end.
  Squares sum(Index i, Index begin, Index end) const {
    constexpr int kLanes = 8;
    Lanes<kLanes> translation = Lanes<kLanes>::Zero(), rotation = Lanes<kLanes>::Zero();
    Index j = begin;
    for (; j + kLanes <= end; j += kLanes) {
      translation += translations<kLanes>(i, j);
      rotation += rotations<kLanes>(i, j);
    }
    Squares sum{translation.sum(), rotation.sum()};
    for (; j < end; ++j) {
      sum.translation += translations<1>(i, j)[0];
      sum.rotation += rotations<1>(i, j)[0];
    }
    return sum;
  }

 private:
  using Coordinates = Eigen::ArrayXXd;  // a row a pose

  /// Coordinate c of poses j, j + 1 … relative to that of pose i.
  template <int N>
  static Lanes<N> relative(const Coordinates& all, Index i, Index j, int c) {
    return all.col(c).segment<N>(j) - all(i, c);
  }

  template <int N>
  Lanes<N> translations(Index i, Index j) const {
    const Matrix3d& D = D_[i];
    const Lanes<N> x = relative<N>(estimate_, i, j, 0), y = relative<N>(estimate_, i, j, 1),
                   z = relative<N>(estimate_, i, j, 2);
    Lanes<N> sum = Lanes<N>::Zero();
    for (int c = 0; c < 3; ++c) {
      sum += (relative<N>(truth_, i, j, c) - (D(c, 0) * x + D(c, 1) * y + D(c, 2) * z)).square();
    }
    return sum;
  }

  template <int N>
  Lanes<N> rotations(Index i, Index j) const {
    Lanes<N> minus = Lanes<N>::Zero(), plus = Lanes<N>::Zero();  // q and -q are one rotation
    for (int c = 0; c < 4; ++c) {
      const Lanes<N> q = q_.col(c).segment<N>(j);
      minus += (q - q_(i, c)).square();
      plus += (q + q_(i, c)).square();
    }
    return squared_angles<N>(minus.min(plus));
  }

  Index size_;
  std::vector<Matrix3d> D_;
  Coordinates q_, truth_, estimate_;
};

Squares consecutive_errors(const RelativeErrors& errors) {
  Squares sum;
  for (Index k = 0; k + 1 < errors.size(); ++k) sum += errors.sum(k, k + 1, k + 2);
  return sum;
}

/// Row i holds the pairs (i, j), j > i. Rows are summed apart and then in order: the result does
/// not depend on the number of threads.
Squares all_errors(const RelativeErrors& errors) {
  std::vector<Squares> rows(static_cast<std::size_t>(errors.size()));
  for_each_range(rows.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      rows[i] = errors.sum(static_cast<Index>(i), static_cast<Index>(i) + 1, errors.size());
    }
  });
  Squares sum;
  for (const Squares& row : rows) sum += row;
  return sum;
}

}  // namespace

TrajectoryError compare(const TrajectoryPairs& poses, Alignment alignment) {
  assert(poses.estimate.size() == poses.truth.size() && poses.truth.size() >= 2);
  Pairs pairs = pairs_of(poses);
  const double scale = alignment == Alignment::similarity ? aligning_scale(poses) : 1.0;
  for (Pose& pose : pairs.estimate) pose.t *= scale;
  const RelativeErrors relative(pairs);
  const Squares absolute = absolute_errors(pairs);
  const Squares consecutive = consecutive_errors(relative);
  const Squares all = all_errors(relative);

  const auto n = static_cast<double>(pairs.size());
  const auto root_mean = [](double sum, double count) { return std::sqrt(sum / count); };
  TrajectoryError error;
  error.poses = static_cast<std::int64_t>(pairs.size());
  error.scale = scale;
  error.ate_translation = root_mean(absolute.translation, n);
  error.ate_rotation = kDegrees * root_mean(absolute.rotation, n);
  error.rpe_translation = root_mean(consecutive.translation, n - 1.0);
  error.rpe_rotation = kDegrees * root_mean(consecutive.rotation, n - 1.0);
  error.rpe_all_translation = root_mean(all.translation, 0.5 * n * (n - 1.0));
  error.rpe_all_rotation = kDegrees * root_mean(all.rotation, 0.5 * n * (n - 1.0));
  return error;
}

TrajectoryError compare(const Trajectory& estimate, const Trajectory& truth) {
  return compare(pair_by_id(estimate, truth));
}

double rotation_error(const TrajectoryPairs& poses) {
  const Pairs pairs = pairs_of(poses);
  return kDegrees * std::sqrt(absolute_errors(pairs).rotation / static_cast<double>(pairs.size()));
}

std::optional<CameraAxes> camera_axes_of_one(const TrajectoryPairs& pairs, double ate_rotation) {
  constexpr double kFar = 90.0, kShare = 0.1;  // [deg], of the error
  if (ate_rotation < kFar) return std::nullopt;
  for (const bool of_estimate : {true, false}) {
    TrajectoryPairs turned = pairs;
    Trajectory& poses = of_estimate ? turned.estimate : turned.truth;
    poses = camera_to_robot_axes(std::move(poses));
    const double left = rotation_error(turned);
    if (left <= kShare * ate_rotation) return CameraAxes{of_estimate, left};
  }
  return std::nullopt;
}

double absolute_error(const Trajectory& estimate, const Trajectory& truth) {
  const Pairs pairs = pairs_of(pair_by_id(estimate, truth));
  return std::sqrt(absolute_errors(pairs).translation / static_cast<double>(pairs.size()));
}

ResultFields<TrajectoryError> TrajectoryError::fields() {
  using E = TrajectoryError;
  return ResultFields<E>()
      .figure("scale", &E::scale,
              "by which the positions of the estimate were multiplied; 1 without align_scale")
      .round("{:.6g}")
      .figure("poses", &E::poses, "how many were compared")
      .figure("ate.translation", &E::ate_translation, "m", "absolute, after alignment")
      .round("{:.6g}")
      .attribute("ate_translation")
      .figure("ate.rotation", &E::ate_rotation, "deg", "absolute, after alignment")
      .round("{:.6g}")
      .attribute("ate_rotation")
      .figure("rpe.translation", &E::rpe_translation, "m", "relative, between consecutive poses")
      .round("{:.6g}")
      .attribute("rpe_translation")
      .figure("rpe.rotation", &E::rpe_rotation, "deg", "relative, between consecutive poses")
      .round("{:.6g}")
      .attribute("rpe_rotation")
      .figure("rpe_all.translation", &E::rpe_all_translation, "m", "relative, over all pairs")
      .round("{:.6g}")
      .attribute("rpe_all_translation")
      .figure("rpe_all.rotation", &E::rpe_all_rotation, "deg", "relative, over all pairs")
      .round("{:.6g}")
      .attribute("rpe_all_rotation")
      .details();
}

}  // namespace cairn
