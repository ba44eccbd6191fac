// SPDX-License-Identifier: BSD-3-Clause
#include "local_problem.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <fmt/core.h>

#include "cairn/geometry/state_group.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"
#include "dense/products.hpp"

namespace cairn::sparsify {
namespace {

constexpr int kIterations = 20;
constexpr double kSettled = 1e-9;

/// Why a node cannot leave because of itself or a neighbour; empty: it can.
std::string refuse(const Graph& graph, int leaving, int node) {
  if (!graph.type(leaving).lie_group()) {
    return fmt::format("{} is not a pose of a Lie group, and new factors relate only such",
                       graph.describe_variable(leaving));
  }
  if (graph.type(node).tag() == graph.type(leaving).tag()) return {};
  return fmt::format("{} has a factor with {}, and new factors relate poses of one kind only",
                     graph.describe_variable(leaving), graph.describe_variable(node));
}

/// Whether a factor type measures a whole relative pose of two variables of that type.
bool relates(const FactorType& type, const VariableType& pose) {
  return type.arity() == 2 && type.is_relative() && type.residual_size() == pose.tangent_size() &&
         type.variable_tags()[0] == pose.tag() && type.variable_tags()[1] == pose.tag();
}

/// Dense normal equations of the cropped problem, the removed nodes first.
class DenseSystem {
 public:
  DenseSystem(const WorkGraph& work, const LocalProblem& local) : work_(work), local_(local) {
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

  int removed_size() const { return begin_[local_.removed.size()]; }
  int size() const { return begin_.back(); }
  const std::vector<double>& blanket_state(std::size_t k) const {
    return states_[local_.removed.size() + k];
  }

  /// H and g = −Jᵀr at the states; returns chi2.
  double linearize(Matrix& H, Vector& g) const {
    H.setZero(size(), size());
    g.setZero(size());
    double chi2 = 0.0;
    for (std::size_t k = 0; k < local_.factors.size(); ++k) {
      const WorkFactor& factor = work_.factor(local_.factors[k]);
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
      work_.graph().type(nodes_[k]).retract(1, states_[k].data(), &at, step.data(),
                                            states_[k].data());
    }
  }

  /// To the minimum, the last node of the blanket held. By Gauss and Newton from a minimum of the
  /// whole graph, which is near; a step that does not lower chi2 is not taken.
  void solve(Matrix& H, Vector& g) {
    double chi2 = linearize(H, g);
    const int free = begin_[nodes_.size() - 1];
    for (int k = 0; k < kIterations && free > 0; ++k) {
      const Eigen::LDLT<Matrix> ldlt(Matrix(H.topLeftCorner(free, free)));
      if (ldlt.info() != Eigen::Success || !ldlt.isPositive()) return;
      Vector step = Vector::Zero(size());
      step.head(free) = ldlt.solve(g.head(free));
      const double expected = step.dot(g);
      if (!(expected > kSettled * (1.0 + chi2))) return;
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

 private:
  const WorkGraph& work_;
  const LocalProblem& local_;
  std::vector<int> nodes_, begin_;
  std::vector<std::vector<int>> on_;
  std::vector<std::vector<double>> states_;
};

/// A model for each pair of the blanket's nodes, and what it measures.
void add_models(const Graph& graph, const LocalProblem& local, Marginal& marginal) {
  const VariableType& variable = graph.type(local.blanket.front());
  const StateGroup group(variable);
  const FactorType& type = *local.type;
  const int m = type.residual_size(), t = variable.tangent_size();
  const int n = static_cast<int>(std::ssize(local.blanket)), d = n * t;
  const std::vector<double> unit = pack(Matrix::Identity(m, m));
  Vector r(m);
  for (int i = 0; i < n; ++i) {
    const std::vector<double> back = group.inverse(marginal.states[i]);
    for (int j = i + 1; j < n; ++j) {
      std::vector<double> z = group.compose(back, marginal.states[j]);
      type.normalize(z.data());
      FactorModel model{.nodes = {i, j}, .size = m, .jacobian = std::vector<double>(m * d)};
      const double* x[] = {marginal.states[i].data(), marginal.states[j].data()};
      // Column-major: a node's columns lie together.
      double* J[] = {model.jacobian.data() + i * t * m, model.jacobian.data() + j * t * m};
      type.evaluate(x, z.data(), unit.data(), r.data(), J);
      marginal.dense.models.push_back(std::move(model));
      marginal.relative.push_back(z);
    }
  }
}

}  // namespace

LocalProblem crop(const WorkGraph& work, std::vector<int> removed) {
  const Graph& graph = work.graph();
  LocalProblem local{
      .removed = std::move(removed), .blanket = {}, .factors = {}, .refusal = {}, .type = nullptr};
  local.blanket = work.blanket(local.removed);
  for (const std::vector<int>* nodes : {&local.removed, &local.blanket}) {
    for (const int v : *nodes) {
      if (local.refusal.empty()) local.refusal = refuse(graph, local.removed.front(), v);
    }
  }
  for (const int v : local.removed) {
    if (graph.fixed(v)) local.refusal = fmt::format("{} is held", graph.describe_variable(v));
    for (const int f : work.on(v)) {
      local.factors.push_back(f);
      const FactorType& type = *work.factor(f).type;
      if (type.absolute_size() > 0) {
        local.refusal = fmt::format("{} on {} says where it is in the world", type.tag(),
                                    graph.describe_variable(v));
      }
      if (!local.type && relates(type, graph.type(v))) local.type = work.factor(f).type;
    }
  }
  // Where only pairs of correlated factors are left, such as others of the graph are.
  for (const FactorPool& pool : graph.factor_pools()) {
    if (!local.type && relates(*pool.type, graph.type(local.removed.front())))
      local.type = pool.type;
  }
  if (!local.refusal.empty()) return local;
  if (!local.type && local.blanket.size() > 1) {
    local.refusal =
        fmt::format("{}: no factor of the graph measures a whole relative pose, as new ones do",
                    graph.describe_variable(local.removed.front()));
    return local;
  }
  // Within the blanket: what only says how its nodes lie to each other.
  for (const int v : local.blanket) {
    for (const int f : work.on(v)) {
      const WorkFactor& factor = work.factor(f);
      const bool within = std::ranges::all_of(factor.variables, [&](int other) {
        return std::ranges::binary_search(local.blanket, other);
      });
      if (within && factor.variables.size() > 1 && factor.type->absolute_size() == 0)
        local.factors.push_back(f);
    }
  }
  std::ranges::sort(local.factors);
  local.factors.erase(std::unique(local.factors.begin(), local.factors.end()), local.factors.end());
  return local;
}

Marginal marginalize(const WorkGraph& work, const LocalProblem& local, bool resolve) {
  const Graph& graph = work.graph();
  DenseSystem system(work, local);
  Matrix H;
  Vector g;
  if (resolve) {
    system.solve(H, g);
  } else {
    system.linearize(H, g);
  }
  const int r = system.removed_size(), b = system.size() - r;
  const Eigen::LLT<Matrix> llt(Matrix(H.topLeftCorner(r, r)));
  if (llt.info() != Eigen::Success) {
    throw Error(ErrorCode::numerical, fmt::format("the factors on {} leave it open",
                                                  graph.describe_variable(local.removed.front())));
  }
  Matrix L = H.bottomRightCorner(b, b);
  const Matrix half = llt.matrixL().solve(H.topRightCorner(r, b));
  dense::subtract_product_of_transpose(half, half, L);
  L = (0.5 * (L + L.transpose())).eval();

  Marginal marginal;
  for (std::size_t k = 0; k < local.blanket.size(); ++k) {
    marginal.dense.node_sizes.push_back(graph.type(local.blanket[k]).tangent_size());
    marginal.states.push_back(system.blanket_state(k));
  }
  marginal.dense.information.assign(L.data(), L.data() + L.size());
  if (local.blanket.size() > 1) add_models(graph, local, marginal);
  return marginal;
}

}  // namespace cairn::sparsify
