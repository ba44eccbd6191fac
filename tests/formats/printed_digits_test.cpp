// SPDX-License-Identifier: BSD-3-Clause
// Information of less than full rank, as files have it: with as many digits as a program prints.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include "cairn/graph/packed.hpp"
#include "formats/reading.hpp"

namespace cairn::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

double uniform(std::mt19937_64& engine) {
  return static_cast<double>(engine() >> 11) * 0x1p-52 - 1.0;
}

/// n × n of a rank, with axes of very different units.
Eigen::MatrixXd semidefinite(int n, int rank, std::mt19937_64& engine) {
  Eigen::MatrixXd root(rank, n);
  for (int column = 0; column < n; ++column) {
    const double unit = std::pow(10.0, 2.0 * uniform(engine) + 1.0);
    for (int row = 0; row < rank; ++row) root(row, column) = unit * uniform(engine);
  }
  return root.transpose() * root;
}

std::string printed(const Eigen::MatrixXd& A, const std::string& format) {
  std::string text;
  for (int row = 0; row < A.rows(); ++row) {
    for (int column = row; column < A.cols(); ++column) {
      char buffer[400];
      std::snprintf(buffer, sizeof buffer, format.c_str(), A(row, column));
      text += std::string(" ") + buffer;
    }
  }
  return text + "\n";
}

struct Kind {
  int size;
  std::string vertices, edge;
};
const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = {
      {2, "VERTEX_SE2 0 0 0 0\nVERTEX_XY 1 1 0\n", "EDGE_SE2_XY 0 1 1 0"},
      {3, "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n", "EDGE_SE2 0 1 1 0 0"},
      {6, "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 1 0 0 0 0 0 1\n",
       "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1"}};
  return all;
}

TEST(PrintedDigits, InformationOfAnyRankIsReadHoweverItIsPrinted) {
  std::mt19937_64 engine(1);
  int settled = 0, all = 0;
  for (const char* format : {"%.4g", "%.6g", "%.9g", "%.12g", "%.15g", "%.17g", "%.5e", "%.8e",
                             "%.3f", "%.6f", "%.9f"}) {
    for (const Kind& kind : kinds()) {
      for (int rank = 1; rank < kind.size; ++rank) {
        for (int k = 0; k < 20; ++k, ++all) {
          const Eigen::MatrixXd A = semidefinite(kind.size, rank, engine);
          const std::string text = kind.vertices + kind.edge + printed(A, format);
          ASSERT_EQ(refusal("g2o", text), "") << format << " " << kind.edge << " rank " << rank;
          const Reading r = read("g2o", text);
          if (r.graph.factor_count() == 0) continue;  // printed as zeros
          settled += !r.report.notes.empty();
          const Eigen::MatrixXd kept = unpack(r.information(0), kind.size);
          const double digits = std::string(format).back() == 'f'
                                    ? 6.0 * std::pow(10.0, -(format[2] - '0'))
                                    : 1e-3 * A.norm();
          EXPECT_LT((kept - A).norm(), digits) << format << "\n" << text;
        }
      }
    }
  }
  // About half of them have an eigenvalue that printing made negative.
  EXPECT_GT(settled, all / 5);
}

TEST(PrintedDigits, TheNearestSemidefiniteMatrixIsTakenCountedAndNoted) {
  const std::string corridor = " 307121 -243387 -342143 192879 271141 1.6817e+07\n";
  const Reading r = read("g2o", "EDGE_SE2 0 1 1 0 0" + corridor + "EDGE_SE2 1 2 1 0 0" + corridor);
  EXPECT_THAT(r.report.notes[0], HasSubstr("the file has no vertices"));
  EXPECT_EQ(r.report.notes[1],
            "2 factors had information that was not positive semidefinite by less than rounding "
            "changes its numbers; it was set to the nearest semidefinite matrix: the first is "
            "EDGE_SE2 0 1 in line 1");
  const Eigen::Matrix3d A = unpack<3>(r.information(0).data());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(A);
  EXPECT_NEAR(eigen.eigenvalues()(0) / eigen.eigenvalues()(2), 0.0, 1e-15);
  const double expected[] = {307121, -243387, -342143, 192879, 271141, 1.6817e7};
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(r.information(0)[k], expected[k], 0.5) << k;
  EXPECT_EQ(r.graph.information_rank(0), 2);
}

TEST(PrintedDigits, InformationInWholeNumbersIsOffByAHalf) {
  std::mt19937_64 engine(5);
  int settled = 0;
  for (const Kind& kind : kinds()) {
    for (int k = 0; k < 100; ++k) {
      Eigen::MatrixXd A = semidefinite(kind.size, kind.size - 1, engine);
      A *= 1.23456e7 / A.cwiseAbs().maxCoeff();
      const std::string text = kind.vertices + kind.edge + printed(A, "%.0f");
      ASSERT_EQ(refusal("g2o", text), "");
      const Reading r = read("g2o", text);
      settled += !r.report.notes.empty();
      EXPECT_LT((unpack(r.information(0), kind.size) - A).norm(), 6.0) << text;
    }
  }
  EXPECT_GT(settled, 100);
}

/// Front ends keep matrices in single precision, and print them with digits enough for doubles.
TEST(PrintedDigits, InformationOfFloatsIsReadWithEveryDigitOfADouble) {
  std::mt19937_64 engine(4);
  int settled = 0;
  for (const char* format : {"%.8g", "%.9g", "%.10g", "%.12g", "%.17g", "%.20f", "%.8e"}) {
    for (const Kind& kind : kinds()) {
      for (int k = 0; k < 40; ++k) {
        const Eigen::MatrixXd A =
            semidefinite(kind.size, kind.size - 1, engine).cast<float>().cast<double>();
        const std::string text = kind.vertices + kind.edge + printed(A, format);
        ASSERT_EQ(refusal("g2o", text), "") << format;
        const Reading r = read("g2o", text);
        settled += !r.report.notes.empty();
        EXPECT_LT((unpack(r.information(0), kind.size) - A).norm(), 1e-5 * A.norm()) << text;
      }
    }
  }
  EXPECT_GT(settled, 200);
}

TEST(PrintedDigits, ToroHasThemInItsOwnOrder) {
  std::mt19937_64 engine(2);
  for (int k = 0; k < 100; ++k) {
    const Eigen::MatrixXd A = semidefinite(3, 2, engine);
    char line[400];
    std::snprintf(line, sizeof line, "EDGE2 0 1 1 0 0 %.6g %.6g %.6g %.6g %.6g %.6g\n", A(0, 0),
                  A(0, 1), A(1, 1), A(2, 2), A(0, 2), A(1, 2));
    const std::string text = std::string("VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0\n") + line;
    ASSERT_EQ(refusal("toro", text), "") << line;
    EXPECT_LT((unpack<3>(read("toro", text).information(0).data()) - A).norm(), 1e-4 * A.norm());
  }
}

TEST(PrintedDigits, WhatIsReallyIndefiniteStaysRefused) {
  const std::string vertices = kinds()[1].vertices, edge = "EDGE_SE2 0 1 1 0 0 ";
  for (const char* information : {
           "100 0 0 -1 0 100",                                          // −1 beside 100
           "100 0 0 100 0 -1",                                          //
           "100 0 0 100 0 -0.001",                                      //
           "100 0 0 -1 0 1e+08",                                        // beside another unit
           "100 0 0 -1e-06 0 1e+08",                                    //
           "100.000000 0.000000 0.000000 -1.000000 0.000000 0.000000",  // and a printed zero
           "1 2 0 1 0 1",                                               // eigenvalue −1
           "1 1.01 0 1 0 1",                                            // −0.01
           "100 100 0 99 0 100",                                        // −0.5
           "100.5 100.5 0 100.25 0 100",                                //
           "0 1 0 5 0 1",                                               // beside an exact zero
           "307121 -243387 -342143 192800 271141 1.6817e+07",  // −40, where digits are below one
           "1 0.999 0.999 1 -0.999 1",       // each pair is possible, the three are not
           "12345 0 0 -1 0 12345",           // whole numbers, by more than a half
           "1 1 0 0.99999898672103882 0 1",  // floats, by more than their rounding
           "1 1 0 0.99999995000000 0 1",     // by the rounding of floats, which they are not
           "1 1 0 0.99998998641967773 0 1",  // floats, by more than their rounding
           "1 1 0 0.99999995000000 0 1",     // by the rounding of floats, which they are not
       }) {
    EXPECT_THAT(refusal("g2o", vertices + edge + information + "\n"),
                HasSubstr("is not positive semidefinite"))
        << information;
  }
}

TEST(PrintedDigits, WhatIsPositiveDefiniteKeepsEveryBit) {
  const Reading r = read("g2o", "EDGE_SE2 0 1 1 0 0 1 0.999999 0 1 0 1e-300\n");
  EXPECT_THAT(r.information(0), ElementsAre(1, 0.999999, 0, 1, 0, 1e-300));
  const Reading full = read("g2o", kinds()[1].vertices + "EDGE_SE2 0 1 1 0 0 4 0 0 0 0 0\n");
  EXPECT_THAT(full.information(0), ElementsAre(4, 0, 0, 0, 0, 0));
  EXPECT_THAT(full.report.notes, IsEmpty()) << "semidefinite as it stands";
}

}  // namespace
}  // namespace cairn::test
