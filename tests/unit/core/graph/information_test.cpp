// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/information.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>

#include <Eigen/LU>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using ::testing::DoubleEq;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::string refusal(const std::function<Information()>& make) {
  try {
    make();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input);
    return error.what();
  }
  return {};
}

TEST(Information, ComesFromStandardDeviations) {
  EXPECT_THAT(Information::sigmas(0.5, 0.25, 2).packed(), ElementsAre(4, 0, 0, 16, 0, 0.25));
  EXPECT_THAT(Information::isotropic(2, 0.1).packed(),
              ElementsAre(DoubleEq(100), 0, DoubleEq(100)));
  EXPECT_THAT(Information::unit(2).packed(), ElementsAre(1, 0, 1));
  EXPECT_THAT(Information::sigmas(0.5, kInfinity).packed(), ElementsAre(4, 0, 0));
  EXPECT_EQ(Information::unit(6).size(), 6);
}

TEST(Information, ComesFromMatrices) {
  Eigen::Matrix2d Omega;
  Omega << 4, 1, 1, 2;
  EXPECT_THAT(Information::matrix(Omega).packed(), ElementsAre(4, 1, 2));
  EXPECT_EQ(Information::matrix(Omega).matrix(), Omega);
  const Information back = Information::covariance(Omega.inverse());
  EXPECT_LT((back.matrix() - Omega).norm(), 1e-14);
  EXPECT_THAT(Information::packed({4, 1, 2}).packed(), ElementsAre(4, 1, 2));
}

TEST(Information, IsASpanOfItsUpperTriangle) {
  const Information information = Information::sigmas(1.0, 0.5);
  const std::span<const double> packed = information;
  EXPECT_THAT(packed, ElementsAre(1, 0, 4));
}

TEST(Information, MayLackDirections) {
  Eigen::Matrix2d line;
  line << 1, 1, 1, 1;
  EXPECT_THAT(Information::matrix(line).packed(), ElementsAre(1, 1, 1));
}

TEST(Information, SaysWhatIsWrongWithAMatrix) {
  Eigen::Matrix2d A;
  A << 1, 2, 3, 4;
  EXPECT_THAT(refusal([&] { return Information::matrix(A); }),
              HasSubstr("not symmetric: entry (0, 1) is 2, (1, 0) is 3"));
  A << 1, 2, 2, 1;
  EXPECT_THAT(refusal([&] { return Information::matrix(A); }),
              HasSubstr("not positive semidefinite: its smallest eigenvalue is -1"));
  A << 1, kNan, kNan, 1;
  EXPECT_THAT(refusal([&] { return Information::matrix(A); }),
              HasSubstr("not finite: entry (0, 1) is nan"));
  EXPECT_THAT(refusal([] { return Information::matrix(Eigen::MatrixXd::Identity(2, 3)); }),
              HasSubstr("the information matrix is 2 x 3; it must be square"));
  EXPECT_THAT(refusal([] { return Information::matrix(Eigen::MatrixXd(0, 0)); }),
              HasSubstr("is 0 x 0"));
}

TEST(Information, SaysWhatIsWrongWithACovariance) {
  EXPECT_THAT(refusal([] { return Information::covariance(Eigen::Matrix2d::Zero()); }),
              HasSubstr("the covariance matrix is not positive definite: its smallest eigenvalue"));
  EXPECT_THAT(refusal([] { return Information::covariance(Eigen::Matrix<double, 1, 1>(1e-320)); }),
              HasSubstr("no finite inverse"));
}

TEST(Information, SaysWhatIsWrongWithNumbers) {
  EXPECT_THAT(refusal([] { return Information::sigmas(0.1, -0.2); }),
              HasSubstr("standard deviation 2 of 2 is -0.2; it must be positive"));
  EXPECT_THAT(refusal([] { return Information::sigmas(0.1, 0.0); }), HasSubstr("is 0; it must"));
  EXPECT_THAT(refusal([] { return Information::sigmas(kNan); }), HasSubstr("is nan; it must"));
  EXPECT_THAT(refusal([] {
                return Information::packed({1, 0, 0, 1});
              }),
              HasSubstr("4 numbers are not an upper triangle"));
  EXPECT_THAT(refusal([] { return Information::packed({}); }), HasSubstr("0 numbers are not"));
  EXPECT_THAT(refusal([] {
                return Information::packed({1, kInfinity, 1});
              }),
              HasSubstr("number 2 of its upper triangle is inf"));
}

}  // namespace
}  // namespace cairn
