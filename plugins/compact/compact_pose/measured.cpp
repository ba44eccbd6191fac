// SPDX-License-Identifier: BSD-3-Clause
#include "measured.hpp"

#include <fmt/core.h>

#include "cairn/graph/packed.hpp"
#include "cairn/information/gaussian.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"

namespace cairn::compact {
namespace {

constexpr double kNothing = 1e-12;  // of the largest eigenvalue

[[noreturn]] void refuse(const std::string& message) { throw Error(ErrorCode::input, message); }

bool is_on(const FactorType& kind, std::span<const VariableType* const> types) {
  const auto tags = kind.variable_tags();
  if (tags.size() != types.size()) return false;
  for (std::size_t k = 0; k < tags.size(); ++k) {
    if (tags[k] != types[k]->tag()) return false;
  }
  return true;
}

}  // namespace

Measured::Measured(const Factor& factor, std::span<const VariableType* const> types,
                   const std::string& name)
    : factor_(factor) {
  const FactorType& kind = *factor.type;
  if (!is_on(kind, types)) {
    std::string wanted;
    for (const VariableType* type : types)
      wanted += fmt::format("{}{}", wanted.empty() ? "" : " and ", type->tag());
    refuse(fmt::format("{} is not a measurement of {}", name, wanted));
  }
  for (const VariableType* type : types) tangents_.push_back(type->tangent_size());
  const int n = kind.residual_size();
  if (factor.measurement.size() != static_cast<std::size_t>(kind.measurement_size()) ||
      factor.information.size() != packed_size(n)) {
    refuse(fmt::format("{} has {} numbers and information of {}; expected {} and {}", name,
                       factor.measurement.size(), factor.information.size(),
                       kind.measurement_size(), packed_size(n)));
  }
  if (const std::string problem = kind.normalize(factor_.measurement.data()); !problem.empty())
    refuse(fmt::format("{}: {}", name, problem));
  root_.resize(packed_size(n));
  if (!square_root(factor.information, n, root_))
    refuse(fmt::format("the information of {} is not positive semidefinite", name));
}

Measured::Linear Measured::at(std::span<const double* const> states) const {
  const int n = factor_.type->residual_size();
  Linear linear{Eigen::VectorXd(n), {}};
  std::vector<double*> jacobians;
  for (const int tangent : tangents_) linear.J.emplace_back(n, tangent);
  for (Eigen::MatrixXd& J : linear.J) jacobians.push_back(J.data());
  factor_.type->evaluate(states.data(), factor_.measurement.data(), root_.data(),
                         linear.residual.data(), jacobians.data());
  return linear;
}

double Measured::squared_norm(std::span<const double* const> states) const {
  Eigen::VectorXd residual(factor_.type->residual_size());
  factor_.type->evaluate(states.data(), factor_.measurement.data(), root_.data(), residual.data(),
                         nullptr);
  return residual.squaredNorm();
}

MeasuredFit compare(const Eigen::VectorXd& e, const Eigen::MatrixXd& S, const Eigen::MatrixXd& J) {
  const Eigen::MatrixXd noise = Eigen::MatrixXd::Identity(e.size(), e.size());
  MeasuredFit result;
  if (!S.allFinite()) return result;  // of numbers near the largest: nothing is gained
  result.gain = information_gain(S, noise);
  result.innovation = e.dot(Eigen::LLT<Eigen::MatrixXd>(Eigen::MatrixXd(noise + S)).solve(e));
  result.dof = rank(J);
  return result;
}

int rank(const Eigen::MatrixXd& J) {
  const Eigen::VectorXd sizes = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(
                                    Eigen::MatrixXd(J * J.transpose()), Eigen::EigenvaluesOnly)
                                    .eigenvalues();
  return static_cast<int>((sizes.array() > kNothing * sizes.maxCoeff()).count());
}

}  // namespace cairn::compact
