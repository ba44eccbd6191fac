// SPDX-License-Identifier: BSD-3-Clause
// Every kind of bad line, with the message that a user sees.

#include <gtest/gtest.h>

#include <ostream>

#include "formats/reading.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

struct BadLine {
  std::string name;
  std::string line;     ///< put after four good lines
  std::string message;  ///< the whole of it
};
void PrintTo(const BadLine& bad, std::ostream* out) { *out << bad.name; }

constexpr const char* kGood =
    "VERTEX_SE2 0 0 0 0\n"
    "VERTEX_SE2 1 1 0 0\n"
    "# a comment and a blank line count too\n"
    "\n";

class BadLineTest : public testing::TestWithParam<BadLine> {};

TEST_P(BadLineTest, IsRefusedWithFileLineFoundAndExpected) {
  EXPECT_EQ(
      refusal("g2o", std::string(kGood) + GetParam().line + "\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n"),
      "file:5: " + GetParam().message);
}

TEST_P(BadLineTest, IsRefusedWithWindowsLineEndsAndWithoutAnEnd) {
  std::string text = std::string(kGood) + GetParam().line;
  for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += 2)
    text.insert(at, "\r");
  EXPECT_EQ(refusal("g2o", text), "file:5: " + GetParam().message);
}

const std::string kEdgeExpected =
    "expected 11 fields (2 ids, 3 numbers of the measurement, 6 of the information)";
const std::string kIdExpected = "expected an id, an integer from 0 to 9223372036854775807";

INSTANTIATE_TEST_SUITE_P(
    G2o, BadLineTest,
    testing::Values(
        BadLine{"TooFewNumbers", "EDGE_SE2 0 1 1 0 0 1 0 0 1 0",
                "EDGE_SE2 with 10 fields; " + kEdgeExpected},
        BadLine{"TooManyNumbers", "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1 1",
                "EDGE_SE2 with 12 fields; " + kEdgeExpected},
        BadLine{"NoNumbers", "EDGE_SE2", "EDGE_SE2 with 0 fields; " + kEdgeExpected},
        BadLine{"VertexTooShort", "VERTEX_SE2 7 1 2",
                "VERTEX_SE2 with 3 fields; expected 4 fields (1 id, 3 numbers)"},
        BadLine{"NotANumber", "EDGE_SE2 0 1 1 zero 0 1 0 0 1 0 1",
                "field 4 of EDGE_SE2 is 'zero', which is not a number; expected a finite number"},
        BadLine{"NumberWithATail", "EDGE_SE2 0 1 1 0.5x 0 1 0 0 1 0 1",
                "field 4 of EDGE_SE2 is '0.5x', which is not a number; expected a finite number"},
        BadLine{"DecimalComma", "VERTEX_SE2 7 1,5 0 0",
                "field 2 of VERTEX_SE2 is '1,5', which is not a number; expected a finite number"},
        BadLine{"NaN", "VERTEX_SE2 7 1 nan 0",
                "field 3 of VERTEX_SE2 is 'nan'; expected a finite number"},
        BadLine{"MinusInfinity", "VERTEX_SE2 7 1 0 -inf",
                "field 4 of VERTEX_SE2 is '-inf'; expected a finite number"},
        BadLine{"OutOfRange", "EDGE_SE2 0 1 1 0 0 1e999 0 0 1 0 1",
                "field 6 of EDGE_SE2 is '1e999', which is out of the range of a double; expected a "
                "finite number"},
        BadLine{"NegativeId", "EDGE_SE2 0 -1 1 0 0 1 0 0 1 0 1",
                "field 2 of EDGE_SE2 is '-1'; " + kIdExpected},
        BadLine{"BrokenId", "EDGE_SE2 0 1.0 1 0 0 1 0 0 1 0 1",
                "field 2 of EDGE_SE2 is '1.0'; " + kIdExpected},
        BadLine{"HugeId", "VERTEX_SE2 9223372036854775808 1 0 0",
                "field 1 of VERTEX_SE2 is '9223372036854775808'; " + kIdExpected},
        BadLine{"DuplicateId", "VERTEX_SE2 1 5 5 5",
                "VERTEX_SE2 1: the id was already given in line 2; expected every id once"},
        BadLine{"DuplicateIdOfAnotherType", "VERTEX_XY 1 5 5",
                "VERTEX_XY 1: the id was already given in line 2; expected every id once"},
        BadLine{"EdgeToNowhere", "EDGE_SE2 0 9 1 0 0 1 0 0 1 0 1",
                "EDGE_SE2 0 9: there is no vertex 9 in this file; expected a line that gives it, "
                "or a file without any vertices (ReadOptions::skip_dangling leaves out what leads "
                "to vertices of another file)"},
        BadLine{"EdgeToItself", "EDGE_SE2 1 1 1 0 0 1 0 0 1 0 1",
                "EDGE_SE2 1 1 joins variable 1 to itself; expected different ids"},
        BadLine{"EdgeToAnotherType", "EDGE_SE2_XY 0 1 1 0 1 0 1",
                "EDGE_SE2_XY 0 1: 1 is a VERTEX_SE2 by line 2; expected a VERTEX_XY"},
        BadLine{"Indefinite", "EDGE_SE2 0 1 1 0 0 1 2 0 1 0 1",
                "the information of EDGE_SE2 0 1 is not positive semidefinite (pivot 2 of its "
                "Cholesky factor is -3); expected a positive semidefinite 3x3 matrix"},
        BadLine{"NegativeInformation", "EDGE_SE2 0 1 1 0 0 -4 0 0 1 0 1",
                "the information of EDGE_SE2 0 1 is not positive semidefinite (entry (1, 1) is "
                "-4); expected a positive semidefinite 3x3 matrix"},
        BadLine{"NegativeBesideZero", "EDGE_SE2 0 1 1 0 0 0.0000 0 0 -0.0000001 0 100",
                "the information of EDGE_SE2 0 1 is not positive semidefinite (entry (2, 2) is "
                "-1e-07); expected a positive semidefinite 3x3 matrix"},
        BadLine{"ZeroBesideOthers", "EDGE_SE2 0 1 1 0 0 0 3 0 22 0 0",
                "the information of EDGE_SE2 0 1 is not positive semidefinite (entry (1, 1) is 0, "
                "and (1, 2) is 3); expected a positive semidefinite 3x3 matrix"},
        BadLine{"IndefiniteBesideZero", "EDGE_SE2 0 1 1 0 0 0 0 0 1 2 1",
                "the information of EDGE_SE2 0 1 is not positive semidefinite (pivot 3 of its "
                "Cholesky factor is -3); expected a positive semidefinite 3x3 matrix"},
        BadLine{"NoInformation", "EDGE_SE2 0 1 1 0 0",
                "EDGE_SE2 0 1 without information; expected 6 numbers more "
                "(ReadOptions::unit_information takes it as the identity)"},
        BadLine{"FixNothing", "FIX", "FIX without an id; expected one or more ids"},
        BadLine{
            "FixNobody", "FIX 0 9",
            "FIX 9: there is no vertex 9 in this file; expected a line that gives it, or a file "
            "without any vertices (ReadOptions::skip_dangling leaves out what leads to "
            "vertices of another file)"},
        BadLine{"FixNoId", "FIX 0 x", "field 2 of FIX is 'x'; " + kIdExpected},
        BadLine{"Binary", std::string("VERTEX_SE2 7 1 \x01\xff\0 0", 20),
                "field 3 of VERTEX_SE2 is '\\x01\\xff\\x00', which is not a number; expected a "
                "finite number"},
        BadLine{"CarriageReturnInside", "VERTEX_SE2 7 1 0 0\rVERTEX_SE2 8 1 0 0",
                "VERTEX_SE2 with 8 fields; expected 4 fields (1 id, 3 numbers)"},
        BadLine{"ZeroQuaternion", "VERTEX_SE3:QUAT 7 1 2 3 0 0 0 0",
                "VERTEX_SE3:QUAT 7: the quaternion is zero"},
        BadLine{"ZeroOffset", "PARAMS_SE3OFFSET 0 1 2 3 0 0 0 0",
                "PARAMS_SE3OFFSET 0: the quaternion is zero; expected a rotation"}),
    [](const auto& test) { return test.param.name; });

TEST(BadLines, LongFieldsAreCutShort) {
  CAIRN_NEEDS("types", "slam2d");
  const std::string message =
      refusal("g2o", "VERTEX_SE2 0 0 0 " + std::string(100000, '7') + "z\n");
  EXPECT_LT(message.size(), 200u);
}

TEST(BadLines, AZeroQuaternionInAMeasurementIsNamedByLine) {
  EXPECT_EQ(
      refusal("g2o", "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 0 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n"),
      "file:1: EDGE_SE3:QUAT 0 1: the quaternion is zero");
}

TEST(BadLines, NumbersTooSmallForADoubleAreTheNearest) {
  EXPECT_EQ(read("g2o", "VERTEX_SE2 0 1e-999 0 0\n").state(0)[0], 0.0);
}

}  // namespace
}  // namespace cairn::test
