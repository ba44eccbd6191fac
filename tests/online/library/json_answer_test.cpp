// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/json_answer.hpp"

#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include <boost/json/parse.hpp>
#include <boost/json/value.hpp>

namespace cairn {
namespace {

/// What one line of JSON, and nothing but one, contains.
boost::json::value parsed(const std::string& line) {
  EXPECT_EQ(line.find('\n'), line.size() - 1);
  return boost::json::parse(line);
}

bool is_variable_type(std::string_view tag) { return tag == "VERTEX_SE2" || tag == "VERTEX_XY"; }

std::string json_answer(std::string_view answer) {
  return cairn::json_answer(answer, is_variable_type);
}

/// As an answer, equal to this JSON.
void expect(const std::string& answer, const std::string& json) {
  EXPECT_EQ(parsed(json_answer(answer)), boost::json::parse(json)) << json_answer(answer);
}

TEST(JsonAnswer, HasWhatAnUpdateHas) {
  expect(
      "UPDATE 815\nNOTE no variable is fixed: anchored \"VERTEX_SE2 0\"\nREMOVED 17\nREMOVED 18\n"
      "FACTOR 5 1 3\nKLD 0.25\nVERTEX_SE2 412 3.8656 -0.668 1e-05\nVERTEX_XY 7 1 2\n"
      "COVARIANCE 412 7 1 2 0.5 -2\nOK 815 variables 412 factors 735 owed 3\n",
      R"({"update": 815, "notes": ["no variable is fixed: anchored \"VERTEX_SE2 0\""],
          "removed": [17, 18], "new_factors": [{"factor": 5, "ids": [1, 3]}], "kld": 0.25,
          "estimates": [{"type": "VERTEX_SE2", "id": 412, "state": [3.8656, -0.668, 1e-05]},
                        {"type": "VERTEX_XY", "id": 7, "state": [1, 2]}],
          "covariances": [{"ids": [412, 7], "rows": 1, "columns": 2, "values": [0.5, -2]}],
          "answer": "OK", "line": 815, "variables": 412, "factors": 735, "owed": 3})");
}

TEST(JsonAnswer, HasTheOtherAnswers) {
  expect("CHI2 12.5\nSINGULAR 4 variables 2 factors 1 owed 0\n",
         R"({"chi2": 12.5, "answer": "SINGULAR", "line": 4, "variables": 2, "factors": 1,
             "owed": 0})");
  expect("PRIOR 8\nOK 4 variables 2 factors 1 owed 0\n",
         R"({"priors": [8], "answer": "OK", "line": 4, "variables": 2, "factors": 1, "owed": 0})");
  expect("WRITER 812 variables 411 factors 733\n",
         R"({"answer": "WRITER", "line": 812, "variables": 411, "factors": 733})");
  expect(
      "ERROR line 16: EDGE_SE2 1 \"5\": there is\tno variable 1\n",
      R"({"answer": "ERROR", "line": 16, "message": "EDGE_SE2 1 \"5\": there is\tno variable 1"})");
  expect("NOTE 17 updates were dropped\n", R"({"notes": ["17 updates were dropped"]})");
}

TEST(JsonAnswer, HasTheResultsOfAPolicy) {
  expect(
      "LINKED 0 3 6.65 0.41\nPRIOR 3 TAKEN 1.5 inf\nDROPPED 3\nOK 11 variables 3 factors 3 owed "
      "0\n",
      R"({"results": [["LINKED", 0, 3, 6.65, 0.41], ["PRIOR", 3, "TAKEN", 1.5, null],
                         ["DROPPED", 3]],
             "answer": "OK", "line": 11, "variables": 3, "factors": 3, "owed": 0})");
  expect("MATCH NONE\nOK 10 variables 3 factors 3 owed 0\n",
         R"({"results": [["MATCH", "NONE"]], "answer": "OK", "line": 10, "variables": 3,
             "factors": 3, "owed": 0})");
}

/// A client keeps estimates by id: what is none must not take the place of one.
TEST(JsonAnswer, HasNoEstimateOfAWordThatIsNoType) {
  expect("LANDMARK 0 100 ADDED inf 0\nKEPT 0\nNONLINEAR 0 3 1 2\nVERTEX_OTHER 5 1 2\n",
         R"({"results": [["LANDMARK", 0, 100, "ADDED", null, 0], ["KEPT", 0],
                         ["NONLINEAR", 0, 3, 1, 2], ["VERTEX_OTHER", 5, 1, 2]]})");
}

TEST(JsonAnswer, EscapesWhatIsNoUtf8) {
  expect("ERROR line 3: \xd3\xfc\x8b is for the client that writes\n",
         R"({"answer": "ERROR", "line": 3,
             "message": "\\xd3\\xfc\\x8b is for the client that writes"})");
  // Longer forms than needed, a surrogate, beyond U+10FFFF, and cut off; but not what is right.
  expect("NOTE \xc0\xaf \xed\xa0\x80 \xf4\x90\x80\x80 \xe2\x82 \xe2\x82\xac \xf0\x9f\x97\xba\n",
         R"({"notes": ["\\xc0\\xaf \\xed\\xa0\\x80 \\xf4\\x90\\x80\\x80 \\xe2\\x82 €)"
         " \xf0\x9f\x97\xba\"]}");
}

TEST(JsonAnswer, KeepsTheDigitsAndIsJsonForAnyText) {
  EXPECT_NE(json_answer("CHI2 0.30000000000000004\n").find("\"chi2\":0.30000000000000004"),
            std::string::npos);
  EXPECT_EQ(json_answer(""), "");
  for (const char* text :
       {"\n", "NOTE", "ERROR", "ERROR line", "ERROR line 3:", "UPDATE", "FACTOR", "FACTOR 1",
        "COVARIANCE 1 2 3", "OK", "OK 3 variables", "REMOVED", "PRIOR", "CHI2 nan", "X",
        "0x10 0x10 +5 .5 5. - 007 1e 1e+ -0.5E-07 1.5.2 -inf", "a \x01\x7f\\ \"", "- - -"})
    EXPECT_TRUE(parsed(json_answer(text)).is_object()) << text << ": " << json_answer(text);
}

}  // namespace
}  // namespace cairn
