// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/information/gaussian.hpp"

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Core>

#include "cairn/runtime/error.hpp"
#include "support/dense_algebra.hpp"
#include "support/sampling.hpp"

namespace cairn::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using ::testing::DoubleNear;
using ::testing::HasSubstr;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

class GaussianMeasures : public testing::Test {
 protected:
  MatrixXd any(Eigen::Index rows, Eigen::Index columns) {
    MatrixXd A(rows, columns);
    for (double& x : A.reshaped()) x = sampler_.uniform(-1.0, 1.0);
    return A;
  }
  MatrixXd definite(Eigen::Index n) {
    const MatrixXd A = any(n, n);
    return A * A.transpose() + 0.1 * MatrixXd::Identity(n, n);
  }
  Gaussian gaussian(Eigen::Index n) { return {any(n, 1), definite(n)}; }
  Sampler sampler_{7};
};

MatrixXd block(double a, double ab, double b) {
  MatrixXd S(2, 2);
  S << a, ab, ab, b;
  return S;
}

Gaussian scalar(double mean, double variance) {
  return {VectorXd::Constant(1, mean), MatrixXd::Constant(1, 1, variance)};
}

Gaussian centred(const MatrixXd& S) { return {VectorXd::Zero(S.rows()), S}; }

/// ∫ f over 12 standard deviations of both sides.
double integral(const std::function<double(double)>& f) {
  constexpr int kSteps = 20000;
  constexpr double kFrom = -40.0, kTo = 40.0, kStep = (kTo - kFrom) / kSteps;
  double sum = 0.0;
  for (int k = 0; k < kSteps; ++k) sum += f(kFrom + (k + 0.5) * kStep);
  return sum * kStep;
}

double log_density(double x, const Gaussian& p) {
  const double variance = p.covariance(0, 0), d = x - p.mean[0];
  return -0.5 * (std::log(2.0 * std::numbers::pi * variance) + d * d / variance);
}

void expect_refusal(const std::function<double()>& call, ErrorCode code, const char* says) {
  try {
    call();
    ADD_FAILURE() << "no error; expected " << says;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    EXPECT_THAT(error.what(), HasSubstr(says));
  }
}

// By their definitions, integrated.
TEST_F(GaussianMeasures, OfScalarsAreTheIntegrals) {
  const Gaussian p = scalar(0.5, 2.0), q = scalar(-0.3, 3.5);
  const double H =
      integral([&](double x) { return -std::exp(log_density(x, p)) * log_density(x, p); });
  EXPECT_NEAR(entropy(p.covariance), H, 1e-9);
  const double D = integral([&](double x) {
    return std::exp(log_density(x, p)) * (log_density(x, p) - log_density(x, q));
  });
  EXPECT_NEAR(kullback_leibler(p, q).total(), D, 1e-9);
  const double cross =
      integral([&](double x) { return -std::exp(log_density(x, p)) * log_density(x, q); });
  EXPECT_NEAR(cross_entropy(p, q), cross, 1e-9);
}

TEST_F(GaussianMeasures, EntropyIsThatOfTheDeterminant) {
  for (const int n : {1, 2, 3, 6, 17, 40}) {
    const MatrixXd S = definite(n);
    const double expected =
        0.5 * (n * std::log(2.0 * std::numbers::pi * std::numbers::e) + log_determinant_of(S));
    EXPECT_NEAR(entropy(S), expected, 1e-11 * n);
    EXPECT_NEAR(entropy_of_information(n, log_determinant_of(symmetric_inverse(S))), expected,
                1e-9 * n);
    // Millimetres instead of metres.
    EXPECT_NEAR(entropy(1e6 * S), expected + n * std::log(1e3), 1e-11 * n);
  }
  EXPECT_EQ(entropy(MatrixXd(0, 0)), 0.0);
}

TEST_F(GaussianMeasures, MutualInformationOfAPairIsThatOfItsCorrelation) {
  for (const double rho : {0.0, 1e-12, -1e-8, 1e-3, 0.5, -0.9, 0.999999}) {
    const double expected = -0.5 * std::log1p(-rho * rho);
    // In any units.
    EXPECT_NEAR(mutual_information(block(4.0, rho * 2.0 * 1e-6, 1e-12), 1), expected,
                1e-9 * expected)
        << rho;
  }
}

TEST_F(GaussianMeasures, MutualInformationIsTheDifferenceOfEntropies) {
  for (const auto& [m, n] : {std::pair{1, 1}, {3, 3}, {6, 6}, {2, 9}, {9, 2}, {20, 30}}) {
    const MatrixXd S = definite(m + n);
    const double expected =
        entropy(S.topLeftCorner(m, m)) + entropy(S.bottomRightCorner(n, n)) - entropy(S);
    const double tolerance = 1e-10 * (1.0 + expected);
    EXPECT_NEAR(mutual_information(S, m), expected, tolerance);
    EXPECT_NEAR(mutual_information(symmetric_inverse(S), m), expected, 1e2 * tolerance);
    // The chain rule: H(a, b) = H(a|b) + H(b); and I(a; b) = H(a) − H(a|b).
    EXPECT_NEAR(conditional_entropy(S, m) + entropy(S.bottomRightCorner(n, n)), entropy(S),
                tolerance);
    EXPECT_NEAR(entropy(S.topLeftCorner(m, m)) - conditional_entropy(S, m), expected, tolerance);
    // Which of the two comes first makes no difference.
    MatrixXd turned(m + n, m + n);
    turned << S.bottomRightCorner(n, n), S.bottomLeftCorner(n, m), S.topRightCorner(m, n),
        S.topLeftCorner(m, m);
    EXPECT_NEAR(mutual_information(turned, n), expected, tolerance);
    EXPECT_GT(expected, 0.001);
  }
}

TEST_F(GaussianMeasures, MutualInformationWithNothingIsNothing) {
  const MatrixXd S = definite(4);
  EXPECT_EQ(mutual_information(S, 0), 0.0);
  EXPECT_EQ(mutual_information(S, 4), 0.0);
  EXPECT_EQ(mutual_information(MatrixXd(0, 0), 0), 0.0);
}

TEST_F(GaussianMeasures, TheDivergenceOfNothingIsZero) {
  const Gaussian nothing{VectorXd(0), MatrixXd(0, 0)};
  EXPECT_EQ(kullback_leibler(nothing, nothing).total(), 0.0);
  EXPECT_EQ(entropy(MatrixXd(0, 0)), 0.0);
}

TEST_F(GaussianMeasures, WhatDeterminesTheOtherSharesInfinitely) {
  EXPECT_EQ(mutual_information(block(1.0, 1.0, 1.0), 1), kInfinity);
  EXPECT_EQ(mutual_information(block(1.0, 3.0, 9.0), 1), kInfinity);
  // Not positive semidefinite at all, by rounding.
  EXPECT_EQ(mutual_information(block(1.0, 1.0 + 1e-15, 1.0), 1), kInfinity);
  // b contains a coordinate of a; rounding leaves the last pivot on either side of zero.
  for (int trial = 0; trial < 50; ++trial) {
    MatrixXd S(6, 6);
    const MatrixXd A = definite(5);
    S.topLeftCorner(5, 5) = A;
    S.bottomLeftCorner(1, 5) = A.topRows(1);
    S.topRightCorner(5, 1) = A.leftCols(1);
    S(5, 5) = A(0, 0);
    // Up to the condition of the blocks, beyond 15 nats rounding leaves nothing to distinguish.
    EXPECT_GT(mutual_information(S, 3), 14.0);
  }
}

// Each block in coordinates of its own.
TEST_F(GaussianMeasures, UnitsAndCoordinatesDoNotMatterToSharedInformation) {
  const MatrixXd S = definite(7);
  MatrixXd T = MatrixXd::Zero(7, 7);
  T.topLeftCorner(3, 3) = 1e4 * (any(3, 3) + 3.0 * MatrixXd::Identity(3, 3));
  T.bottomRightCorner(4, 4) = 1e-3 * (any(4, 4) + 3.0 * MatrixXd::Identity(4, 4));
  const double expected = mutual_information(S, 3);
  EXPECT_NEAR(mutual_information(T * S * T.transpose(), 3), expected, 1e-11 * (1.0 + expected));
  EXPECT_GT(std::abs(entropy(T * S * T.transpose()) - entropy(S)), 1.0);
}

TEST_F(GaussianMeasures, DivergenceIsItsFormula) {
  for (const int n : {1, 2, 3, 6, 25}) {
    const Gaussian p = gaussian(n), q = gaussian(n);
    const MatrixXd L = symmetric_inverse(q.covariance);
    const VectorXd d = q.mean - p.mean;
    const double covariance = 0.5 * ((L * p.covariance).trace() + log_determinant_of(q.covariance) -
                                     log_determinant_of(p.covariance) - n);
    const Divergence found = kullback_leibler(p, q);
    EXPECT_NEAR(found.covariance, covariance, 1e-10 * (1.0 + covariance));
    EXPECT_NEAR(found.mean, 0.5 * d.dot(L * d), 1e-10 * (1.0 + found.mean));
    EXPECT_DOUBLE_EQ(found.total(), found.covariance + found.mean);
    const InformationForm p_form{symmetric_inverse(p.covariance) * p.mean,
                                 symmetric_inverse(p.covariance)},
        q_form{L * q.mean, L};
    const Divergence of_forms = kullback_leibler(p_form, q_form);
    EXPECT_NEAR(of_forms.covariance, found.covariance, 1e-8 * (1.0 + found.covariance));
    EXPECT_NEAR(of_forms.mean, found.mean, 1e-8 * (1.0 + found.mean));
    const Divergence both = jeffreys(p, q), back = kullback_leibler(q, p);
    EXPECT_DOUBLE_EQ(both.total(), found.covariance + back.covariance + found.mean + back.mean);
    EXPECT_DOUBLE_EQ(jeffreys(q, p).total(), both.total());
    EXPECT_GT(std::abs(found.total() - back.total()), 1e-3) << "too symmetric a sample";
    EXPECT_EQ(kullback_leibler(p, p).total(), 0.0);
  }
}

TEST_F(GaussianMeasures, DivergenceOfWhatIsOnlyShiftedIsTheSquareOfTheShift) {
  const Gaussian p = scalar(1.0, 4.0), q = scalar(4.0, 4.0);
  EXPECT_EQ(kullback_leibler(p, q).covariance, 0.0);
  EXPECT_DOUBLE_EQ(kullback_leibler(p, q).total(), 9.0 / 8.0);
}

TEST_F(GaussianMeasures, CoordinatesDoNotMatterToDivergence) {
  const Gaussian p = gaussian(5), q = gaussian(5);
  const MatrixXd T = 1e3 * (any(5, 5) + 3.0 * MatrixXd::Identity(5, 5));
  const auto moved = [&](const Gaussian& x) {
    return Gaussian{T * x.mean + VectorXd::Constant(5, 7.0), T * x.covariance * T.transpose()};
  };
  const double expected = kullback_leibler(p, q).total();
  EXPECT_NEAR(kullback_leibler(moved(p), moved(q)).total(), expected, 1e-9 * (1.0 + expected));
}

// n/2 (x − ln(1 + x)) with x = 1e-7 is 1e-14 of the terms that the plain formula subtracts.
TEST_F(GaussianMeasures, SmallOnesKeepTheirDigits) {
  for (const double x : {1e-2, -1e-5, 1e-7}) {
    const MatrixXd S = definite(4);
    const Gaussian p{VectorXd::Zero(4), (1.0 + x) * S}, q{VectorXd::Zero(4), S};
    const double expected =
        2.0 * (0.5 * x * x - x * x * x / 3.0 + 0.25 * x * x * x * x - 0.2 * x * x * x * x * x);
    EXPECT_NEAR(kullback_leibler(p, q).total(), expected, 1e-6 * expected) << x;
  }
  for (const int n : {1, 3, 6, 9}) {
    const MatrixXd R = definite(n);
    EXPECT_NEAR(information_gain(1e-14 * R, R), 0.5e-14 * n, 1e-24 * n) << n;
  }
}

// Far apart, and in units that differ by many orders of magnitude.
TEST_F(GaussianMeasures, LargeOnesAreRight) {
  const double expected = 0.5 * (1e-24 - std::log(1e-24) - 1.0);
  EXPECT_NEAR(kullback_leibler(scalar(0.0, 1e-16), scalar(0.0, 1e8)).total(), expected, 1e-12);
  EXPECT_NEAR(kullback_leibler(scalar(0.0, 1e8), scalar(0.0, 1e-16)).total(),
              0.5 * (1e24 + std::log(1e-24) - 1.0), 1e10);
  for (const double v : {1e-14, 1e-9, 1e9}) {
    EXPECT_NEAR(kullback_leibler(scalar(0.0, v), scalar(0.0, 1.0)).total(),
                0.5 * (v - std::log(v) - 1.0), 1e-12 * (1.0 + v));
  }
  const MatrixXd R = definite(30);
  EXPECT_NEAR(information_gain(1e12 * R, R), 15.0 * std::log1p(1e12), 1e-9);
}

TEST_F(GaussianMeasures, InformationGainIsTheEntropyThatTheStateLoses) {
  for (const auto& [m, n] : {std::pair{1, 3}, {2, 6}, {3, 3}, {6, 12}, {8, 5}}) {
    const MatrixXd S = definite(n), R = definite(m), J = any(m, n);
    // The Kalman update.
    const MatrixXd K = S * J.transpose() * inverse_of(J * S * J.transpose() + R);
    const double expected = entropy(S) - entropy(S - K * J * S);
    EXPECT_NEAR(information_gain(J, S, R), expected, 1e-9 * (1.0 + expected));
    // It is what the state and its measurement share.
    MatrixXd joint(m + n, m + n);
    joint << J * S * J.transpose() + R, J * S, S * J.transpose(), S;
    EXPECT_NEAR(mutual_information(joint, m), expected, 1e-9 * (1.0 + expected));
    EXPECT_GT(expected, 0.01);
  }
}

TEST_F(GaussianMeasures, InformationGainIsNeverNegative) {
  for (const int n : {1, 3, 6, 8}) {
    const MatrixXd R = MatrixXd::Identity(n, n);
    EXPECT_EQ(information_gain(MatrixXd::Zero(n, n), R), 0.0);
    EXPECT_EQ(information_gain(-1e-18 * R, R), 0.0);
    EXPECT_EQ(information_gain(-0.001 * R, R), 0.0);
  }
}

TEST_F(GaussianMeasures, SaysWhatDoesNotFit) {
  const MatrixXd S = definite(3);
  expect_refusal([&] { return entropy(MatrixXd(2, 3)); }, ErrorCode::usage, "2 × 3");
  expect_refusal([&] { return mutual_information(S, 4); }, ErrorCode::usage, "4 of 3");
  expect_refusal([&] { return mutual_information(S, -1); }, ErrorCode::usage, "-1 of 3");
  expect_refusal([&] { return conditional_entropy(S, 4); }, ErrorCode::usage, "4 of 3");
  expect_refusal([&] { return information_gain(S, definite(2)); }, ErrorCode::usage, "3");
  expect_refusal([&] { return information_gain(any(2, 2), S, definite(2)); }, ErrorCode::usage,
                 "2 × 2");
  expect_refusal([&] { return kullback_leibler(gaussian(3), gaussian(2)).total(); },
                 ErrorCode::usage, "3 and 2");
  expect_refusal(
      [&] {
        return kullback_leibler(Gaussian{VectorXd::Zero(2), S}, gaussian(3)).total();
      },
      ErrorCode::usage, "means of 2 and 3");
}

TEST_F(GaussianMeasures, SaysWhichMatrixIsNotACovariance) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const MatrixXd good = definite(2), bad = block(1.0, 2.0, 1.0), odd = block(1.0, nan, 1.0);
  for (const MatrixXd& S : {bad, odd, MatrixXd(block(0.0, 0.0, 1.0))}) {
    expect_refusal([&] { return entropy(S); }, ErrorCode::numerical, "entropy: the covariance");
    expect_refusal([&] { return information_gain(good, S); }, ErrorCode::numerical,
                   "the noise covariance");
    expect_refusal([&] { return kullback_leibler(centred(good), centred(S)).total(); },
                   ErrorCode::numerical, "second covariance");
    expect_refusal([&] { return kullback_leibler(centred(S), centred(good)).total(); },
                   ErrorCode::numerical, "first covariance");
  }
  expect_refusal([&] { return mutual_information(block(0.0, 0.0, 1.0), 1); }, ErrorCode::numerical,
                 "marginal of the first block");
  expect_refusal([&] { return mutual_information(block(1.0, 0.0, 0.0), 1); }, ErrorCode::numerical,
                 "marginal of the second block");
  expect_refusal([&] { return mutual_information(odd, 1); }, ErrorCode::numerical, "not finite");
  expect_refusal([&] { return conditional_entropy(block(1.0, 1.0, 1.0), 1); }, ErrorCode::numerical,
                 "given the second");
  expect_refusal([&] { return information_gain(-2.0 * good, good); }, ErrorCode::numerical,
                 "sum of noise and prior");
  expect_refusal([&] { return information_gain(odd, good); }, ErrorCode::numerical, "not finite");
}

}  // namespace
}  // namespace cairn::test
