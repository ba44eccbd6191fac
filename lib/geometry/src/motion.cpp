// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/motion.hpp"

#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Core>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using MatrixMap = Eigen::Map<const MatrixXd>;

Error bad_call(const std::string& message) { return {ErrorCode::usage, message}; }
Error bad_input(const std::string& message) { return {ErrorCode::input, message}; }

std::vector<double> numbers(int count) {
  return std::vector<double>(static_cast<std::size_t>(count));
}

MatrixMap covariance(const Motion& motion, int n) {
  assert(std::ssize(motion.covariance) == n * n);
  return {motion.covariance.data(), n, n};
}

/// As a vector, and symmetric to the last bit, which sums of products are not.
std::vector<double> symmetric(const MatrixXd& S) {
  std::vector<double> out(static_cast<std::size_t>(S.size()));
  Eigen::Map<MatrixXd>(out.data(), S.rows(), S.cols()) = 0.5 * (S + S.transpose());
  return out;
}

// Structure constants -----------------------------------------------------------------------------

/// ad(e_k), the derivative of Ad(exp(h e_k)) by h at 0. Ad(exp(h e_k)) = exp(h ad(e_k)) has all its
/// derivatives; so steps may be large, where nothing cancels, and Richardson's extrapolation of
/// central differences takes out the terms in h², h⁴ and h⁶. What is left is below 1e-13 where the
/// constants are about one, as for poses.
MatrixXd structure_constants(const LieGroup& group, int ambient, int tangent, int k) {
  constexpr int kSteps = 4;
  VectorXd delta = VectorXd::Zero(tangent);
  std::vector<double> x = numbers(ambient);
  MatrixXd Ad(tangent, tangent);
  const auto adjoint_at = [&](double h) -> const MatrixXd& {
    delta[k] = h;
    group.exp(delta.data(), x.data());
    group.adjoint(x.data(), Ad.data());
    return Ad;
  };
  std::array<MatrixXd, kSteps> difference;
  double h = 0.25;
  for (int step = 0; step < kSteps; ++step, h *= 0.5) {
    difference[step] = adjoint_at(h);
    difference[step] -= adjoint_at(-h);
    difference[step] /= 2.0 * h;
    double power = 1.0;
    for (int finer = step; finer > 0; --finer) {
      power *= 4.0;
      difference[finer - 1] = (power * difference[finer] - difference[finer - 1]) / (power - 1.0);
    }
  }
  return difference[0];
}

/// What the moments of fourth order need of ξ ~ N(0, Σ).
class Moments {
 public:
  /// `ad`: those of all unit vectors, one after the other.
  Moments(const std::vector<double>& ad, const MatrixXd& Sigma)
      : ad_(ad),
        n_(Sigma.rows()),
        weighted_(dense::product(MatrixMap(ad.data(), n_ * n_, n_), Sigma)) {}

  /// E[ad(ξ) ad(ξ)]
  MatrixXd squared() const {
    MatrixXd P = MatrixXd::Zero(n_, n_);
    for (Eigen::Index j = 0; j < n_; ++j) dense::add_product(ad(j), weighted(j), P);
    return P;
  }
  /// E[ad(ξ) S ad(ξ)ᵀ]
  MatrixXd around(const MatrixXd& S) const {
    MatrixXd B = MatrixXd::Zero(n_, n_), product(n_, n_);
    for (Eigen::Index j = 0; j < n_; ++j) {
      dense::set_product(ad(j), S, product);
      dense::add_product_with_transpose(product, weighted(j), B);
    }
    return B;
  }

 private:
  MatrixMap ad(Eigen::Index j) const { return {ad_.data() + j * n_ * n_, n_, n_}; }
  /// Σ_k Σ_jk ad(e_k)
  MatrixMap weighted(Eigen::Index j) const { return {weighted_.col(j).data(), n_, n_}; }

  const std::vector<double>& ad_;
  Eigen::Index n_;
  MatrixXd weighted_;
};

// Information -------------------------------------------------------------------------------------

/// S⁻¹ of a symmetric, positive definite matrix; false if it is not that.
bool invert(const MatrixXd& S, MatrixXd& inverse) {
  // Scaled to a unit diagonal, so that it does not matter what is in metres and what in radians. A
  // diagonal that is not positive leaves infinities and what is not a number.
  const VectorXd scale = S.diagonal().cwiseSqrt().cwiseInverse();
  const MatrixXd scaled = scale.asDiagonal() * S * scale.asDiagonal();
  const Eigen::LLT<MatrixXd> llt(scaled);
  if (llt.info() != Eigen::Success) return false;
  inverse = scale.asDiagonal() * llt.solve(MatrixXd(scale.asDiagonal()));
  return inverse.allFinite();
}

MatrixXd information_of(const Motion& motion, int n) {
  MatrixXd Omega;
  if (!invert(covariance(motion, n), Omega)) {
    throw Error(
        ErrorCode::numerical,
        "a relative pose has a covariance that is not positive definite, and so no information "
        "matrix (one that is known exactly has none either)");
  }
  return Omega;
}

}  // namespace

MotionGroup::MotionGroup(std::shared_ptr<const VariableType> type) : type_(std::move(type)) {
  if (!type_) throw bad_call("MotionGroup: no variable type");
  group_ = type_->lie_group();
  if (!group_) {
    throw bad_call(
        fmt::format("{} forms no Lie group (it lacks the ability LieGroup), and relative poses are "
                    "elements of one; "
                    "poses such as VERTEX_SE2 and VERTEX_SE3:QUAT do",
                    type_->tag()));
  }
  ambient_ = type_->ambient_size();
  tangent_ = type_->tangent_size();
  for (int k = 0; k < tangent_; ++k) {
    const MatrixXd ad = structure_constants(*group_, ambient_, tangent_, k);
    ad_.insert(ad_.end(), ad.data(), ad.data() + ad.size());
  }
}

Motion MotionGroup::identity() const {
  Motion motion{numbers(ambient_), numbers(tangent_ * tangent_)};
  type_->identity(motion.mean.data());
  return motion;
}

Motion MotionGroup::compose(const Motion& a, const Motion& b, CompositionOrder order) const {
  Motion ab{numbers(ambient_), {}};
  group_->inverse(b.mean.data(), ab.mean.data());
  MatrixXd A(tangent_, tangent_);
  group_->adjoint(ab.mean.data(), A.data());
  group_->compose(a.mean.data(), b.mean.data(), ab.mean.data());
  type_->normalize(ab.mean.data());  // or rounding would pile up over many steps

  const MatrixXd Sigma_1 = dense::congruent(A, covariance(a, tangent_));
  const MatrixMap Sigma_2 = covariance(b, tangent_);
  MatrixXd Sigma = Sigma_1 + Sigma_2;
  if (order == CompositionOrder::fourth) {
    const Moments first(ad_, Sigma_1), second(ad_, Sigma_2);
    Sigma += 0.25 * first.around(Sigma_2);
    // Twice P Σ stands for P Σ and its transpose: made symmetric below, it is their sum.
    Sigma += (2.0 / 12.0) *
             (dense::product(first.squared(), Sigma_2) + dense::product(second.squared(), Sigma_1));
  }
  ab.covariance = symmetric(Sigma);
  return ab;
}

Motion MotionGroup::inverse(const Motion& a) const {
  Motion back{numbers(ambient_), {}};
  group_->inverse(a.mean.data(), back.mean.data());
  type_->normalize(back.mean.data());
  MatrixXd Ad(tangent_, tangent_);
  group_->adjoint(a.mean.data(), Ad.data());
  back.covariance = symmetric(dense::congruent(Ad, covariance(a, tangent_)));
  return back;
}

Motion MotionGroup::fuse(const Motion& a, const Motion& b) const {
  constexpr int kMaxSteps = 10;
  constexpr double kSmall = 1e-10;  // of a step: what is left after it is smaller by far
  const std::array<const Motion*, 2> motions{&a, &b};
  const std::array Omega{information_of(a, tangent_), information_of(b, tangent_)};
  std::vector<double> one = numbers(ambient_), x = a.mean;
  type_->identity(one.data());
  MatrixXd J_r(tangent_, tangent_), H(tangent_, tangent_);
  VectorXd r(tangent_), g(tangent_);
  const auto linearize = [&] {
    H.setZero();
    g.setZero();
    for (std::size_t k = 0; k < 2; ++k) {
      type_->local(1, motions[k]->mean.data(), x.data(), r.data());
      type_->retract_jacobian(one.data(), r.data(), J_r.data());
      const MatrixXd D = J_r.inverse(), weighted = dense::product_of_transpose(D, Omega[k]);
      dense::add_product(weighted, D, H);
      g.noalias() -= weighted * r;
    }
  };
  linearize();
  for (int k = 0; k < kMaxSteps; ++k) {
    const VectorXd step = H.llt().solve(g);
    const std::int64_t offset = 0;
    type_->retract(1, x.data(), &offset, step.data(), x.data());
    linearize();
    if (step.norm() < kSmall) break;
  }
  type_->normalize(x.data());
  MatrixXd Sigma;
  if (!invert(H, Sigma))
    throw Error(ErrorCode::numerical, "two relative poses cannot be fused: their numbers overflow");
  return {std::move(x), symmetric(Sigma)};
}

// Factors -----------------------------------------------------------------------------------------

/// D = ∂error/∂ξ where the error is zero: x_0 = 1, x_1 = z exp(ξ).
std::vector<double> MotionGroup::of_error_metric(const FactorType& type,
                                                 std::span<const double> z) const {
  const int rows = type.residual_size();
  if (!type.is_relative() || type.variable_tags()[0] != type_->tag() ||
      type.tangent_size(0) != tangent_ || type.measurement_size() != ambient_) {
    throw bad_call(fmt::format(
        "{} does not measure the motion from one {} to another; a relative factor between two of "
        "them does",
        type.tag(), type_->tag()));
  }
  if (z.size() != static_cast<std::size_t>(ambient_)) {
    throw bad_input(fmt::format("{}: a measurement of {} numbers, expected {}", type.tag(),
                                z.size(), ambient_));
  }
  std::vector<double> one = numbers(ambient_), error = numbers(rows), D = numbers(rows * tangent_);
  type_->identity(one.data());
  const std::vector<double> unit = pack(MatrixXd::Identity(rows, rows));
  const std::array<const double*, 2> x{one.data(), z.data()};
  const std::array<double*, 2> jacobians{nullptr, D.data()};
  type.evaluate(x.data(), z.data(), unit.data(), error.data(), jacobians.data());
  return D;
}

Motion MotionGroup::of_factor(const FactorType& type, std::span<const double> measurement,
                              std::span<const double> information) const {
  return measured(type, measurement, information, std::string(type.tag()));
}

Motion MotionGroup::measured(const FactorType& type, std::span<const double> measurement,
                             std::span<const double> information, const std::string& name) const {
  const int rows = type.residual_size();
  if (measurement.size() != static_cast<std::size_t>(type.measurement_size()) ||
      information.size() != packed_size(rows)) {
    throw bad_input(fmt::format(
        "{}: {} + {} numbers, expected a measurement of {} and an information matrix of {}", name,
        measurement.size(), information.size(), type.measurement_size(), packed_size(rows)));
  }
  Motion motion{{measurement.begin(), measurement.end()}, {}};
  if (const std::string problem = type.normalize(motion.mean.data()); !problem.empty())
    throw bad_input(fmt::format("{}: {}", name, problem));
  const std::vector<double> metric = of_error_metric(type, motion.mean);
  const MatrixMap D(metric.data(), rows, tangent_);
  MatrixXd Sigma;
  if (!invert(dense::congruent_of_transpose(D, unpack(information, rows)), Sigma)) {
    throw bad_input(
        fmt::format("{}: the information matrix is not positive definite, and the covariance of a "
                    "relative pose is its inverse; expected one of full rank",
                    name));
  }
  motion.covariance = symmetric(Sigma);
  return motion;
}

Motion MotionGroup::of_factor(const Factor& factor, Id from) const {
  if (!factor.type) throw bad_call("MotionGroup: a factor without a type");
  const std::vector<Id>& on = factor.variables;
  if (on.size() != static_cast<std::size_t>(factor.type->arity())) {
    throw bad_input(fmt::format("{} joins {} variables, not {}", factor.type->tag(),
                                factor.type->arity(), on.size()));
  }
  const Motion motion =
      measured(*factor.type, factor.measurement, factor.information,
               fmt::format("{} {}", factor.type->tag(), fmt::join(factor.variables, " ")));
  if (from == on[0]) return motion;
  if (from == on[1]) return inverse(motion);
  throw bad_call(fmt::format("{} {} {} is not a motion from variable {}, which is not on it",
                             factor.type->tag(), on[0], on[1], from));
}

Factor MotionGroup::to_factor(std::shared_ptr<const FactorType> type, Id from, Id to,
                              const Motion& motion) const {
  if (!type) throw bad_call("MotionGroup: no factor type");
  const std::vector<double> metric = of_error_metric(*type, motion.mean);
  if (type->residual_size() != tangent_) {
    throw bad_call(fmt::format(
        "{} has {} residuals and a relative pose {} degrees of freedom: it cannot measure all of "
        "them; a factor type with as many of both can",
        type->tag(), type->residual_size(), tangent_));
  }
  const MatrixXd D = MatrixMap(metric.data(), tangent_, tangent_), D_inverse = D.inverse();
  const MatrixXd Omega = dense::congruent_of_transpose(D_inverse, information_of(motion, tangent_));
  return {std::move(type), {from, to}, motion.mean, pack(0.5 * (Omega + Omega.transpose()))};
}

}  // namespace cairn
