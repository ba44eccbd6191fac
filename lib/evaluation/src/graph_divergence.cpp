// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/graph_divergence.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <Eigen/Core>

#include "cairn/evaluation/trajectory.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/geometry/state_group.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/information/gaussian.hpp"
#include "cairn/information/graph_information.hpp"
#include "cairn/linear/graph_marginals.hpp"
#include "cairn/linear/normal_equations.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/result_fields.hpp"
#include "conservative_margin.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"

namespace cairn {
namespace {

using Block = Eigen::Map<const Eigen::MatrixXd>;

/// A divergence is not negative; by rounding it may be, by so much of each unknown [nats].
constexpr double kRounding = 1e-6;

LogDeterminant& determinant_of(LinearSolver& solver) {
  if (auto* determinant = query<LogDeterminant>(solver)) return *determinant;
  throw Error(ErrorCode::usage, "the linear solver does not give determinants");
}

void factorize(GraphMarginals& marginals, const char* what) {
  if (const Factorization f = marginals.factorize(); !f.ok)
    throw Error(ErrorCode::numerical, fmt::format("{}: {}", what, marginals.explain(f)));
}

/// ln |H| of a graph at its states.
double log_determinant(const Graph& graph, LinearSolver& solver, const char* what) {
  NormalEquations equations(graph, solver);
  if (equations.size() == 0) return 0.0;
  equations.linearize(graph.values());
  if (const Factorization f = equations.factorize(); !f.ok)
    throw Error(ErrorCode::numerical, fmt::format("{}: {}", what, equations.explain(f)));
  return determinant_of(solver).log_determinant();
}

/// That of `graph` which is variable `v` of `other`.
int partner(const Graph& graph, const Graph& other, int v, const char* what) {
  const auto there = graph.find(other.id(v));
  if (!there || graph.type(*there).tag() != other.type(v).tag()) {
    throw Error(ErrorCode::input,
                fmt::format("{} is not in the {} graph", other.describe_variable(v), what));
  }
  return *there;
}

/// By variable of `q` its partner in `p`, or -1 where it is not compared.
using Partners = std::vector<int>;

/// What is anchored in `q`, by number. Only a node that is compared can be anchored in both graphs:
/// where the first pose of a component is not, the first is that is.
std::vector<int> anchors(const Graph& q, const Gauge& gauge, const Partners& at) {
  std::vector<int> all;
  for (const int first : gauge.anchored) {
    int anchor = at[first] >= 0 ? first : -1, compared = -1;
    for (int v = 0; v < q.variable_count() && anchor < 0; ++v) {
      if (gauge.component[v] != gauge.component[first] || at[v] < 0) continue;
      compared = v;
      if (q.type(v).tag() == q.type(first).tag()) anchor = v;
    }
    if (anchor < 0 && compared >= 0) {
      throw Error(ErrorCode::input,
                  fmt::format("the gauge of {} is free, and no pose of its component is compared: "
                              "fix a pose in both graphs",
                              q.describe_variable(compared)));
    }
    if (anchor >= 0) all.push_back(anchor);
  }
  return all;
}

/// Poses of `q` that no factor is left on, where `p` has no more than them of a component whose
/// gauge is free: neither graph says where they are, so they are constant in both.
std::vector<int> lone_anchors(const Graph& p, const Graph& q, const Gauge& gauge,
                              const Partners& at) {
  std::vector<int> alone;
  for (const int v : gauge.unconstrained) {
    if (at[v] >= 0 && !q.fixed(v) && q.type(v).lie_group()) alone.push_back(v);
  }
  if (alone.empty()) return alone;
  const Gauge of_p = resolve_gauge(p);
  std::vector<int> compared(of_p.components, 0);  // by component of p
  for (const int v : at) {
    if (v >= 0) ++compared[of_p.component[v]];
  }
  std::vector<bool> is_free(of_p.components, false);
  for (const int v : of_p.anchored) is_free[of_p.component[v]] = true;
  std::erase_if(alone, [&](int v) {
    const int component = of_p.component[at[v]];
    return !is_free[component] || compared[component] > 1;
  });
  return alone;
}

/// Moves each component of q whose gauge is free, and which is poses of one kind, so that its
/// anchor is where it is in p: how the whole is placed is no difference of the graphs.
void place_anchors(const Graph& p, const Partners& at, const std::vector<int>& component,
                   const std::vector<int>& anchored, Graph& q) {
  for (const int anchor : anchored) {
    const VariableType& type = q.type(anchor);
    if (!is_pose(type)) continue;
    std::vector<int> along;
    bool alike = true;
    for (int v = 0; v < q.variable_count(); ++v) {
      if (component[v] != component[anchor]) continue;
      along.push_back(v);
      alike = alike && q.type(v).tag() == type.tag();
    }
    if (!alike) continue;
    const StateGroup group(type);
    const std::vector<double> motion =
        group.compose(p.state(at[anchor]), group.inverse(q.state(anchor)));
    for (const int v : along) q.set_state(v, group.compose(motion, q.state(v)));
  }
}

/// δ_v with sparse = original ⊕ δ, in the tangent of `at`: of the original, or of the sparse graph.
std::vector<Eigen::VectorXd> tangent_shift(const Graph& original, const Graph& sparse,
                                           const Partners& partner, ComparedAt at) {
  std::vector<Eigen::VectorXd> shift(sparse.variable_count());
  for (int v = 0; v < sparse.variable_count(); ++v) {
    if (partner[v] < 0) continue;
    const VariableType& type = sparse.type(v);
    Eigen::VectorXd delta(type.tangent_size());
    const double* p = original.state(partner[v]).data();
    const double* q = sparse.state(v).data();
    // Only its square is needed: from which end it is seen matters, its sign does not.
    type.local(1, at == ComparedAt::common ? p : q, at == ComparedAt::common ? q : p, delta.data());
    shift[v] = std::move(delta);
  }
  return shift;
}

void measure_positions(const Graph& original, const Graph& sparse, const Partners& partner,
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
    if (partner[v] < 0 || !has_position(sparse.type(v))) continue;
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

/// Two graphs with the same variables constant, q moved to where p is.
struct Comparison {
  Graph p, q;
  Partners at;
  std::vector<Eigen::VectorXd> moved;  ///< by variable of q
  std::vector<Eigen::MatrixXd> turns;  ///< likewise, where each is linearised at its own states
  SparsificationError error;           ///< of positions
};

void check_constant(const Graph& p, const Graph& q, const Partners& at) {
  const std::vector<bool> held_p = resolve_gauge(p).held, held_q = resolve_gauge(q).held;
  for (int v = 0; v < q.variable_count(); ++v) {
    if (at[v] < 0 || held_p[at[v]] == held_q[v]) continue;
    throw Error(ErrorCode::input,
                fmt::format("{} is constant in one of the graphs and free in the other: a "
                            "divergence is defined where the same variables are fixed in both",
                            q.describe_variable(v)));
  }
}

Comparison comparison(const Graph& p, const Graph& q, Partners partners, ComparedAt compared) {
  Comparison c{p.clone(), q.clone(), std::move(partners), {}, {}, {}};
  const Gauge gauge = resolve_gauge(q);
  std::vector<int> anchored = anchors(q, gauge, c.at);
  const std::vector<int> alone = lone_anchors(p, q, gauge, c.at);
  anchored.insert(anchored.end(), alone.begin(), alone.end());
  place_anchors(p, c.at, gauge.component, anchored, c.q);
  for (const int v : anchored) {
    c.q.set_fixed(v);
    c.p.set_fixed(c.at[v]);
  }
  check_constant(c.p, c.q, c.at);
  measure_positions(p, c.q, c.at, c.error);
  c.moved = tangent_shift(p, c.q, c.at, compared);
  if (compared == ComparedAt::minima) c.turns.resize(q.variable_count());
  for (int v = 0; v < q.variable_count(); ++v) {
    if (c.at[v] < 0) continue;
    if (compared == ComparedAt::common) {
      c.q.set_state(v, p.state(c.at[v]));
    } else {
      c.turns[v] = turn(q.type(v), p.state(c.at[v]), c.q.state(v));
    }
  }
  return c;
}

/// Σ of these variables, all of which are free.
Eigen::MatrixXd covariance_of(const Graph& graph, const std::vector<int>& variables,
                              LinearSolver& solver, const char* what) {
  GraphMarginals marginals(graph, solver);
  factorize(marginals, what);
  return joint_covariance(graph, marginals, variables);
}

}  // namespace

SparsificationError sparsification_error(const Graph& original, const Graph& as_it_is,
                                         LinearSolver& solver, ComparedAt compared) {
  Partners partners;
  for (int v = 0; v < as_it_is.variable_count(); ++v)
    partners.push_back(partner(original, as_it_is, v, "original"));
  Comparison both = comparison(original, as_it_is, std::move(partners), compared);
  const Graph &p = both.p, &q = both.q;
  const Partners& at = both.at;
  const std::vector<Eigen::VectorXd>& moved = both.moved;
  const std::vector<Eigen::MatrixXd>& turns = both.turns;
  SparsificationError& error = both.error;

  // q: Λ̆ and its determinant. Its blocks are kept, since the solver serves three graphs in turn.
  struct Entry {
    int row, column;  ///< variables of q
    Eigen::MatrixXd value;
  };
  std::vector<Entry> entries;
  double log_q = 0.0;
  std::int64_t d = 0;
  {
    GraphMarginals of_sparse(q, solver);
    d = of_sparse.size();
    if (d == 0) return error;
    factorize(of_sparse, "the sparse graph");
    log_q = determinant_of(solver).log_determinant();
    const NormalEquations& equations = of_sparse.equations();
    const Linearizer& linearizer = equations.linearizer();
    const BlockMatrix& H = equations.H();
    const BlockStructure& structure = H.structure();
    for (int c = 0; c < structure.blocks(); ++c) {
      for (auto k = structure.column_begin()[c]; k < structure.column_begin()[c + 1]; ++k) {
        const int r = structure.rows()[k];
        entries.push_back({linearizer.variable_of(r), linearizer.variable_of(c),
                           Block(H.block(k), structure.block_size(r), structure.block_size(c))});
      }
    }
  }
  // p: ln |Λ of the kept| = ln |Λ| − ln |Λ_rr|, r those that were taken out.
  double log_p = 0.0;
  {
    Graph removed = p.clone();
    for (const int v : at) removed.set_fixed(v);
    log_p -= log_determinant(removed, solver, "the nodes that were taken out");
  }
  GraphMarginals marginals(p, solver);
  factorize(marginals, "the original graph");
  if (marginals.size() > 0) log_p += determinant_of(solver).log_determinant();
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
  if (error.covariance < -kRounding * static_cast<double>(d)) {
    throw Error(ErrorCode::numerical,
                fmt::format("the divergence is {:.3g}, which is rounding: information differs too "
                            "much in size",
                            error.covariance));
  }
  return error;
}

double conservative_margin(const Graph& original, const Graph& sparse, LinearSolver& solver) {
  Partners partners;
  for (int v = 0; v < sparse.variable_count(); ++v)
    partners.push_back(partner(original, sparse, v, "original"));
  const Comparison both = comparison(original, sparse, std::move(partners), ComparedAt::common);
  return least_eigenvalue_of_difference(both.p, both.q, both.at, solver);
}

SparsificationError marginal_divergence(const Graph& p, const Graph& q, std::span<const Id> nodes,
                                        LinearSolver& solver, ComparedAt compared) {
  Partners partners(q.variable_count(), -1);
  for (const Id node : nodes) {
    const auto v = q.find(node);
    if (!v) throw Error(ErrorCode::input, fmt::format("{} is not in the second graph", node));
    partners[*v] = partner(p, q, *v, "first");
  }
  const Comparison both = comparison(p, q, std::move(partners), compared);
  const std::vector<bool> held = resolve_gauge(both.q).held;
  std::vector<int> in_p, in_q;
  Eigen::Index size = 0;
  for (int v = 0; v < both.q.variable_count(); ++v) {
    if (both.at[v] < 0 || held[v]) continue;
    in_p.push_back(both.at[v]);
    in_q.push_back(v);
    size += both.q.type(v).tangent_size();
  }
  if (size > kMostDenseSize) {
    throw Error(ErrorCode::input,
                fmt::format("the nodes of both graphs have {} coordinates, and their dense joint "
                            "covariance may have {}; where one graph has all nodes of the other, "
                            "none is needed",
                            size, kMostDenseSize));
  }
  if (size == 0) return both.error;
  Gaussian of_q{Eigen::VectorXd(size), covariance_of(both.q, in_q, solver, "the second graph")};
  Gaussian of_p{Eigen::VectorXd::Zero(size),
                covariance_of(both.p, in_p, solver, "the first graph")};
  Eigen::Index row = 0;
  for (const int v : in_q) {
    const auto n = both.q.type(v).tangent_size();
    of_q.mean.segment(row, n) = both.moved[v];
    if (!both.turns.empty()) {  // T Σ Tᵀ, by its rows and columns
      of_p.covariance.middleRows(row, n) =
          dense::product(both.turns[v], of_p.covariance.middleRows(row, n));
      of_p.covariance.middleCols(row, n) =
          dense::product_with_transpose(of_p.covariance.middleCols(row, n), both.turns[v]);
    }
    row += n;
  }
  const Divergence divergence = kullback_leibler(of_p, of_q);
  SparsificationError error = both.error;
  error.covariance = divergence.covariance;
  error.mean = divergence.mean;
  error.kld = divergence.total();
  return error;
}

ResultFields<SparsificationError> SparsificationError::fields() {
  using E = SparsificationError;
  return ResultFields<E>()
      .figure("kld", &E::kld, "nats",
              "divergence of the sparse graph from the original one, of the variables of both")
      .figure("rmse", &E::rmse, "m", "by how much positions have moved")
      .round("{:.3g}")
      .figure("rmse_aligned", &E::rmse_aligned, "m", "the same after alignment")
      .round("{:.3g}")
      .figure("kld_parts.covariance", &E::covariance, "nats",
              "the part of the divergence that is of covariances")
      .figure("kld_parts.mean", &E::mean, "nats", "and that of means")
      .details();
}

}  // namespace cairn
