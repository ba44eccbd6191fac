// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/measures.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <Eigen/Core>

#include "cairn/evaluation/trajectory.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/geometry/state_group.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/linear/graph_marginals.hpp"
#include "cairn/linear/normal_equations.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"

namespace cairn {
namespace {

using Block = Eigen::Map<const Eigen::MatrixXd>;

/// H of a graph at its states, factorised.
class Gaussian {
 public:
  Gaussian(const Graph& graph, LinearSolver& solver, const char* what) : equations_(graph, solver) {
    auto* determinant = query<LogDeterminant>(solver);
    if (!determinant) throw Error(ErrorCode::usage, "the linear solver does not give determinants");
    if (equations_.size() == 0) return;
    equations_.linearize(graph.values());
    if (const Factorization f = equations_.factorize(); !f.ok)
      throw Error(ErrorCode::numerical, fmt::format("{}: {}", what, equations_.explain(f)));
    log_determinant_ = determinant->log_determinant();
  }
  double log_determinant() const { return log_determinant_; }
  std::int64_t size() const { return equations_.size(); }
  const BlockMatrix& H() const { return equations_.H(); }
  int variable_of(int block) const { return equations_.linearizer().variable_of(block); }

 private:
  NormalEquations equations_;
  double log_determinant_ = 0.0;
};

/// The nodes of `sparse` in `original`.
std::vector<int> partners(const Graph& original, const Graph& sparse) {
  std::vector<int> at;
  for (int v = 0; v < sparse.variable_count(); ++v) {
    const auto there = original.find(sparse.id(v));
    if (!there || original.type(*there).tag() != sparse.type(v).tag())
      throw Error(ErrorCode::input,
                  fmt::format("{} is not in the original graph", sparse.describe_variable(v)));
    at.push_back(*there);
  }
  return at;
}

/// Moves each component of q whose gauge is free, and which is poses of one kind, so that its
/// anchor is where it is in the original: how the whole is placed is no difference of the graphs.
void place_anchors(const Graph& original, const std::vector<int>& partner,
                   const std::vector<int>& anchored, Graph& q) {
  if (anchored.empty()) return;
  std::vector<int> root(q.variable_count());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](int v) {
    while (root[v] != v) v = root[v] = root[root[v]];
    return v;
  };
  for (int f = 0; f < q.factor_count(); ++f) {
    const auto on = q.factor_variables(f);
    for (const int v : on) root[find(v)] = find(on[0]);
  }
  for (const int anchor : anchored) {
    const VariableType& type = q.type(anchor);
    if (!is_pose(type)) continue;
    std::vector<int> component;
    bool alike = true;
    for (int v = 0; v < q.variable_count(); ++v) {
      if (find(v) != find(anchor)) continue;
      component.push_back(v);
      alike = alike && q.type(v).tag() == type.tag();
    }
    if (!alike) continue;
    const StateGroup group(type);
    const std::vector<double> motion =
        group.compose(original.state(partner[anchor]), group.inverse(q.state(anchor)));
    for (const int v : component) q.set_state(v, group.compose(motion, q.state(v)));
  }
}

/// δ_v with sparse = original ⊕ δ, in the tangent of `at`: of the original, or of the sparse graph.
std::vector<Eigen::VectorXd> tangent_shift(const Graph& original, const Graph& sparse,
                                           const std::vector<int>& partner, ComparedAt at) {
  std::vector<Eigen::VectorXd> shift;
  for (int v = 0; v < sparse.variable_count(); ++v) {
    const VariableType& type = sparse.type(v);
    Eigen::VectorXd delta(type.tangent_size());
    const double* p = original.state(partner[v]).data();
    const double* q = sparse.state(v).data();
    // Only its square is needed: from which end it is seen matters, its sign does not.
    type.local(1, at == ComparedAt::common ? p : q, at == ComparedAt::common ? q : p, delta.data());
    shift.push_back(std::move(delta));
  }
  return shift;
}

void measure_positions(const Graph& original, const Graph& sparse, const std::vector<int>& partner,
                       SparsificationError& error) {
  TrajectoryPairs pairs;
  const auto add = [](Trajectory& to, const Graph& graph, int v) {
    const Pose pose = pose_of(graph.type(v), graph.state(v));
    TrajectoryPose& added = to.emplace_back();
    added.id = graph.id(v);
    std::ranges::copy(pose.t, added.t.begin());
    std::ranges::copy(pose.R.reshaped(), added.R.begin());
  };
  for (int v = 0; v < sparse.variable_count(); ++v) {
    if (!has_position(sparse.type(v))) continue;
    add(pairs.truth, original, partner[v]);
    add(pairs.estimate, sparse, v);
  }
  const std::size_t count = pairs.truth.size();
  if (count == 0) {
    error.rmse = error.rmse_aligned = std::numeric_limits<double>::quiet_NaN();
    return;
  }
  const auto rmse = [&](const Pose& motion) {
    double squares = 0.0;
    for (std::size_t k = 0; k < count; ++k) {
      const Eigen::Map<const Eigen::Vector3d> p(pairs.truth[k].t.data());
      const Eigen::Map<const Eigen::Vector3d> q(pairs.estimate[k].t.data());
      squares += (p - motion.R * q - motion.t).squaredNorm();
    }
    return std::sqrt(squares / static_cast<double>(count));
  };
  error.rmse = rmse({});
  error.rmse_aligned = rmse(align(pairs));
}

/// The derivative of position and orientation in the world by the tangent at a state; not square
/// where a type has more or less than these. A pose in the plane turns about z.
Eigen::MatrixXd world_jacobian(const VariableType& type, std::span<const double> x) {
  constexpr double kStep = 1e-5;
  const int n = type.tangent_size(), d = type.placement()->dimension();
  const int turns = !has_orientation(type) ? 0 : d == 2 ? 1 : 3;
  Eigen::MatrixXd J(d + turns, n);
  const Eigen::Matrix3d back = pose_of(type, x).R.transpose();
  std::vector<double> delta(n, 0.0), moved(x.size());
  const auto place = [&](int k, double step) {
    delta[k] = step;
    const std::int64_t offset = 0;
    type.retract(1, x.data(), &offset, delta.data(), moved.data());
    delta[k] = 0.0;
    return pose_of(type, moved);
  };
  for (int k = 0; k < n; ++k) {
    const Pose ahead = place(k, kStep), behind = place(k, -kStep);
    J.col(k).head(d) = (ahead.t - behind.t).head(d) / (2.0 * kStep);
    if (turns == 0) continue;
    const Eigen::Matrix3d A = (ahead.R - behind.R) * back / (2.0 * kStep);  // antisymmetric
    const Eigen::Vector3d axis(0.5 * (A(2, 1) - A(1, 2)), 0.5 * (A(0, 2) - A(2, 0)),
                               0.5 * (A(1, 0) - A(0, 1)));
    J.col(k).tail(turns) = axis.tail(turns);
  }
  return J;
}

/// What takes a node's tangent in the original graph to that in the sparse one so that both are the
/// same motion in the world; the identity for types that are more than a position and an
/// orientation.
Eigen::MatrixXd turn(const VariableType& type, std::span<const double> original,
                     std::span<const double> sparse) {
  const int n = type.tangent_size();
  if (has_position(type)) {
    const Eigen::MatrixXd to = world_jacobian(type, sparse);
    if (to.rows() == n)
      return Eigen::PartialPivLU<Eigen::MatrixXd>(to).solve(world_jacobian(type, original));
  }
  return Eigen::MatrixXd::Identity(n, n);
}

}  // namespace

SparsificationError sparsification_error(const Graph& original, const Graph& as_it_is,
                                         LinearSolver& solver, ComparedAt compared) {
  const std::vector<int> at = partners(original, as_it_is);
  const std::vector<int> anchored = resolve_gauge(as_it_is).anchored;
  Graph sparse = as_it_is.clone();
  place_anchors(original, at, anchored, sparse);
  Graph p = original.clone(), q = sparse.clone();
  for (const int v : anchored) {
    q.set_fixed(v);
    p.set_fixed(at[v]);
  }
  SparsificationError error;
  measure_positions(original, sparse, at, error);
  const std::vector<Eigen::VectorXd> moved = tangent_shift(original, sparse, at, compared);
  std::vector<Eigen::MatrixXd> turns;  // where each graph is linearised at its own states
  if (compared == ComparedAt::common) {
    for (int v = 0; v < q.variable_count(); ++v) q.set_state(v, original.state(at[v]));
  } else {
    for (int v = 0; v < q.variable_count(); ++v)
      turns.push_back(turn(q.type(v), original.state(at[v]), sparse.state(v)));
  }

  // q: Λ̆ and its determinant. Its blocks are kept, since the solver serves three graphs in turn.
  struct Entry {
    int row, column;  ///< variables of q
    Eigen::MatrixXd value;
  };
  std::vector<Entry> entries;
  double log_q = 0.0;
  std::int64_t d = 0;
  {
    const Gaussian sparse_gaussian(q, solver, "the sparse graph");
    log_q = sparse_gaussian.log_determinant();
    d = sparse_gaussian.size();
    if (d == 0) return error;
    const BlockMatrix& H = sparse_gaussian.H();
    const BlockStructure& structure = H.structure();
    for (int c = 0; c < structure.blocks(); ++c) {
      for (auto k = structure.column_begin()[c]; k < structure.column_begin()[c + 1]; ++k) {
        const int r = structure.rows()[k];
        entries.push_back({sparse_gaussian.variable_of(r), sparse_gaussian.variable_of(c),
                           Block(H.block(k), structure.block_size(r), structure.block_size(c))});
      }
    }
  }
  // p: ln |Λ of the kept| = ln |Λ| − ln |Λ_rr|, r those that were taken out.
  double log_p = 0.0;
  {
    Graph removed = p.clone();
    for (const int v : at) removed.set_fixed(v);
    log_p -= Gaussian(removed, solver, "the nodes that were taken out").log_determinant();
  }
  log_p += Gaussian(p, solver, "the original graph").log_determinant();
  GraphMarginals marginals(p, solver);
  if (const Factorization f = marginals.factorize(); !f.ok)
    throw Error(ErrorCode::numerical, marginals.explain(f));
  std::vector<std::pair<int, int>> pairs;
  pairs.reserve(entries.size());
  for (const Entry& entry : entries) pairs.emplace_back(at[entry.row], at[entry.column]);
  const std::vector<double> sigma = marginals.blocks(pairs);
  double trace = 0.0;
  const double* block = sigma.data();
  for (const Entry& entry : entries) {
    const auto rows = entry.value.rows(), columns = entry.value.cols();
    const double twice = entry.row == entry.column ? 1.0 : 2.0;
    Eigen::MatrixXd S = Block(block, rows, columns);
    if (!turns.empty())
      S = dense::product_with_transpose(dense::product(turns[entry.row], S), turns[entry.column]);
    trace += twice * entry.value.cwiseProduct(S).sum();
    error.mean += 0.5 * twice * moved[entry.row].dot(entry.value * moved[entry.column]);
    block += rows * columns;
  }
  for (int v = 0; v < static_cast<int>(std::ssize(turns)); ++v) {
    if (!q.fixed(v))
      log_p -=
          2.0 * std::log(std::abs(Eigen::PartialPivLU<Eigen::MatrixXd>(turns[v]).determinant()));
  }
  error.covariance = 0.5 * (trace - log_q + log_p - static_cast<double>(d));
  error.kld = error.covariance + error.mean;
  return error;
}

}  // namespace cairn
