// SPDX-License-Identifier: BSD-3-Clause
#include "covariance_form.hpp"

#include <algorithm>
#include <map>
#include <utility>

#include <fmt/core.h>
#include <Eigen/Cholesky>
#include <Eigen/QR>

#include "cairn/graph/disjoint_sets.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::linearized {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A column is dependent on those before it if it is shorter than this after projecting them out.
constexpr double kDependent = 1e-12;

}  // namespace

void CovarianceForm::check_size(std::int64_t size) const {
  if (size <= max_size_) return;
  throw Error(ErrorCode::usage,
              fmt::format("estimator ekf: a dense covariance of {} unknowns takes {} MB; allow it "
                          "with max_size={}, or use estimator eif",
                          size, 8 * size * size / 1'000'000, size));
}

void CovarianceForm::begin(std::span<const Id> variables, std::span<const int> sizes,
                           std::span<const Rows>) {
  offsets_.clear();
  waiting_.clear();
  sizes_.clear();
  pending_.clear();
  for (std::size_t k = 0; k < variables.size(); ++k) add_variable(variables[k], sizes[k]);
}

void CovarianceForm::add_variable(Id id, int size) {
  waiting_.push_back(id);
  sizes_.emplace(id, size);
}

void CovarianceForm::add(const Rows& rows) {
  if (std::ranges::any_of(rows.variables, [&](Id id) { return sizes_.contains(id); })) {
    pending_.push_back(rows);
    return;
  }
  Measurement z{{}, rows.J, rows.c};
  for (std::size_t k = 0; k < rows.variables.size(); ++k) {
    for (int c = 0; c < rows.sizes[k]; ++c)
      z.columns.push_back(offsets_.offset(rows.variables[k]) + c);
  }
  measure(z);
}

bool CovarianceForm::settle() {
  for (const Group& group : groups()) {
    if (!initialise(group)) continue;
    for (const Id id : group.variables) {
      sizes_.erase(id);
      std::erase(waiting_, id);
    }
  }
  std::erase_if(pending_, [&](const Rows& rows) {
    return std::ranges::none_of(rows.variables, [&](Id id) { return sizes_.contains(id); });
  });
  return waiting_.empty();
}

std::vector<CovarianceForm::Group> CovarianceForm::groups() const {
  std::map<Id, int> number;
  for (const Id id : waiting_) number.emplace(id, static_cast<int>(number.size()));
  DisjointSets sets(static_cast<int>(number.size()));
  for (const Rows& rows : pending_) {
    int first = -1;
    for (const Id id : rows.variables) {
      if (!sizes_.contains(id)) continue;
      const int k = number.at(id);
      if (first < 0) first = k;
      sets.join(first, k);
    }
  }
  std::map<int, std::size_t> place;
  std::vector<Group> result;
  const auto group_of = [&](Id id) -> Group& {
    const auto [at, is_new] = place.try_emplace(sets.find(number.at(id)), result.size());
    if (is_new) result.emplace_back();
    return result[at->second];
  };
  for (const Id id : waiting_) group_of(id).variables.push_back(id);
  for (const Rows& rows : pending_) {
    const auto id =
        std::ranges::find_if(rows.variables, [&](Id each) { return sizes_.contains(each); });
    group_of(*id).rows.push_back(&rows);
  }
  return result;
}

bool CovarianceForm::initialise(const Group& group) {
  std::unordered_map<Id, int> place;  // of a new variable's columns
  int n = 0, height = 0;
  for (const Id id : group.variables) {
    place.emplace(id, n);
    n += sizes_.at(id);
  }
  std::map<int, int> old;  // scalar unknowns that are there already, and their columns here
  for (const Rows* rows : group.rows) {
    height += static_cast<int>(rows->c.size());
    for (std::size_t k = 0; k < rows->variables.size(); ++k) {
      if (place.contains(rows->variables[k])) continue;
      for (int c = 0; c < rows->sizes[k]; ++c)
        old.emplace(offsets_.offset(rows->variables[k]) + c, 0);
    }
  }
  if (height < n) return false;
  int m = 0;
  for (auto& each : old) each.second = m++;

  // J_new, and beside it J_old and c.
  MatrixXd J = MatrixXd::Zero(height, n), right = MatrixXd::Zero(height, m + 1);
  int row = 0;
  for (const Rows* rows : group.rows) {
    const auto count = rows->c.size();
    int from = 0;
    for (std::size_t k = 0; k < rows->variables.size(); ++k) {
      const auto is_new = place.find(rows->variables[k]);
      for (int c = 0; c < rows->sizes[k]; ++c, ++from) {
        if (is_new != place.end()) {
          J.col(is_new->second + c).segment(row, count) += rows->J.col(from);
        } else {
          right.col(old.at(offsets_.offset(rows->variables[k]) + c)).segment(row, count) +=
              rows->J.col(from);
        }
      }
    }
    right.col(m).segment(row, count) = rows->c;
    row += static_cast<int>(count);
  }
  const VectorXd norms = J.colwise().norm().transpose();
  if (!(norms.minCoeff() > 0.0)) return false;
  Eigen::HouseholderQR<MatrixXd> qr(J * norms.cwiseInverse().asDiagonal());
  const MatrixXd R = qr.matrixQR().topRows(n).template triangularView<Eigen::Upper>();
  if (!(R.diagonal().cwiseAbs().minCoeff() > kDependent)) return false;
  right.applyOnTheLeft(qr.householderQ().transpose());
  // d_new = A d_old + b, with covariance B Bᵀ given d_old.
  const auto solve = [&](const MatrixXd& b) -> MatrixXd {
    return norms.cwiseInverse().asDiagonal() * R.triangularView<Eigen::Upper>().solve(b);
  };
  const MatrixXd Ab = -solve(right.topRows(n)), B = solve(MatrixXd::Identity(n, n));

  const int there = offsets_.size();
  reserve(there + n);
  MatrixXd P_old(there, m);  // columns of P
  VectorXd d_old(m);
  for (const auto& [scalar, column] : old) {
    P_old.col(column) = this->column(scalar);
    d_old[column] = d_[scalar];
  }
  const MatrixXd A = Ab.leftCols(m);
  d_.segment(there, n) = A * d_old + Ab.col(m);
  const MatrixXd cross = A * P_old.transpose();  // n × there
  P_.block(there, 0, n, there) = cross;
  MatrixXd P_oo(m, n);  // P_old,old Aᵀ
  for (const auto& [scalar, column] : old) P_oo.row(column) = cross.col(scalar).transpose();
  P_.block(there, there, n, n) = A * P_oo + B * B.transpose();
  for (const Id id : group.variables) offsets_.add(id, sizes_.at(id));

  // What is left measures the others.
  if (m > 0 && height > n) {
    Measurement rest{{}, right.bottomLeftCorner(height - n, m), right.col(m).tail(height - n)};
    for (const auto& each : old) rest.columns.push_back(each.first);
    measure(rest);
  }
  return true;
}

void CovarianceForm::measure(const Measurement& z) {
  const auto n = offsets_.size(), columns = static_cast<int>(z.columns.size());
  MatrixXd PJt = MatrixXd::Zero(n, z.c.size());
  VectorXd d(columns);
  for (int k = 0; k < columns; ++k) {
    PJt.noalias() += column(z.columns[k]) * z.J.col(k).transpose();
    d[k] = d_[z.columns[k]];
  }
  MatrixXd S = MatrixXd::Identity(z.c.size(), z.c.size());
  for (int k = 0; k < columns; ++k) S.noalias() += z.J.col(k) * PJt.row(z.columns[k]);
  const Eigen::LLT<MatrixXd> llt(S);
  d_.head(n) -= PJt * llt.solve(z.J * d + z.c);
  const MatrixXd W = llt.matrixL().solve(PJt.transpose());
  P_.topLeftCorner(n, n).selfadjointView<Eigen::Lower>().rankUpdate(W.transpose(), -1.0);
}

void CovarianceForm::reserve(int size) {
  if (size <= P_.rows()) return;
  const int room = std::max(size, std::min(3 * static_cast<int>(P_.rows()) / 2, max_size_));
  P_.conservativeResize(room, room);
  d_.conservativeResize(room);
}

VectorXd CovarianceForm::column(int scalar) const {
  const int n = offsets_.size();
  VectorXd result(n);
  result.head(scalar) = P_.row(scalar).head(scalar).transpose();
  result.tail(n - scalar) = P_.col(scalar).segment(scalar, n - scalar);
  return result;
}

void CovarianceForm::multiply_covariance(std::span<const double> g, std::span<double> x) {
  const Eigen::Map<const VectorXd> from(g.data(), size());
  Eigen::Map<VectorXd> to(x.data(), size());
  to.setZero();
  for (int k = 0; k < size(); ++k) {
    if (from[k] != 0.0) to += from[k] * column(k);
  }
}

}  // namespace cairn::linearized
