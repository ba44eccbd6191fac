// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"

namespace cairn::test {

/// A graph as a format read it from a text called "file", and what it reported.
struct Reading {
  Graph graph;
  ReadReport report;

  /// State of the variable with that id. Fails the test if there is none.
  std::vector<double> state(Id id) const;
  std::vector<double> measurement(int factor) const;
  std::vector<double> information(int factor) const;
  /// Ids of the variables of a factor.
  std::vector<Id> ids(int factor) const;
  std::string factor_tag(int factor) const;
  std::string variable_tag(Id id) const;
};

/// One registry for all tests of a program, so that graphs can be compared by type.
Registry& registry();

Reading read(std::string_view format, std::string_view text, const ReadOptions& options = {});

/// The message with which a text is refused; "" if it is not. Anything thrown but `Error` (input)
/// fails the test.
std::string refusal(std::string_view format, std::string_view text,
                    const ReadOptions& options = {});

std::string write(std::string_view format, const Graph& graph);
/// The message with which writing is refused; "" if it is not.
std::string write_refusal(std::string_view format, const Graph& graph);

/// The format that is surest of a text, "" if none knows it.
std::string detected(std::string_view text);

/// Where two graphs differ, to the last bit: variables by index, their states, factors in order. ""
/// if nowhere.
std::string difference(const Graph& a, const Graph& b);

}  // namespace cairn::test
