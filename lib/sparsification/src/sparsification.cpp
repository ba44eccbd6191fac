// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/sparsification.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Core>

#include "cairn/geometry/motion.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/linear/graph_marginals.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/linear/normal_equations.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {

Topology::~Topology() = default;
FactorRecovery::~FactorRecovery() = default;
Sparsifier::~Sparsifier() = default;
NodeSelection::~NodeSelection() = default;

int DenseBlanket::size() const { return std::accumulate(node_sizes.begin(), node_sizes.end(), 0); }

SparsificationSeconds& SparsificationSeconds::operator+=(const SparsificationSeconds& other) {
  total += other.total;
  marginalize += other.marginalize;
  topology += other.topology;
  recovery += other.recovery;
  return *this;
}

void Sparsification::add(const Sparsification& later) {
  const int all = problems + later.problems;
  if (all > 0) mean_blanket = (problems * mean_blanket + later.problems * later.mean_blanket) / all;
  problems = all;
  largest_blanket = std::max(largest_blanket, later.largest_blanket);
  refused.insert(refused.end(), later.refused.begin(), later.refused.end());
  kld += later.kld;
  not_converged += later.not_converged;
  seconds += later.seconds;
}

void apply(const Sparsification& change, Graph& graph) {
  std::vector<bool> factors(graph.factor_count()), variables(graph.variable_count());
  for (const int f : change.removed_factors) factors[f] = true;
  for (const int v : change.removed_variables) variables[v] = true;
  graph.remove(factors, variables);
  for (const Factor& factor : change.factors) {
    std::vector<int> on;
    for (const Id id : factor.variables) on.push_back(graph.find(id).value());
    graph.add_factor(factor.type, on, factor.measurement, factor.information);
  }
}

// Redirection -------------------------------------------------------------------------------------

namespace {

struct Point {
  int variable;
  Eigen::Vector3d t;  ///< what is near is near in these
};

/// The point nearest to t; -1: there is none.
int nearest(const std::vector<Point>& points, const Eigen::Vector3d& t) {
  int best = -1;
  double least = std::numeric_limits<double>::infinity();
  for (const Point& point : points) {
    double squares = 0.0;
    for (int k = 0; k < 3; ++k) squares += (point.t[k] - t[k]) * (point.t[k] - t[k]);
    if (squares < least) {
      least = squares;
      best = point.variable;
    }
  }
  return best;
}

}  // namespace

void Redirection::leave(const Graph& graph, std::span<const int> nodes, std::span<const int> also) {
  std::vector<bool> leaving(graph.variable_count());
  for (const int v : nodes) leaving[v] = true;
  for (const int v : also) leaving[v] = true;
  const auto where = [&](const VariableType& type, Id id, std::span<const double> x) {
    if (nearest_ == Nearest::order) return Eigen::Vector3d(static_cast<double>(id), 0.0, 0.0);
    return has_position(type) ? position(type, x) : Eigen::Vector3d(0.0, 0.0, 0.0);
  };
  std::unordered_map<std::string_view, std::vector<Point>> points;
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (!leaving[v] && graph.type(v).lie_group())
      points[graph.type(v).tag()].push_back({v, where(graph.type(v), graph.id(v), graph.state(v))});
  }
  const auto move = [&](Id id, std::shared_ptr<const VariableType> type,
                        std::span<const double> x) {
    Place place{.type = std::move(type), .motion = {}};
    const int to = nearest(points[place.type->tag()], where(*place.type, id, x));
    place.lost = to < 0;
    if (!place.lost) {
      place.anchor = graph.id(to);
      const LieGroup& group = *place.type->lie_group();
      std::vector<double> back(x.size());
      place.motion.resize(x.size());
      group.inverse(graph.state(to).data(), back.data());
      group.compose(back.data(), x.data(), place.motion.data());
    }
    at_.insert_or_assign(id, std::move(place));
  };
  std::vector<Id> follow;
  for (const auto& [id, place] : at_) {
    const auto anchor = graph.find(place.anchor);
    if (!place.lost && anchor && leaving[*anchor]) follow.push_back(id);
  }
  for (const Id id : follow) {
    const Place place = at_.at(id);
    move(id, place.type, state(id, graph.state(graph.find(place.anchor).value())));
  }
  for (const int v : nodes) {
    if (graph.type(v).lie_group()) move(graph.id(v), graph.type_of(v), graph.state(v));
  }
}

std::vector<double> Redirection::state(Id node, std::span<const double> anchor) const {
  const Place& place = at_.at(node);
  std::vector<double> x(anchor.size());
  place.type->lie_group()->compose(anchor.data(), place.motion.data(), x.data());
  return x;
}

std::optional<Factor> Redirection::redirect(const Factor& factor) const {
  if (std::ranges::none_of(factor.variables, [&](Id id) { return has(id); })) return factor;
  if (factor.variables.size() != 2 || !factor.type->is_relative()) return std::nullopt;
  std::vector<Id> ends = factor.variables;
  const Place& any = at_.at(has(ends[0]) ? ends[0] : ends[1]);
  const MotionGroup motions(any.type);
  const auto n = static_cast<std::size_t>(motions.tangent_size());
  Motion z = motions.of_factor(*factor.type, factor.measurement, factor.information);
  for (int end = 0; end < 2; ++end) {
    if (!has(ends[end])) continue;
    const Place& place = at_.at(ends[end]);
    if (place.lost) return std::nullopt;
    const Motion from_anchor{place.motion, std::vector<double>(n * n, 0.0)};
    z = end == 0 ? motions.compose(from_anchor, z)
                 : motions.compose(z, motions.inverse(from_anchor));
    ends[end] = place.anchor;
  }
  if (ends[0] == ends[1]) return std::nullopt;
  return motions.to_factor(factor.type, ends[0], ends[1], z);
}

// Measures ----------------------------------------------------------------------------------------

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

/// δ_v with sparse = original ⊕ δ, a node's tangent after the other's; and the RMS of positions.
struct Shift {
  std::vector<Eigen::VectorXd> tangent;
  double rmse = 0.0;
};

Shift shift(const Graph& original, const Graph& sparse, const std::vector<int>& at) {
  Shift result;
  double squares = 0.0;
  int positions = 0;
  for (int v = 0; v < sparse.variable_count(); ++v) {
    const VariableType& type = sparse.type(v);
    Eigen::VectorXd delta(type.tangent_size());
    // Both are seen from q, whose H it is multiplied with.
    type.local(1, sparse.state(v).data(), original.state(at[v]).data(), delta.data());
    result.tangent.push_back(std::move(delta));
    if (!has_position(type)) continue;
    const Eigen::Vector3d p = position(type, original.state(at[v]));
    const Eigen::Vector3d q = position(type, sparse.state(v));
    for (int k = 0; k < 3; ++k) squares += (p[k] - q[k]) * (p[k] - q[k]);
    ++positions;
  }
  result.rmse =
      positions > 0 ? std::sqrt(squares / positions) : std::numeric_limits<double>::quiet_NaN();
  return result;
}

}  // namespace

SparsificationError sparsification_error(const Graph& original, const Graph& sparse,
                                         LinearSolver& solver) {
  const std::vector<int> at = partners(original, sparse);
  Graph p = original.clone(), q = sparse.clone();
  for (const int v : resolve_gauge(sparse).anchored) {
    q.set_fixed(v);
    p.set_fixed(at[v]);
  }
  SparsificationError error;
  const Shift moved = shift(original, sparse, at);
  error.rmse = moved.rmse;

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
    trace += twice * entry.value.cwiseProduct(Block(block, rows, columns)).sum();
    error.mean +=
        0.5 * twice * moved.tangent[entry.row].dot(entry.value * moved.tangent[entry.column]);
    block += rows * columns;
  }
  error.covariance = 0.5 * (trace - log_q + log_p - static_cast<double>(d));
  error.kld = error.covariance + error.mean;
  return error;
}

}  // namespace cairn
