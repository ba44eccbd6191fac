// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/linear/normal_equations.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>
#include <Eigen/SparseCholesky>

#include "cairn/graph/free_directions.hpp"
#include "cairn/runtime/timed.hpp"
#include "dense/eigenvalues.hpp"

namespace cairn {
namespace {

/// Eigenvalues of the scaled H below this count as zero: rounding leaves a true zero at about 1e-16
/// times a small power of the size.
constexpr double kFreeEigenvalue = 1e-12;

Eigen::Map<const Eigen::MatrixXd> diagonal_block(const BlockMatrix& H, int block) {
  const BlockStructure& s = H.structure();
  return {H.block(s.column_begin()[block]), s.block_size(block), s.block_size(block)};
}

/// How many directions of a variable its own factors leave free, the other variables being held.
int free_directions_of_block(const BlockMatrix& H, int block) {
  const Eigen::MatrixXd D = diagonal_block(H, block);
  const Eigen::VectorXd eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(D, Eigen::EigenvaluesOnly).eigenvalues();
  const double threshold = std::max(eigenvalues.maxCoeff() * 1e-14, 1e-300);
  return static_cast<int>((eigenvalues.array() <= threshold).count());
}

/// The held variables of a component, described, if all of them are smaller than its largest
/// variable: a landmark that is held does not stop the poses from turning about it. Empty
/// otherwise.
std::string weak_hold(const Graph& graph, const Gauge& gauge, int component) {
  int largest = 0, largest_held = 0, first_held = -1;
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (gauge.component[v] != component) continue;
    const int size = graph.type(v).tangent_size();
    largest = std::max(largest, size);
    if (!gauge.held[v]) continue;
    largest_held = std::max(largest_held, size);
    if (first_held < 0) first_held = v;
  }
  if (first_held < 0 || largest_held >= largest) return {};
  return graph.describe_variable(first_held);
}

}  // namespace

NormalEquations::NormalEquations(const Graph& graph, LinearSolver& solver)
    : graph_(&graph),
      solver_(&solver),
      gauge_(resolve_gauge(graph)),
      linearizer_(graph, gauge_.held) {
  if (size() == 0) return;
  H_ = BlockMatrix(linearizer_.structure());
  g_.resize(size());
  diagonal_.resize(size());
  const Timed timed(seconds_.analyze);
  jacobian_solver_ = query<JacobianSolver>(solver);
  if (!jacobian_solver_) {
    solver.analyze(linearizer_.structure());
    return;
  }
  jacobian_.emplace(graph, linearizer_);
  J_ = JacobianMatrix(jacobian_->structure());
  jacobian_solver_->analyze(jacobian_->structure());
}

double NormalEquations::chi2(const Values& values) {
  const Timed timed(seconds_.update);
  return linearizer_.chi2(values);
}

double NormalEquations::linearize(const Values& values) {
  const Timed timed(seconds_.linearize);
  const double chi2 = linearizer_.linearize(values, H_, g_);
  H_.diagonal(diagonal_);
  if (jacobian_) jacobian_->evaluate(values, J_);
  return chi2;
}

void NormalEquations::retract(const Values& values, std::span<const double> step, Values& out) {
  const Timed timed(seconds_.update);
  linearizer_.retract(values, step, out);
}

Factorization NormalEquations::factorize() {
  const Timed timed(seconds_.factorize);
  damped_.clear();
  return jacobian_solver_ ? jacobian_solver_->factorize(J_, {}) : solver_->factorize(H_);
}

Factorization NormalEquations::factorize_damped(std::span<const double> damping) {
  const Timed timed(seconds_.factorize);
  damped_.resize(diagonal_.size());
  for (std::size_t k = 0; k < damped_.size(); ++k) damped_[k] = diagonal_[k] + damping[k];
  if (jacobian_solver_) return jacobian_solver_->factorize(J_, damping);
  H_.set_diagonal(damped_);
  const Factorization factorization = solver_->factorize(H_);
  H_.set_diagonal(diagonal_);
  return factorization;
}

Factorization NormalEquations::factorize_pinned(std::span<const double> pins) {
  const Factorization factorization = factorize_damped(pins);
  damped_.clear();
  return factorization;
}

void NormalEquations::solve(std::span<double> step) {
  const Timed timed(seconds_.solve);
  if (jacobian_solver_) {
    jacobian_solver_->minimize(J_.residual(), step);
  } else {
    solver_->solve(g_, step);
  }
}

double NormalEquations::backward_error(std::span<const double> step) {
  residual_.resize(step.size());
  H_.multiply(step, residual_);
  const std::vector<double>& diagonal = damped_.empty() ? diagonal_ : damped_;
  double error = 0.0, length = 0.0, gradient = 0.0, largest = 0.0;
  for (std::size_t k = 0; k < step.size(); ++k) {
    residual_[k] = std::abs(residual_[k] + (diagonal[k] - diagonal_[k]) * step[k] - g_[k]);
    if (std::isnan(residual_[k])) return residual_[k];
    error = std::max(error, residual_[k]);
    length = std::max(length, std::abs(step[k]));
    gradient = std::max(gradient, std::abs(g_[k]));
    largest = std::max(largest, diagonal[k]);
  }
  return error == 0.0 ? 0.0 : error / (largest * length + gradient);
}

int NormalEquations::free_directions() const {
  const ScalarPattern pattern(linearizer_.structure(), ScalarPattern::Triangle::lower);
  std::vector<double> values(pattern.nonzeros());
  pattern.scatter(H_, values);
  if (!std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); }))
    return -1;

  std::vector<double> scale(size());
  for (std::size_t k = 0; k < scale.size(); ++k) {
    scale[k] = diagonal_[k] > 0.0 ? 1.0 / std::sqrt(diagonal_[k]) : 1.0;
  }
  for (int column = 0; column < pattern.size(); ++column) {
    for (int k = pattern.column_begin()[column]; k < pattern.column_begin()[column + 1]; ++k) {
      const int row = pattern.rows()[k];
      values[k] *= scale[row] * scale[column];
      if (row == column) values[k] -= kFreeEigenvalue;
    }
  }
  const Eigen::Map<const Eigen::SparseMatrix<double>> shifted(
      pattern.size(), pattern.size(), pattern.nonzeros(), pattern.column_begin().data(),
      pattern.rows().data(), values.data());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> ldlt(shifted);
  if (ldlt.info() != Eigen::Success) return -1;
  return static_cast<int>((ldlt.vectorD().array() < 0.0).count());
}

std::string NormalEquations::explain(const Factorization& failure) const {
  const int block = failure.failed_block;
  if (block < 0 || block >= linearizer_.structure().blocks()) {
    return "H is not positive definite, and the linear solver could not determine at which "
           "variable";
  }
  const int variable = linearizer_.variable_of(block);
  const std::string name = graph_->describe_variable(variable);
  std::string text =
      fmt::format("H is not positive definite: the factorisation stopped at {}", name);
  if (!std::all_of(H_.values().begin(), H_.values().end(),
                   [](double v) { return std::isfinite(v); })) {
    return text + "; H holds values that are not finite";
  }
  const FreeDirections left_free = find_free_directions(*graph_, gauge_, graph_->values());
  const bool all_measured = left_free.complete && left_free.empty() && gauge_.left_free.empty();
  if (const int free = free_directions(); free > 0 && !all_measured)
    text += fmt::format("; {} gauge freedom{} likely", free, free == 1 ? " is" : "s are");
  if (diagonal_block(H_, block).isZero(0.0)) {
    text += fmt::format(
        "; no factor of {} has any weight (is its information zero, or has the loss switched it "
        "off?)",
        name);
  } else if (all_measured) {
    text +=
        "; all directions are measured, some so weakly that rounding of the others leaves nothing "
        "of them in H: linear solver spqr works without H";
  } else if (const int free = free_directions_of_block(H_, block); free > 0) {
    text += fmt::format("; the factors of {} leave {} of its {} directions free", name, free,
                        linearizer_.structure().block_size(block));
  }
  if (const std::string held = weak_hold(*graph_, gauge_, gauge_.component[variable]);
      !held.empty()) {
    text += fmt::format(
        "; only {} is constant in its component, which does not determine its rotation: fix a pose",
        held);
  }
  if (!left_free.empty()) text += "; " + left_free.describe(*graph_);
  return text;
}

}  // namespace cairn
