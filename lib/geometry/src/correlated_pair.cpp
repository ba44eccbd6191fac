// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/correlated_pair.hpp"

#include <algorithm>
#include <utility>

#include <Eigen/Core>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {

using Eigen::MatrixXd;
using Eigen::VectorXd;

CorrelatedPair::CorrelatedPair(std::shared_ptr<const FactorType> relative, std::array<int, 2> first,
                               std::array<int, 2> second)
    : relative_(std::move(relative)), between_{first, second} {
  if (relative_->arity() != 2 || relative_->variable_tags()[0] != relative_->variable_tags()[1])
    throw Error(ErrorCode::usage, "a correlated pair needs a factor on two variables of one type");
  std::array<bool, 3> used{};
  bool good = first[0] != first[1] && second[0] != second[1];
  for (const int end : {first[0], first[1], second[0], second[1]}) {
    good = good && end >= 0 && end < 3;
    if (good) used[static_cast<std::size_t>(end)] = true;
  }
  if (!good || !std::ranges::all_of(used, [](bool u) { return u; }))
    throw Error(ErrorCode::usage, "a correlated pair is on three variables");
  tags_.assign(3, relative_->variable_tags()[0]);
  const int m = relative_->residual_size();
  unit_ = pack(MatrixXd::Identity(m, m));
}

std::string CorrelatedPair::normalize(double* measurement) const {
  std::string problem = relative_->normalize(measurement);
  if (problem.empty()) problem = relative_->normalize(measurement + relative_->measurement_size());
  return problem;
}

void CorrelatedPair::evaluate(const double* const* x, const double* measurement,
                              const double* sqrt_information, double* residual,
                              double* const* jacobians) const {
  const int m = relative_->residual_size(), t = relative_->tangent_size(0);
  VectorXd r(2 * m);
  MatrixXd J = MatrixXd::Zero(2 * m, 3 * t);
  for (int k = 0; k < 2; ++k) {
    const auto& [a, b] = between_[static_cast<std::size_t>(k)];
    const double* const ends[] = {x[a], x[b]};
    MatrixXd Ja(m, t), Jb(m, t);
    double* const out[] = {Ja.data(), Jb.data()};
    relative_->evaluate(ends, measurement + k * relative_->measurement_size(), unit_.data(),
                        r.data() + k * m, jacobians ? out : nullptr);
    if (!jacobians) continue;
    J.block(k * m, a * t, m, t) = Ja;
    J.block(k * m, b * t, m, t) = Jb;
  }
  const MatrixXd both = unpack({sqrt_information, packed_size(2 * m)}, 2 * m);
  const auto U = both.triangularView<Eigen::Upper>();
  Eigen::Map<VectorXd>(residual, 2 * m) = U * r;
  for (int v = 0; jacobians && v < 3; ++v) {
    if (!jacobians[v]) continue;
    Eigen::Map<MatrixXd>(jacobians[v], 2 * m, t) = U * J.middleCols(v * t, t);
  }
}

bool CorrelatedPair::propagate(int target, const double* const* x, const double* measurement,
                               double* out) const {
  for (int k = 0; k < 2; ++k) {
    const auto& [a, b] = between_[static_cast<std::size_t>(k)];
    if (a != target && b != target) continue;
    const double* const ends[] = {x[a], x[b]};
    if (relative_->propagate(a == target ? 0 : 1, ends,
                             measurement + k * relative_->measurement_size(), out)) {
      return true;
    }
  }
  return false;
}

}  // namespace cairn
