// SPDX-License-Identifier: BSD-3-Clause
#include "local_problem.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/core.h>

#include "blanket_matrices.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/geometry/state_group.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "constraint_model.hpp"
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"
#include "dense/products.hpp"

namespace cairn::sparsify {
namespace {

constexpr int kIterations = 20;
/// A step is taken if it could lower chi2 by more than this part of it, and moves something by more
/// than this part of the largest coordinate: neither depends on the scale of the information.
constexpr double kSettled = 1e-9, kRounding = 1e-12;
/// What is left of a diagonal element, as a part of it, where a direction is open, and the damping
/// that keeps steps in such directions small.
constexpr double kZeroPivot = 1e-11, kDamping = 1e-8;
/// Of H scaled to a unit diagonal, where there are landmarks: smaller eigenvalues, as a part of the
/// largest, are of directions that are not determined.
constexpr double kUndetermined = 1e-9, kTiny = 1e-200;
/// How far from the linear model's the minimum may be there, squared and in standard deviations.
constexpr double kNearLinear = 1.0;
/// Columns of J N, N being orthonormal in units of Λ's diagonal, that are zero but for rounding.
constexpr double kOpen = 1e-6;
/// Diagonal elements of Λ that are squares of rounding, as a part of the largest.
constexpr double kNothing = 1e-26;

/// Dense normal equations of the cropped problem, the removed nodes first.
class DenseSystem {
 public:
  DenseSystem(const WorkGraph& work, const LocalProblem& local) : work_(&work), local_(&local) {
    nodes_ = local.removed;
    nodes_.insert(nodes_.end(), local.blanket.begin(), local.blanket.end());
    begin_.push_back(0);
    for (const int v : nodes_) {
      const auto x = work.graph().state(v);
      states_.emplace_back(x.begin(), x.end());
      begin_.push_back(begin_.back() + work.graph().type(v).tangent_size());
    }
    for (const int f : local.factors) {
      std::vector<int> on;
      for (const int v : work.factor(f).variables)
        on.push_back(static_cast<int>(std::ranges::find(nodes_, v) - nodes_.begin()));
      on_.push_back(std::move(on));
    }
  }

  int removed_size() const { return begin_[local_->removed.size()]; }
  int size() const { return begin_.back(); }
  const std::vector<double>& blanket_state(std::size_t k) const {
    return states_[local_->removed.size() + k];
  }

  /// H and g = −Jᵀr at the states; returns chi2.
  double linearize(Matrix& H, Vector& g) const {
    H.setZero(size(), size());
    g.setZero(size());
    double chi2 = 0.0;
    for (std::size_t k = 0; k < local_->factors.size(); ++k) {
      const WorkFactor& factor = work_->factor(local_->factors[k]);
      const std::vector<int>& on = on_[k];
      const int rows = factor.type->residual_size();
      Vector r(rows);
      std::vector<Matrix> J;
      for (const int node : on) J.emplace_back(rows, begin_[node + 1] - begin_[node]);
      std::vector<const double*> x;
      std::vector<double*> out;
      for (std::size_t a = 0; a < on.size(); ++a) {
        x.push_back(states_[on[a]].data());
        out.push_back(J[a].data());
      }
      factor.type->evaluate(x.data(), factor.measurement.data(), factor.sqrt_information.data(),
                            r.data(), out.data());
      chi2 += r.squaredNorm();
      for (std::size_t a = 0; a < on.size(); ++a) {
        g.segment(begin_[on[a]], J[a].cols()) -= J[a].transpose() * r;
        for (std::size_t b = 0; b < on.size(); ++b) {
          dense::add_product_of_transpose(
              J[a], J[b], H.block(begin_[on[a]], begin_[on[b]], J[a].cols(), J[b].cols()));
        }
      }
    }
    if (!std::isfinite(chi2) || !H.allFinite())
      throw Error(ErrorCode::numerical, "a Jacobian of the cropped problem is not finite");
    return chi2;
  }

  void retract(const Vector& step) {
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      const std::int64_t at = begin_[k];
      work_->graph().type(nodes_[k]).retract(1, states_[k].data(), &at, step.data(),
                                             states_[k].data());
    }
  }

  bool is_rounding(const Vector& step) const {
    double largest = 1.0;  // an angle
    for (const std::vector<double>& state : states_) {
      for (const double x : state) largest = std::max(largest, std::abs(x));
    }
    return step.cwiseAbs().maxCoeff() <= kRounding * largest;
  }

  /// To the minimum, the last pose of the blanket held unless the problem is absolute. By Gauss and
  /// Newton from a minimum of the whole graph, which is near; a step that does not lower chi2 is
  /// not taken. Given are chi2, H and g where it is; H and g become those of the minimum.
  ///
  /// Bearings of a few poses alone may not determine a landmark, so that their minimum is far from
  /// that of the graph, or nowhere. Then it stays where it is: in directions that H does not
  /// determine, and in all if the minimum is not where the linear model at the beginning has it.
  void solve(double chi2, Matrix& H, Vector& g) {
    const std::vector<int> free = free_columns();
    const auto states = states_;
    const Matrix H_before = H;
    const Vector g_before = g;
    Vector linear = Vector::Zero(size());
    descend(free, chi2, H, g, linear);
    if (!has_landmarks()) return;
    const Vector off = moved_from(states) - linear;
    if (off.dot(H_before * off) < kNearLinear) return;
    states_ = states;
    H = H_before;
    g = g_before;
  }

 private:
  /// `linear`: becomes the first step.
  void descend(const std::vector<int>& free, double chi2, Matrix& H, Vector& g, Vector& linear) {
    for (int k = 0; k < kIterations && !free.empty(); ++k) {
      Matrix A = H(free, free);
      Eigen::LDLT<Matrix> ldlt(A);
      const Vector diagonal = ldlt.transpositionsP() * Vector(A.diagonal());
      if ((ldlt.vectorD().array() <= kZeroPivot * diagonal.array()).any()) {
        A.diagonal() *= 1.0 + kDamping;
        ldlt.compute(A);
      }
      if (ldlt.info() != Eigen::Success || !ldlt.isPositive()) return;
      Vector step = Vector::Zero(size());
      const Vector of_free = has_landmarks() ? determined_step(H(free, free), g(free))
                                             : Vector(ldlt.solve(Vector(g(free))));
      step(free) = of_free;
      if (k == 0) linear = step;
      const double expected = step.dot(g);
      if (!(expected > kSettled * chi2) || is_rounding(step)) return;
      const auto before = states_;
      bool lower = false;
      for (int tries = 0; tries < 10 && !lower; ++tries, step *= 0.5) {
        states_ = before;
        retract(step);
        Matrix H_there;
        Vector g_there;
        const double there = linearize(H_there, g_there);
        lower = there <= chi2;
        if (!lower) continue;
        chi2 = there;
        H = std::move(H_there);
        g = std::move(g_there);
      }
      if (!lower) {
        states_ = before;
        return;
      }
    }
  }

  bool has_landmarks() const {
    return std::ranges::any_of(nodes_,
                               [&](int node) { return is_point(work_->graph().type(node)); });
  }

  /// H⁻¹ g in the directions that H determines; zero in others. H is scaled to a unit diagonal.
  static Vector determined_step(const Matrix& H, const Vector& g) {
    const Vector scale = H.diagonal().array().max(kTiny).rsqrt();
    const Eigen::SelfAdjointEigenSolver<Matrix> solver(
        Matrix(scale.asDiagonal() * H * scale.asDiagonal()));
    const Vector values = solver.eigenvalues();
    const Vector inverse =
        (values.array() > kUndetermined * values.maxCoeff()).select(values.cwiseInverse(), 0.0);
    const Vector in_directions =
        inverse.cwiseProduct(Vector(solver.eigenvectors().transpose() * scale.cwiseProduct(g)));
    return scale.cwiseProduct(Vector(solver.eigenvectors() * in_directions));
  }

  /// The steps that lead here from these states.
  Vector moved_from(const std::vector<std::vector<double>>& states) const {
    Vector steps(size());
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      work_->graph().type(nodes_[k]).local(1, states[k].data(), states_[k].data(),
                                           steps.data() + begin_[k]);
    }
    return steps;
  }

  std::vector<int> free_columns() const {
    const std::size_t held = local_->removed.size() + static_cast<std::size_t>(local_->poses) - 1;
    std::vector<int> free;
    for (int k = 0; k < size(); ++k) {
      if (local_->absolute || k < begin_[held] || k >= begin_[held + 1]) free.push_back(k);
    }
    return free;
  }

  const WorkGraph* work_;
  const LocalProblem* local_;
  std::vector<int> nodes_, begin_;
  std::vector<std::vector<int>> on_;
  std::vector<std::vector<double>> states_;
};

/// Adds the models of a blanket, which measure its nodes where they are `measured`.
class Models {
 public:
  Models(const Graph& graph, const LocalProblem& local,
         const std::vector<std::vector<double>>& measured, Marginal& marginal)
      : graph_(graph),
        local_(local),
        measured_(measured),
        marginal_(marginal),
        begin_(marginal.dense.offsets()) {}

  /// Of each pair of poses, each pose and landmark, and, in an absolute problem, each pose.
  void add_all() {
    const int n = static_cast<int>(std::ssize(local_.blanket)), poses = local_.poses;
    for (int i = 0; i < poses; ++i) {
      for (int j = i + 1; j < poses; ++j) add_relative(i, j);
    }
    for (int i = 0; i < poses; ++i) {
      for (int j = poses; j < n; ++j) add_observation(i, j);
    }
    for (int i = 0; local_.absolute && i < poses; ++i) {
      if (!graph_.fixed(local_.blanket[i]))
        add(local_.types.prior, {i}, measured_[i], position_rows(i));
    }
  }

 private:
  const VariableType& type(int node) const { return graph_.type(local_.blanket[node]); }

  void add_relative(int i, int j) {
    const StateGroup group(type(i));
    add(local_.types.relative, {i, j}, group.between(measured_[i], measured_[j]), position_rows(i));
  }

  void add_observation(int i, int j) {
    const Pose from = pose_of(type(i), measured_[i]);
    const Eigen::Vector3d seen = from.R.transpose() * (pose_of(type(j), measured_[j]).t - from.t);
    std::vector<double> z(seen.data(), seen.data() + local_.types.observation->measurement_size());
    if (local_.types.bearing_range) z = {std::atan2(z[1], z[0]), std::hypot(z[0], z[1])};
    add(local_.types.observation, {i, j}, std::move(z), local_.types.bearing_range ? 1 : 0);
  }

  /// How many rows of a pose's residual are of the position.
  int position_rows(int node) const {
    return has_position(type(node)) ? type(node).placement()->dimension() : 0;
  }

  /// The model of the whole measurement, and those of its first rows and of the others.
  void add(const std::shared_ptr<const FactorType>& type, std::vector<int> nodes,
           std::vector<double> z, int first) {
    type->normalize(z.data());
    const int m = type->residual_size();
    FactorModel model{.nodes = std::move(nodes),
                      .size = m,
                      .jacobian = std::vector<double>(static_cast<std::size_t>(m * begin_.back()))};
    std::vector<const double*> x;
    std::vector<double*> J;
    for (const int node : model.nodes) {
      x.push_back(marginal_.states[node].data());
      J.push_back(model.jacobian.data() + m * begin_[node]);  // a node's columns lie together
    }
    Vector r(m);
    type->evaluate(x.data(), z.data(), pack(Matrix::Identity(m, m)).data(), r.data(), J.data());
    marginal_.dense.models.push_back(std::move(model));
    marginal_.predictions.push_back({type, std::move(z), {}});
    if (!local_.parts || first <= 0 || first >= m) return;
    add_part(0, first);
    add_part(first, m);
  }

  /// Rows [begin, end) of the last whole model.
  void add_part(int begin, int end) {
    const auto whole = std::ranges::find_if(
        marginal_.predictions.rbegin(), marginal_.predictions.rend(),
        [](const Marginal::Prediction& prediction) { return prediction.directions.size() == 0; });
    const FactorModel& of =
        marginal_.dense.models[whole.base() - marginal_.predictions.begin() - 1];
    const int d = begin_.back();
    FactorModel part{.nodes = of.nodes, .size = end - begin, .jacobian = {}};
    const Matrix J = jacobian(of, d).middleRows(begin, part.size);
    part.jacobian.assign(J.data(), J.data() + J.size());
    Marginal::Prediction prediction = *whole;
    prediction.directions = Matrix::Identity(of.size, of.size).middleCols(begin, part.size);
    marginal_.dense.models.push_back(std::move(part));
    marginal_.predictions.push_back(std::move(prediction));
  }

  const Graph& graph_;
  const LocalProblem& local_;
  const std::vector<std::vector<double>>& measured_;
  Marginal& marginal_;
  std::vector<int> begin_;
};

/// N: a basis of what Λ leaves open, the gauge included, orthonormal in units of Λ's diagonal.
Matrix open_directions(const DenseBlanket& dense, int rank, const Vector& unit) {
  const Matrix scaled = unit.asDiagonal() * Matrix(information(dense)) * unit.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(scaled);
  return unit.asDiagonal() * eigen.eigenvectors().leftCols(dense.size() - rank);
}

/// Reduces the models to what Λ determines, where it leaves more open than the gauge.
void reduce_models(Marginal& marginal) {
  DenseBlanket& blanket = marginal.dense;
  const int d = blanket.size(), gauge = blanket.absolute ? 0 : blanket.node_sizes.front();
  const int rank = project(blanket, Projection::node).rank;
  marginal.open = d - gauge - rank;
  if (marginal.open <= 0) return;
  Vector unit = information(blanket).diagonal();
  const double least = kNothing * unit.maxCoeff();
  for (double& u : unit) u = u > least ? 1.0 / std::sqrt(u) : 1.0;
  const Matrix N = open_directions(blanket, rank, unit);
  std::vector<FactorModel> models;
  std::vector<Marginal::Prediction> predictions;
  for (std::size_t k = 0; k < blanket.models.size(); ++k) {
    FactorModel& model = blanket.models[k];
    const Matrix J = jacobian(model, d);
    const Matrix JN = dense::product(J, N);
    const double size = (J * unit.asDiagonal()).norm();
    const Eigen::SelfAdjointEigenSolver<Matrix> eigen(dense::product_with_transpose(JN, JN));
    const Eigen::Index left = (eigen.eigenvalues().array() < kOpen * kOpen * size * size).count();
    if (left == 0) continue;
    Marginal::Prediction& prediction = predictions.emplace_back(marginal.predictions[k]);
    if (left < model.size) {
      const Matrix B = eigen.eigenvectors().leftCols(left);
      const Matrix reduced = dense::product_of_transpose(B, J);
      prediction.directions =
          prediction.directions.size() == 0 ? B : dense::product(prediction.directions, B);
      model.size = static_cast<int>(left);
      model.jacobian.assign(reduced.data(), reduced.data() + reduced.size());
    }
    models.push_back(std::move(model));
  }
  blanket.models = std::move(models);
  marginal.predictions = std::move(predictions);
}

}  // namespace

Marginal marginalize(const WorkGraph& work, const LocalProblem& local, LocalMinimum minimum,
                     LinearConstraints* whole) {
  const Graph& graph = work.graph();
  DenseSystem system(work, local);
  Matrix H;
  Vector g;
  const double chi2 = system.linearize(H, g);
  DenseSystem own = system;  // at the states that the new factors measure
  if (minimum != LocalMinimum::ignored) {
    Matrix H_own = H;
    Vector g_own = g;
    own.solve(chi2, H_own, g_own);
    if (minimum == LocalMinimum::linearized) {
      system = own;
      H = std::move(H_own);
      g = std::move(g_own);
    }
  }
  const int r = system.removed_size(), b = system.size() - r;
  const Eigen::LLT<Matrix> llt(Matrix(H.topLeftCorner(r, r)));
  if (llt.info() != Eigen::Success) {
    throw Error(ErrorCode::numerical, fmt::format("the factors on {} leave it open",
                                                  graph.describe_variable(local.removed.front())));
  }
  Matrix L = H.bottomRightCorner(b, b);
  const Matrix half = llt.matrixL().solve(H.topRightCorner(r, b));
  const Vector half_gradient = llt.matrixL().solve(g.head(r));
  dense::subtract_product_of_transpose(half, half, L);
  L = (0.5 * (L + L.transpose())).eval();

  Marginal marginal;
  for (std::size_t k = 0; k < local.blanket.size(); ++k) {
    marginal.dense.node_sizes.push_back(graph.type(local.blanket[k]).tangent_size());
    marginal.states.push_back(system.blanket_state(k));
  }
  marginal.dense.information.assign(L.data(), L.data() + L.size());
  marginal.dense.absolute = local.absolute;
  marginal.gradient = g.tail(b) - half.transpose() * half_gradient;
  if (!whole) {
    std::vector<std::vector<double>> measured;
    for (std::size_t k = 0; k < local.blanket.size(); ++k) measured.push_back(own.blanket_state(k));
    Models(graph, local, measured, marginal).add_all();
  } else if (local.absolute || local.blanket.size() > 1) {
    add_constraint_model(graph, local, *whole, marginal);
  }
  if (!marginal.dense.models.empty()) reduce_models(marginal);
  return marginal;
}

}  // namespace cairn::sparsify
