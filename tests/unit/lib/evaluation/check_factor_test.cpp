// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/check_factor.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/types/define_factor.hpp"

namespace cairn::test {
namespace {

/// A factor as the manual has a third party write it: one function, no Jacobian.
struct Range {
  static constexpr std::string_view kTag = "EDGE_RANGE_XY";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<Se2, PointXY>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 3>& a, const Vector<S, 2>& b,
                               const Vector<double, 1>& measured) {
    using std::sqrt;
    const S dx = b[0] - a[0], dy = b[1] - a[1];
    return Vector<S, 1>(sqrt(dx * dx + dy * dy) - measured[0]);
  }
};

struct RightRange : Range {
  static Vector<double, 1> evaluate(const Vector<double, 3>& a, const Vector<double, 2>& b,
                                    const Vector<double, 1>& z, Eigen::Matrix<double, 1, 3>& J_a,
                                    Eigen::Matrix<double, 1, 2>& J_b) {
    const Vector<double, 2> d = b - a.head<2>();
    J_b = d.transpose() / d.norm();
    J_a << -J_b * Se2::rotation(a), 0;
    return residual<double>(a, b, z);
  }
};
struct WrongSign : RightRange {
  static Vector<double, 1> evaluate(const Vector<double, 3>& a, const Vector<double, 2>& b,
                                    const Vector<double, 1>& z, Eigen::Matrix<double, 1, 3>& J_a,
                                    Eigen::Matrix<double, 1, 2>& J_b) {
    const auto r = RightRange::evaluate(a, b, z, J_a, J_b);
    J_b[1] = -J_b[1];
    return r;
  }
};
struct NotANumber : RightRange {
  static Vector<double, 1> evaluate(const Vector<double, 3>& a, const Vector<double, 2>& b,
                                    const Vector<double, 1>& z, Eigen::Matrix<double, 1, 3>& J_a,
                                    Eigen::Matrix<double, 1, 2>& J_b) {
    const auto r = RightRange::evaluate(a, b, z, J_a, J_b);
    J_a[2] = std::nan("");
    return r;
  }
};
struct OtherResidual : RightRange {
  static Vector<double, 1> evaluate(const Vector<double, 3>& a, const Vector<double, 2>& b,
                                    const Vector<double, 1>& z, Eigen::Matrix<double, 1, 3>& J_a,
                                    Eigen::Matrix<double, 1, 2>& J_b) {
    return RightRange::evaluate(a, b, z, J_a, J_b) + Vector<double, 1>(0.5);
  }
};

template <class F>
FactorCheck check() {
  const auto type = define_factor<F>();
  const auto pose = define_variable<Se2>();
  const auto point = define_variable<PointXY>();
  const VariableType* variables[] = {pose.get(), point.get()};
  const double a[] = {1.0, 2.0, 0.5}, b[] = {-1.5, 4.0}, z[] = {2.0};
  const double* x[] = {a, b};
  return check_factor(*type, variables, x, z);
}

TEST(CheckFactor, AcceptsAutomaticAndRightAnalyticJacobians) {
  EXPECT_LT(check<Range>().largest_deviation, 1e-9);
  EXPECT_LT(check<RightRange>().largest_deviation, 1e-9);
}

TEST(CheckFactor, PointsAtTheWrongEntry) {
  const FactorCheck found = check<WrongSign>();
  EXPECT_GT(found.largest_deviation, 0.1);
  EXPECT_EQ(found.variable, 1);
  EXPECT_EQ(found.row, 0);
  EXPECT_EQ(found.column, 1);
  EXPECT_NEAR(found.claimed, -found.numeric, 1e-8);
}

TEST(CheckFactor, FindsNaN) {
  const FactorCheck found = check<NotANumber>();
  EXPECT_TRUE(std::isnan(found.largest_deviation));
  EXPECT_EQ(found.column, 2);
}

TEST(CheckFactor, FindsAResidualThatDiffersWithItsJacobians) {
  const FactorCheck found = check<OtherResidual>();
  EXPECT_NEAR(found.largest_deviation, 0.5, 1e-9);
  EXPECT_EQ(found.column, -1);
}

}  // namespace
}  // namespace cairn::test
