// SPDX-License-Identifier: BSD-3-Clause
#include "ceres_problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include <Eigen/Core>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

/// Roots of information from here to there are left as they are.
constexpr double kSmallest = 0x1p-10, kLargest = 0x1p+20;

class GraphManifold final : public ceres::Manifold {
 public:
  GraphManifold(const VariableType& type, CaughtException& caught) : type_(type), caught_(caught) {}
  int AmbientSize() const override { return type_.ambient_size(); }
  int TangentSize() const override { return type_.tangent_size(); }

  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    const std::int64_t offset = 0;
    return run([&] { type_.retract(1, x, &offset, delta, x_plus_delta); });
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    return identity(AmbientSize(), TangentSize(), jacobian);
  }
  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    return run([&] { type_.local(1, x, y, y_minus_x); });
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    return identity(TangentSize(), AmbientSize(), jacobian);
  }

 private:
  static bool identity(int rows, int columns, double* row_major) {
    std::fill_n(row_major, rows * columns, 0.0);
    for (int k = 0; k < std::min(rows, columns); ++k) row_major[k * columns + k] = 1.0;
    return true;
  }
  template <class Work>
  bool run(const Work& work) const {
    return caught_.run([&] { return "variable '" + std::string(type_.tag()) + "'"; }, work);
  }
  const VariableType& type_;
  CaughtException& caught_;
};

/// The manifold of one variable in scaled coordinates.
class ScaledManifold final : public ceres::Manifold {
 public:
  ScaledManifold(const ceres::Manifold& plain, const std::vector<double>& Lt,
                 const std::vector<double>& Lt_inverse)
      : plain_(plain),
        Lt_(Eigen::Map<const Eigen::MatrixXd>(Lt.data(), TangentSize(), TangentSize())),
        Lt_inverse_(
            Eigen::Map<const Eigen::MatrixXd>(Lt_inverse.data(), TangentSize(), TangentSize())) {}
  int AmbientSize() const override { return plain_.AmbientSize(); }
  int TangentSize() const override { return plain_.TangentSize(); }

  bool Plus(const double* x, const double* u, double* x_plus_delta) const override {
    const Eigen::VectorXd delta = Lt_inverse_ * Eigen::Map<const Eigen::VectorXd>(u, TangentSize());
    return plain_.Plus(x, delta.data(), x_plus_delta);
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<RowMajor> J(jacobian, AmbientSize(), TangentSize());
    J.setZero();
    J.topRows(TangentSize()) = Lt_inverse_;
    return true;
  }
  bool Minus(const double* y, const double* x, double* u) const override {
    Eigen::VectorXd delta(TangentSize());
    if (!plain_.Minus(y, x, delta.data())) return false;
    Eigen::Map<Eigen::VectorXd>(u, TangentSize()) = Lt_ * delta;
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<RowMajor> J(jacobian, TangentSize(), AmbientSize());
    J.setZero();
    J.leftCols(TangentSize()) = Lt_;
    return true;
  }

 private:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const ceres::Manifold& plain_;
  Eigen::MatrixXd Lt_, Lt_inverse_;
};

/// One factor, its residual and Jacobians times `scale`. Borrows measurement and information from
/// the graph, which names it in errors.
class FactorCost final : public ceres::CostFunction {
 public:
  FactorCost(const Graph& graph, int position, double scale, CaughtException& caught)
      : graph_(graph),
        position_(position),
        type_(graph.factor_type(position)),
        measurement_(graph.measurement(position).data()),
        sqrt_information_(graph.sqrt_information(position).data()),
        scale_(scale),
        caught_(caught) {
    const FactorType& type = type_;
    set_num_residuals(type.residual_size());
    for (int v = 0; v < type.arity(); ++v)
      mutable_parameter_block_sizes()->push_back(type.ambient_size(v));
  }

  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    const auto name = [&] { return "factor '" + graph_.describe_factor(position_) + "'"; };
    const bool returned = caught_.run(name, [&] {
      if (!jacobians) {
        type_.evaluate(x, measurement_, sqrt_information_, residuals, nullptr);
      } else {
        evaluate_with_jacobians(x, residuals, jacobians);
      }
      for (int r = 0; r < num_residuals(); ++r) residuals[r] *= scale_;
    });
    return returned && std::all_of(residuals, residuals + num_residuals(),
                                   [](double r) { return std::isfinite(r); });
  }

 private:
  void evaluate_with_jacobians(double const* const* x, double* residuals,
                               double** jacobians) const {
    // Room for tangent Jacobians, column-major, one behind the other; kept by each of Ceres'
    // threads.
    thread_local std::vector<double> room;
    thread_local std::vector<double*> tangent;
    const int rows = num_residuals(), arity = type_.arity();
    int size = 0;
    for (int v = 0; v < arity; ++v) size += rows * type_.tangent_size(v);
    room.resize(size);
    tangent.resize(arity);
    double* next = room.data();
    for (int v = 0; v < arity; ++v) {
      tangent[v] = jacobians[v] ? next : nullptr;
      next += rows * type_.tangent_size(v);
    }
    type_.evaluate(x, measurement_, sqrt_information_, residuals, tangent.data());
    for (int v = 0; v < arity; ++v) {
      if (jacobians[v])
        widen(tangent[v], rows, type_.tangent_size(v), type_.ambient_size(v), jacobians[v]);
    }
  }

  /// Column-major rows × tangent to row-major rows × ambient, zeros behind; scaled.
  void widen(const double* from, int rows, int tangent, int ambient, double* to) const {
    for (int r = 0; r < rows; ++r) {
      for (int c = 0; c < tangent; ++c) to[r * ambient + c] = scale_ * from[c * rows + r];
      std::fill(to + r * ambient + tangent, to + (r + 1) * ambient, 0.0);
    }
  }

  const Graph& graph_;
  int position_;
  const FactorType& type_;
  const double* measurement_;
  const double* sqrt_information_;
  double scale_;
  CaughtException& caught_;
};

class WrappedLoss final : public ceres::LossFunction {
 public:
  WrappedLoss(const Loss& loss, CaughtException& caught) : loss_(loss), caught_(caught) {}
  void Evaluate(double s, double out[3]) const override {
    const bool returned = caught_.run([] { return "the loss"; },
                                      [&] {
                                        loss_.evaluate({&s, 1}, {&out[0], 1}, {&out[1], 1});
                                        out[2] = loss_.second_derivative(s);
                                      });
    if (!returned) out[0] = out[1] = out[2] = std::numeric_limits<double>::quiet_NaN();
  }

 private:
  const Loss& loss_;
  CaughtException& caught_;
};

/// Of residuals that are `scale` times their own: scale² ρ(s / scale²).
class ScaledLoss final : public ceres::LossFunction {
 public:
  ScaledLoss(std::unique_ptr<ceres::LossFunction> loss, double scale)
      : loss_(std::move(loss)), square_(scale * scale) {}
  void Evaluate(double s, double out[3]) const override {
    loss_->Evaluate(s / square_, out);
    out[0] *= square_;
    out[2] /= square_;
  }

 private:
  std::unique_ptr<ceres::LossFunction> loss_;
  double square_;
};

ceres::Problem::Options lend_everything() {
  ceres::Problem::Options options;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.disable_all_safety_checks = true;  // the graph has checked
  return options;
}

double* state(const Graph& graph, Values& values, int variable) {
  return values.pools[graph.pool(variable)].data() +
         static_cast<std::size_t>(graph.slot(variable)) * graph.type(variable).ambient_size();
}

}  // namespace

/// A power of two that brings the root of the information near one where it is far from that: of
/// each factor what it measures least exactly, and the median of that over all factors, since the
/// weight of a few may be chosen to mean "held" or "unknown".
double residual_scale(const Graph& graph) {
  std::vector<double> least;
  least.reserve(static_cast<std::size_t>(graph.factor_count()));
  for (int f = 0; f < graph.factor_count(); ++f) {
    const double* diagonal = graph.sqrt_information(f).data();
    double smallest = std::numeric_limits<double>::infinity();
    for (int left = graph.factor_type(f).residual_size(); left > 0; diagonal += left--) {
      if (*diagonal > 0.0) smallest = std::min(smallest, *diagonal);
    }
    if (std::isfinite(smallest)) least.push_back(smallest);
  }
  if (least.empty()) return 1.0;
  const auto middle = least.begin() + static_cast<std::ptrdiff_t>(least.size() / 2);
  std::nth_element(least.begin(), middle, least.end());
  return *middle >= kSmallest && *middle <= kLargest ? 1.0 : std::ldexp(1.0, -std::ilogb(*middle));
}

CeresProblem::CeresProblem(const Graph& graph, const Gauge& gauge, Values& values,
                           const TangentScaling* scaling)
    : residual_scale_(residual_scale(graph)), problem_(lend_everything()) {
  for (const std::shared_ptr<const Loss>& each : graph.losses())
    losses_.push_back(each ? std::make_unique<WrappedLoss>(*each, caught_) : nullptr);
  for (auto& each : losses_) {
    if (each && residual_scale_ != 1.0)
      each = std::make_unique<ScaledLoss>(std::move(each), residual_scale_);
  }
  add_variables(graph, gauge, values, scaling);
  add_factors(graph, values);
}

void CeresProblem::add_variables(const Graph& graph, const Gauge& gauge, Values& values,
                                 const TangentScaling* scaling) {
  for (const VariablePool& pool : graph.variable_pools()) {
    if (pool.type->tangent_size() > pool.type->ambient_size()) {
      throw Error(ErrorCode::usage,
                  "optimizer ceres: " + std::string(pool.type->tag()) +
                      " has a tangent space larger than its state, which Ceres cannot express");
    }
    manifolds_.push_back(std::make_unique<GraphManifold>(*pool.type, caught_));
  }
  for (int v = 0; v < graph.variable_count(); ++v) {
    double* x = state(graph, values, v);
    ceres::Manifold* manifold = manifolds_[graph.pool(v)].get();
    if (scaling && !gauge.held[v]) {
      manifolds_.push_back(
          std::make_unique<ScaledManifold>(*manifold, scaling->Lt[v], scaling->Lt_inverse[v]));
      manifold = manifolds_.back().get();
    }
    problem_.AddParameterBlock(x, graph.type(v).ambient_size(), manifold);
    if (gauge.held[v]) problem_.SetParameterBlockConstant(x);
  }
}

void CeresProblem::add_factors(const Graph& graph, Values& values) {
  std::vector<double*> x;
  costs_.reserve(graph.factor_count());
  for (int position = 0; position < graph.factor_count(); ++position) {
    const FactorRef ref = graph.ref(position);
    const FactorPool& pool = graph.factor_pools()[ref.pool];
    costs_.push_back(std::make_unique<FactorCost>(graph, position, residual_scale_, caught_));
    x.clear();
    for (const std::int32_t v : graph.factor_variables(position))
      x.push_back(state(graph, values, v));
    const bool plain = !pool.type->takes_loss();
    const auto loss = static_cast<std::size_t>(losses_.size() == 1 ? 0 : pool.losses[ref.entry]);
    problem_.AddResidualBlock(costs_.back().get(), plain ? nullptr : losses_[loss].get(), x);
  }
}

}  // namespace cairn
