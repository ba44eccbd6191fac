// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/trajectory.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "cairn/error.hpp"
#include "cairn/threads.hpp"

namespace cairn {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kDegrees = 57.295779513082320877;  // of a radian

struct Pose {
  Matrix3d R;
  Vector3d t;
};

Pose pose_of(const TrajectoryPose& pose) {
  return {Eigen::Map<const Matrix3d>(pose.R.data()), Eigen::Map<const Vector3d>(pose.t.data())};
}

struct Pairs {
  std::vector<Pose> estimate, truth;
  std::size_t size() const { return truth.size(); }
};

Pairs match(const Trajectory& estimate, const Trajectory& truth) {
  Pairs pairs;
  auto e = estimate.begin();
  auto t = truth.begin();
  while (e != estimate.end() && t != truth.end()) {
    if (e->id < t->id) {
      ++e;
    } else if (t->id < e->id) {
      ++t;
    } else {
      pairs.estimate.push_back(pose_of(*e++));
      pairs.truth.push_back(pose_of(*t++));
    }
  }
  return pairs;
}

// Alignment
// -----------------------------------------------------------------------------------------

Vector3d centroid(const std::vector<Pose>& poses) {
  Vector3d sum = Vector3d::Zero();
  for (const Pose& pose : poses) sum += pose.t;
  return sum / static_cast<double>(poses.size());
}

bool is_planar(const std::vector<Pose>& poses) {
  return std::all_of(poses.begin(), poses.end(),
                     [](const Pose& pose) { return pose.t.z() == 0.0 && pose.R(2, 2) == 1.0; });
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

/// The rigid motion (R, t) that minimises Σ ‖truth - (R estimate + t)‖² over positions.
Pose align(const Pairs& pairs) {
  const Vector3d estimate_centre = centroid(pairs.estimate), truth_centre = centroid(pairs.truth);
  Matrix3d M = Matrix3d::Zero(), orientations = Matrix3d::Zero();
  double estimate_spread = 0.0, truth_spread = 0.0;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const Vector3d e = pairs.estimate[k].t - estimate_centre, t = pairs.truth[k].t - truth_centre;
    M += t * e.transpose();
    orientations += pairs.truth[k].R * pairs.estimate[k].R.transpose();
    estimate_spread += e.squaredNorm();
    truth_spread += t.squaredNorm();
  }
  const double spread = std::sqrt(estimate_spread * truth_spread);
  const bool planar = is_planar(pairs.estimate) && is_planar(pairs.truth);
  const Matrix3d R =
      planar ? planar_rotation(M, orientations, spread) : spatial_rotation(M, orientations, spread);
  return {R, truth_centre - R * estimate_centre};
}

// Errors
// ----------------------------------------------------------------------------------------------

/// Sums of squared errors: translations [m²] and rotation angles [rad²].
struct Squares {
  double translation = 0.0;
  double rotation = 0.0;
};

/// The angle between two orientations, from the chord between unit quaternions: precise for small
/// angles too, where an arc cosine is not.
double angle_between(const Eigen::Vector4d& p, const Eigen::Vector4d& q) {
  const double chord = std::sqrt(std::min((p - q).squaredNorm(), (p + q).squaredNorm()));
  return 4.0 * std::asin(std::min(1.0, 0.5 * chord));
}

Eigen::Vector4d quaternion(const Matrix3d& R) { return Quaterniond(R).normalized().coeffs(); }

Squares absolute_errors(const Pairs& pairs) {
  const Pose motion = align(pairs);
  Squares sum;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const Pose &e = pairs.estimate[k], &t = pairs.truth[k];
    sum.translation += (t.t - (motion.R * e.t + motion.t)).squaredNorm();
    const double angle = angle_between(quaternion(t.R), quaternion(motion.R * e.R));
    sum.rotation += angle * angle;
  }
  return sum;
}

/// The error of the motion from i to j is E = (Tᵢ⁻¹ Tⱼ)⁻¹ (T̂ᵢ⁻¹ T̂ⱼ), T true and T̂ estimated. Its
/// translation has the norm of R̂ᵢᵀ(t̂ⱼ - t̂ᵢ) - Rᵢᵀ(tⱼ - tᵢ), and its rotation the angle between Dᵢ
/// and Dⱼ, D = R R̂ᵀ: so that a pair costs two rotated vectors and a difference of quaternions.
class RelativeErrors {
 public:
  explicit RelativeErrors(const Pairs& pairs) : pairs_(pairs), D_(pairs.size()) {
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      D_[k] = quaternion(pairs.truth[k].R * pairs.estimate[k].R.transpose());
    }
  }

  void add(std::size_t i, std::size_t j, Squares& sum) const {
    const Pose &ei = pairs_.estimate[i], &ti = pairs_.truth[i];
    const Vector3d estimated = ei.R.transpose() * (pairs_.estimate[j].t - ei.t);
    const Vector3d measured = ti.R.transpose() * (pairs_.truth[j].t - ti.t);
    const double angle = angle_between(D_[i], D_[j]);
    sum.translation += (estimated - measured).squaredNorm();
    sum.rotation += angle * angle;
  }

 private:
  const Pairs& pairs_;
  std::vector<Eigen::Vector4d> D_;
};

Squares consecutive_errors(const Pairs& pairs, const RelativeErrors& errors) {
  Squares sum;
  for (std::size_t k = 0; k + 1 < pairs.size(); ++k) errors.add(k, k + 1, sum);
  return sum;
}

/// Row i holds the pairs (i, j), j > i. Rows are summed apart and then in order: the result does
/// not depend on the number of threads.
Squares all_errors(const Pairs& pairs, const RelativeErrors& errors) {
  std::vector<Squares> rows(pairs.size());
  for_each_range(pairs.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      for (std::size_t j = i + 1; j < pairs.size(); ++j) errors.add(i, j, rows[i]);
    }
  });
  Squares sum;
  for (const Squares& row : rows) {
    sum.translation += row.translation;
    sum.rotation += row.rotation;
  }
  return sum;
}

}  // namespace

Trajectory trajectory(const Graph& graph) {
  Trajectory result;
  for (int v = 0; v < graph.variable_count(); ++v) {
    const Placement* placement = graph.type(v).placement();
    if (!placement || !placement->has_orientation()) continue;
    TrajectoryPose pose;
    pose.id = graph.id(v);
    if (placement->dimension() == 3) {
      placement->split(graph.state(v).data(), pose.R.data(), pose.t.data());
    } else {
      std::array<double, 4> R{};
      std::array<double, 2> t{};
      placement->split(graph.state(v).data(), R.data(), t.data());
      pose.t = {t[0], t[1], 0.0};
      pose.R = {R[0], R[1], 0.0, R[2], R[3], 0.0, 0.0, 0.0, 1.0};
    }
    result.push_back(pose);
  }
  std::sort(result.begin(), result.end(),
            [](const TrajectoryPose& a, const TrajectoryPose& b) { return a.id < b.id; });
  return result;
}

TrajectoryError compare(const Trajectory& estimate, const Trajectory& truth) {
  const Pairs pairs = match(estimate, truth);
  if (pairs.size() < 2) {
    throw Error(ErrorCode::input,
                "cannot compare trajectories: of " + std::to_string(estimate.size()) +
                    " estimated and " + std::to_string(truth.size()) + " true poses only " +
                    std::to_string(pairs.size()) + " have an id in both; at least two are needed");
  }
  const RelativeErrors relative(pairs);
  const Squares absolute = absolute_errors(pairs);
  const Squares consecutive = consecutive_errors(pairs, relative);
  const Squares all = all_errors(pairs, relative);

  const auto n = static_cast<double>(pairs.size());
  const auto root_mean = [](double sum, double count) { return std::sqrt(sum / count); };
  TrajectoryError error;
  error.poses = static_cast<std::int64_t>(pairs.size());
  error.ate_translation = root_mean(absolute.translation, n);
  error.ate_rotation = kDegrees * root_mean(absolute.rotation, n);
  error.rpe_translation = root_mean(consecutive.translation, n - 1.0);
  error.rpe_rotation = kDegrees * root_mean(consecutive.rotation, n - 1.0);
  error.rpe_all_translation = root_mean(all.translation, 0.5 * n * (n - 1.0));
  error.rpe_all_rotation = kDegrees * root_mean(all.rotation, 0.5 * n * (n - 1.0));
  return error;
}

}  // namespace cairn
