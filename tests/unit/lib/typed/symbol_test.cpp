// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/typed/symbol.hpp"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/graph/graph.hpp"
#include "cairn/typed/build.hpp"
#include "cairn/typed/measurements.hpp"
#include "cairn/typed/point.hpp"
#include "cairn/typed/pose2.hpp"
#include "cairn/update/graph_update.hpp"

namespace cairn {
namespace {

using symbols::L;
using symbols::X;
using ::testing::HasSubstr;

TEST(Symbols, AreLettersWithAnIndex) {
  EXPECT_EQ(as_symbol(symbol('x', 3)), (Symbol{'x', 3}));
  EXPECT_EQ(as_symbol(symbol('Z', (Id{1} << 45) - 1)), (Symbol{'Z', (Id{1} << 45) - 1}));
  EXPECT_EQ(X(3), symbol('x', 3));
  EXPECT_EQ(L(2), symbol('l', 2));
  static_assert(X(1) != L(1));
}

TEST(Symbols, FollowEachOtherAndAreExactAsDoubles) {
  EXPECT_EQ(X(8) + 1, X(9));
  for (const char letter : {'A', 'x', 'z'}) {
    const Id id = symbol(letter, (Id{1} << 45) - 1);
    EXPECT_EQ(static_cast<Id>(static_cast<double>(id)), id);
    EXPECT_LT(id, Id{1} << 53);
    EXPECT_GT(id, 0);
  }
}

TEST(Symbols, AreNotIdsOfFiles) {
  for (const Id id : {Id{0}, Id{7}, Id{-1}, Id{1} << 40, Id{1} << 60, INT64_MIN, INT64_MAX})
    EXPECT_EQ(as_symbol(id), std::nullopt) << id;
}

TEST(Symbols, PrintAsTheyAreRead) {
  EXPECT_EQ(id_text(X(12)), "x12");
  EXPECT_EQ(id_text(12), "12");
  EXPECT_EQ(id_text(-3), "-3");
  for (const Id id : {X(12), L(0), X((Id{1} << 45) - 1), Id{12}, Id{0}, Id{-3}})
    EXPECT_EQ(id_from_text(id_text(id)), id);
  for (const char* text :
       {"", "x", "-", "x-1", "12x", "x1.5", "xx1", " 1", "x35184372088832", "9223372036854775808"})
    EXPECT_EQ(id_from_text(text), std::nullopt) << text;
}

TEST(Symbols, AreWhatMessagesShow) {
  Graph graph;
  for (const Id id : {X(12), symbol('Z', (Id{1} << 45) - 1), Id{12}})
    graph.add(id, Point2(0.0, 0.0));
  for (int k = 0; k < graph.variable_count(); ++k)
    EXPECT_EQ(graph.describe_variable(k), "VERTEX_XY " + id_text(graph.id(k)));
}

/// The message of what `call` throws.
template <class Call>
std::string message(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return "";
}

TEST(Symbols, NameVariablesInMessagesOfGraphsAndUpdates) {
  Graph graph;
  graph.add(X(0), Pose2());
  graph.add(X(1), Pose2());
  const int between = graph.add(Between(X(0), X(1), Pose2()), Information::sigmas(1.0, 1.0, 1.0));
  EXPECT_EQ(graph.describe_factor(between), "EDGE_SE2 x0 x1");
  EXPECT_THAT(message([&] { graph.add(X(1), Pose2()); }),
              HasSubstr("VERTEX_SE2 x1: the id is already that of VERTEX_SE2 x1"));
  EXPECT_THAT(message([&] { graph.erase(L(4)); }), HasSubstr("there is no variable l4 to erase"));
  Factor seen = graph.factor(between);
  seen.variables = {X(0), X(7)};
  EXPECT_THAT(message([&] { graph.add(seen); }),
              HasSubstr("EDGE_SE2 x0 x7: there is no variable x7"));

  GraphUpdate update;
  update.variables.push_back({graph.type_of(0), X(2), {}, false});
  EXPECT_THAT(message([&] { check_update(graph, FactorIds(), update); }),
              HasSubstr("VERTEX_SE2 x2: has no state, and no factor"));
  update = {};
  update.removed_variables = {X(9)};
  EXPECT_THAT(message([&] { check_update(graph, FactorIds(), update); }),
              HasSubstr("there is no variable x9 to be removed"));
}

TEST(Symbols, RefuseOtherLettersAndIndices) {
  EXPECT_THROW(symbol('1', 3), Error);
  EXPECT_THROW(symbol('x', -1), Error);
  EXPECT_THROW(symbol('x', Id{1} << 45), Error);
}

}  // namespace
}  // namespace cairn
