// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <exception>
#include <memory>
#include <mutex>
#include <vector>

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>

#include "cairn/graph/gauge.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/runtime/plugin_call.hpp"

namespace cairn {

/// Keeps the first exception of a plugin that is called from within Ceres, whose frames and threads
/// are not made to be unwound.
class CaughtException {
 public:
  /// work(); false if it threw. `component()` names what threw, as for `call_plugin`.
  template <class Component, class Work>
  bool run(const Component& component, const Work& work) noexcept {
    try {
      call_plugin(component, work);
      return true;
    } catch (...) {
      const std::lock_guard lock(mutex_);
      if (!exception_) exception_ = std::current_exception();
      return false;
    }
  }
  void rethrow() const {
    if (exception_) std::rethrow_exception(exception_);
  }

 private:
  std::mutex mutex_;
  std::exception_ptr exception_;
};

/// Coordinates u of each variable's tangent space in which Ceres works: δ = L⁻ᵀ u, with the
/// Cholesky factor L Lᵀ of a positive definite matrix, as H's diagonal block of the variable.
struct TangentScaling {
  /// By variable: Lᵀ and L⁻ᵀ, column-major; empty for constant variables.
  std::vector<std::vector<double>> Lt, Lt_inverse;
};

/// What `CeresProblem` multiplies whitened residuals by: a power of two.
double residual_scale(const Graph& graph);

/// A graph as a ceres::Problem with cairn's residuals, Jacobians, retractions and loss.
///
/// Ceres wants Jacobians with respect to the ambient state and multiplies them by the Jacobian of
/// its Plus. Ours are with respect to the tangent space at once: so Plus is said to have the
/// Jacobian [I; 0], and our columns stand first among the ambient ones, followed by zeros. The
/// product is ours, exactly. With a `TangentScaling` that Jacobian is [L⁻ᵀ; 0]: Ceres' line search
/// has no scaling of its own.
///
/// Ceres minimises ½ Σ ρ(‖r‖²), cairn states twice that.
///
/// Ceres' damping and its test of the gradient have bounds without a scale: where the information
/// is far below one it would stay where it starts, and call that convergence. There all whitened
/// residuals are multiplied by a power of two, which rounds nothing, and losses are scaled along:
/// Ceres' cost is then `cost_scale()` times that of the graph.
class CeresProblem {
 public:
  /// `values`, which Ceres moves, must outlive this object. `scaling`: null for none; not used
  /// after the constructor.
  CeresProblem(const Graph& graph, const Gauge& gauge, Values& values,
               const TangentScaling* scaling = nullptr);

  ceres::Problem& problem() { return problem_; }
  /// 1 unless the information is far from one; a power of four.
  double cost_scale() const { return residual_scale_ * residual_scale_; }
  /// Throws what a factor, a loss or a type of variables threw while Ceres ran, as `Error` (plugin)
  /// with its name.
  void rethrow() const { caught_.rethrow(); }

 private:
  void add_variables(const Graph& graph, const Gauge& gauge, Values& values,
                     const TangentScaling* scaling);
  void add_factors(const Graph& graph, Values& values);

  CaughtException caught_;
  double residual_scale_;  // a power of two
  // Owned here and only lent to the problem, which therefore is the last to come and the first to
  // go.
  std::vector<std::unique_ptr<ceres::LossFunction>> losses_;  // as Graph::losses()
  std::vector<std::unique_ptr<ceres::Manifold>> manifolds_;   // by variable pool, then scaled ones
  std::vector<std::unique_ptr<ceres::CostFunction>> costs_;
  ceres::Problem problem_;
};

}  // namespace cairn
