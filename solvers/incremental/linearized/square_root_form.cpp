// SPDX-License-Identifier: BSD-3-Clause
#include "square_root_form.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>
#include <utility>

#include "block/ordering.hpp"
#include "cairn/linear/block_matrix.hpp"

namespace cairn::linearized {
namespace {

/// A column is dependent on those before it if it is shorter than this after projecting them out.
constexpr double kDependent = 1e-13;

}  // namespace

void SquareRootForm::begin(std::span<const Id> variables, std::span<const int> sizes,
                           std::span<const Rows> rows) {
  offsets_.clear();
  R_.clear();
  squared_norms_.clear();
  d_.clear();
  std::unordered_map<Id, std::int32_t> block;
  for (std::size_t k = 0; k < variables.size(); ++k)
    block.emplace(variables[k], static_cast<std::int32_t>(k));
  std::vector<std::pair<std::int32_t, std::int32_t>> entries;
  for (const Rows& each : rows) {
    for (std::size_t a = 0; a < each.variables.size(); ++a) {
      for (std::size_t b = 0; b < a; ++b)
        entries.emplace_back(block.at(each.variables[a]), block.at(each.variables[b]));
    }
  }
  if (variables.empty()) return;
  const BlockStructure structure({sizes.begin(), sizes.end()}, std::move(entries));
  for (const std::int32_t next : block::order(structure, "amd"))
    add_variable(variables[static_cast<std::size_t>(next)], sizes[static_cast<std::size_t>(next)]);
}

void SquareRootForm::add_variable(Id id, int size) {
  offsets_.add(id, size);
  const auto n = static_cast<std::size_t>(offsets_.size());
  R_.resize(n);
  squared_norms_.resize(n, 0.0);
  d_.resize(n, 0.0);
}

void SquareRootForm::add(const Rows& rows) {
  std::vector<std::pair<int, int>> columns;  // here, and in J
  int from = 0;
  for (std::size_t k = 0; k < rows.variables.size(); ++k) {
    for (int c = 0; c < rows.sizes[k]; ++c, ++from)
      columns.emplace_back(offsets_.offset(rows.variables[k]) + c, from);
  }
  std::ranges::sort(columns);
  for (Eigen::Index r = 0; r < rows.c.size(); ++r) {
    SparseRow row;
    row.b = -rows.c[r];
    for (const auto& [column, place] : columns) {
      const double value = rows.J(r, place);
      if (value == 0.0) continue;
      squared_norms_[static_cast<std::size_t>(column)] += value * value;
      row.columns.push_back(column);
      row.values.push_back(value);
    }
    rotate_in(std::move(row));
  }
}

void SquareRootForm::rotate_in(SparseRow row) {
  while (!row.columns.empty()) {
    SparseRow& mine = R_[static_cast<std::size_t>(row.columns.front())];
    if (mine.columns.empty()) {
      mine = std::move(row);
      return;
    }
    const double length = std::hypot(mine.values.front(), row.values.front());
    const double c = mine.values.front() / length, s = row.values.front() / length;
    left_.columns.assign(1, row.columns.front());
    left_.values.assign(1, length);
    right_.columns.clear();
    right_.values.clear();
    std::size_t a = 1, b = 1;
    constexpr int kEnd = std::numeric_limits<int>::max();
    while (true) {
      const int of_a = a < mine.columns.size() ? mine.columns[a] : kEnd;
      const int of_b = b < row.columns.size() ? row.columns[b] : kEnd;
      const int column = std::min(of_a, of_b);
      if (column == kEnd) break;
      const double x = of_a == column ? mine.values[a++] : 0.0;
      const double y = of_b == column ? row.values[b++] : 0.0;
      left_.columns.push_back(column);
      left_.values.push_back(c * x + s * y);
      right_.columns.push_back(column);
      right_.values.push_back(c * y - s * x);
    }
    left_.b = c * mine.b + s * row.b;
    right_.b = c * row.b - s * mine.b;
    std::swap(mine, left_);
    std::swap(row, right_);
    // Where a rotation leaves a zero in front, the next column is the first.
    std::size_t zeros = 0;
    while (zeros < row.values.size() && row.values[zeros] == 0.0) ++zeros;
    const auto count = static_cast<std::ptrdiff_t>(zeros);
    row.columns.erase(row.columns.begin(), row.columns.begin() + count);
    row.values.erase(row.values.begin(), row.values.begin() + count);
  }
}

bool SquareRootForm::settle() {
  for (std::size_t j = 0; j < R_.size(); ++j) {
    const double diagonal = R_[j].columns.empty() ? 0.0 : std::abs(R_[j].values.front());
    if (diagonal > kDependent * std::sqrt(squared_norms_[j])) continue;
    undetermined_ = offsets_.variable(static_cast<int>(j));
    return false;
  }
  return true;
}

void SquareRootForm::substitute_back(std::span<double> x) const {
  for (std::size_t j = R_.size(); j-- > 0;) {
    const SparseRow& row = R_[j];
    double sum = x[j];
    for (std::size_t k = 1; k < row.columns.size(); ++k)
      sum -= row.values[k] * x[static_cast<std::size_t>(row.columns[k])];
    x[j] = sum / row.values.front();
  }
}

std::span<const double> SquareRootForm::displacement() {
  for (std::size_t j = 0; j < R_.size(); ++j) d_[j] = R_[j].b;
  substitute_back(d_);
  return d_;
}

void SquareRootForm::multiply_covariance(std::span<const double> g, std::span<double> x) {
  std::ranges::copy(g, x.begin());
  for (std::size_t j = 0; j < R_.size(); ++j) {  // Rᵀ y = g
    const SparseRow& row = R_[j];
    x[j] /= row.values.front();
    if (x[j] == 0.0) continue;
    for (std::size_t k = 1; k < row.columns.size(); ++k)
      x[static_cast<std::size_t>(row.columns[k])] -= row.values[k] * x[j];
  }
  substitute_back(x);
}

std::int64_t SquareRootForm::memory() const {
  std::int64_t bytes = 0;
  for (const SparseRow& row : R_)
    bytes += static_cast<std::int64_t>(row.columns.size() * (sizeof(int) + sizeof(double)));
  return bytes;
}

}  // namespace cairn::linearized
