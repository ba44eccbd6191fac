// SPDX-License-Identifier: BSD-3-Clause
#include "change.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string_view>

namespace cairn::scales {
namespace {

/// Where a type has lengths, as [begin, begin + count).
struct VariableLengths {
  std::string_view tag;
  Lengths state, tangent;
};
constexpr VariableLengths kVariables[] = {{"VERTEX_SE2", {0, 2}, {0, 2}},
                                          {"VERTEX_XY", {0, 2}, {0, 2}},
                                          {"VERTEX_SE3:QUAT", {0, 3}, {0, 3}},
                                          {"VERTEX_TRACKXYZ", {0, 3}, {0, 3}},
                                          {"VERTEX_CAMERA_BAL", {3, 3}, {3, 3}}};

struct FactorLengths {
  std::string_view tag;
  Lengths measurement, residual;
  bool absolute;  ///< measures a position in the world
};
constexpr FactorLengths kFactors[] = {{"EDGE_SE2", {0, 2}, {0, 2}, false},
                                      {"EDGE_SE2_XY", {0, 2}, {0, 2}, false},
                                      {"EDGE_BEARING_RANGE_SE2_XY", {1, 1}, {1, 1}, false},
                                      {"EDGE_PRIOR_SE2", {0, 2}, {0, 2}, true},
                                      {"EDGE_PRIOR_XY", {0, 2}, {0, 2}, true},
                                      {"EDGE_SE3:QUAT", {0, 3}, {0, 3}, false},
                                      {"EDGE_SE3_TRACKXYZ", {0, 3}, {0, 3}, false},
                                      {"EDGE_PRIOR_SE3:QUAT", {0, 3}, {0, 3}, true},
                                      {"EDGE_PRIOR_TRACKXYZ", {0, 3}, {0, 3}, true},
                                      {"EDGE_PRIOR_SE2_XY", {0, 2}, {0, 2}, true},
                                      {"EDGE_SE3_PRIORXYZ", {0, 3}, {0, 3}, true},
                                      {"EDGE_SE3_PRIORQUAT", {0, 0}, {0, 0}, false},
                                      {"EDGE_SE3_PRIORVEC", {0, 0}, {0, 0}, false},
                                      {"EDGE_PROJECT_BAL", {0, 0}, {0, 0}, false}};

template <class Table>
const auto& row_of(const Table& table, std::string_view tag) {
  const auto row = std::ranges::find_if(table, [&](const auto& each) { return each.tag == tag; });
  if (row == std::end(table))
    throw std::invalid_argument("where are the lengths of a " + std::string(tag) + "?");
  return *row;
}

bool within(Lengths lengths, int k) {
  return k >= lengths.begin && k < lengths.begin + lengths.count;
}

std::vector<double> changed_state(const Change& change, const Graph& graph, int variable) {
  const Lengths at = row_of(kVariables, graph.type(variable).tag()).state;
  std::vector<double> x(graph.state(variable).begin(), graph.state(variable).end());
  for (int k = 0; k < at.count; ++k)
    x[at.begin + k] = x[at.begin + k] * change.length + change.offset[k];
  return x;
}

void change_factor(const Change& change, Graph& graph, int factor) {
  const FactorLengths& type = row_of(kFactors, graph.factor_type(factor).tag());
  std::vector<double> z(graph.measurement(factor).begin(), graph.measurement(factor).end());
  for (int k = 0; k < type.measurement.count; ++k) {
    double& number = z[type.measurement.begin + k];
    number = number * change.length + (type.absolute ? change.offset[k] : 0.0);
  }
  std::vector<double> information(graph.information(factor).begin(),
                                  graph.information(factor).end());
  auto entry = information.begin();
  for (int row = 0; row < graph.factor_type(factor).residual_size(); ++row) {
    for (int column = row; column < graph.factor_type(factor).residual_size(); ++column) {
      const int lengths = within(type.residual, row) + within(type.residual, column);
      *entry++ *= change.information / std::pow(change.length, lengths);
    }
  }
  graph.set_measurement(factor, z, information);
}

}  // namespace

double Change::largest_offset() const {
  double largest = 0.0;
  for (const double number : offset) largest = std::max(largest, std::abs(number));
  return largest;
}

std::vector<Change> all_changes() {
  return {{"information 1e-30", 1e-30},
          {"information 1e-20", 1e-20},
          {"information 1e-10", 1e-10},
          {"information 1e-5", 1e-5},
          {"as it is"},
          {"information 1e5", 1e5},
          {"information 1e10", 1e10},
          {"information 1e20", 1e20},
          {"information 1e30", 1e30},
          {"information 1e60", 1e60},
          {"lengths in nm", 1.0, 1e9},
          {"lengths in mm", 1.0, 1e3},
          {"lengths in km", 1.0, 1e-3},
          {"lengths in Gm", 1.0, 1e-9},
          {"UTM: 4e5 5e6 100 m", 1.0, 1.0, {4e5, 5e6, 100.0}},
          {"offset 1e9 m", 1.0, 1.0, {1e9, -1e9, 1e9}}};
}

std::vector<Change> few_changes() {
  std::vector<Change> few;
  for (Change& change : all_changes()) {
    const bool chosen = change.information == 1e-30 || change.information == 1e60 ||
                        change.length == 1e9 || change.offset[0] == 4e5;
    if (chosen) few.push_back(std::move(change));
  }
  return few;
}

void apply(const Change& change, Graph& graph) {
  for (int v = 0; v < graph.variable_count(); ++v)
    graph.set_state(v, changed_state(change, graph, v));
  for (int f = 0; f < graph.factor_count(); ++f) change_factor(change, graph, f);
}

std::vector<double> undone(const Change& change, const Graph& graph, int variable) {
  const Lengths at = row_of(kVariables, graph.type(variable).tag()).state;
  std::vector<double> x(graph.state(variable).begin(), graph.state(variable).end());
  for (int k = 0; k < at.count; ++k)
    x[at.begin + k] = (x[at.begin + k] - change.offset[k]) / change.length;
  return x;
}

Lengths lengths_of_tangent(const VariableType& type) {
  return row_of(kVariables, type.tag()).tangent;
}

double rounding_of_chi2(const Change& change, const Graph& graph) {
  const double unit = change.largest_offset() * std::numeric_limits<double>::epsilon();
  if (unit == 0.0) return 0.0;
  const std::vector<double> norms = squared_norms(graph);
  double squares = 0.0;
  for (int f = 0; f < graph.factor_count(); ++f) {
    double weight = 0.0;
    for (const double u : graph.sqrt_information(f)) weight += u * u;
    const double moved = 2.0 * unit * std::sqrt(weight);  // two ends, half a unit each axis
    const double chi2 = moved * (2.0 * std::sqrt(norms[f]) + moved);
    squares += chi2 * chi2;
  }
  return std::sqrt(squares);
}

}  // namespace cairn::scales
