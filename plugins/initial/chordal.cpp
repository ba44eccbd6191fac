// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <utility>

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "block_problem.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/runtime/error.hpp"
#include "guesses.hpp"
#include "placing.hpp"
#include "relative_poses.hpp"

namespace cairn::initial {
namespace {

/// Orientations first, positions after (Martinec and Pajdla, CVPR 2007; Carlone, Tron, Daniilidis
/// and Dellaert, ICRA 2015), for the poses of one pool in dimension D:
///   min Σ κ_ij ‖R_i Z_ij - R_j‖²_F    without the constraint that R is a rotation, then projected,
///   min Σ ‖t_j - t_i - R_i z_ij‖²_W   with W the information, turned into the world.
/// Measurements that leave a part of the orientation open take no part in the first; where they
/// leave a direction of the translation open the second has t_j ≈ t_i there, with next to no
/// weight. Both are linear. The rows of R_i are the unknowns of the first: with x_i = (row of R_i)ᵀ
/// a term is ‖Z_ijᵀ x_i - x_j‖², so that all rows share one matrix of D × D blocks and are D
/// right-hand sides.
template <int D>
class ChordalPool {
  using Matrix = Eigen::Matrix<double, D, D>;
  using Vector = Eigen::Matrix<double, D, 1>;

 public:
  ChordalPool(Graph& graph, Placing& placing, const Gauge& gauge, int pool, bool unit_weights)
      : graph_(graph),
        placing_(placing),
        type_(*graph.variable_pools()[pool].type),
        placement_(*type_.placement()),
        unit_weights_(unit_weights),
        links_(relative_links(graph, pool, kAngles)),
        points_(cartesian_links(graph, pool)),
        unknown_(static_cast<std::size_t>(graph.variable_count()), kNone),
        R_(graph.variable_pools()[pool].variables.size(), Matrix::Zero()),
        component_(gauge.component),
        origins_(static_cast<std::size_t>(gauge.components), Vector::Zero()) {}

  /// Places all poses that relative factors reach, and points seen from them.
  void compute(LinearSolver& solver, std::vector<std::string>& notes) {
    find_unknown_poses(notes);
    if (count_ == 0) return;
    solve_rotations(solver);
    add_unknown_points();
    solve_translations(solver);
  }

 private:
  static constexpr int kNone = -1;
  static constexpr double kHeld = 1e-8;  // of the weight of what is measured

  Matrix& rotation(int variable) { return R_[static_cast<std::size_t>(graph_.slot(variable))]; }
  std::pair<Matrix, Vector> split(const double* x) const {
    std::pair<Matrix, Vector> result;
    placement_.split(x, result.first.data(), result.second.data());
    return result;
  }
  std::pair<Matrix, Vector> measured(const Link& link) const {
    return split(graph_.measurement(link.factor).data());
  }
  const Vector& origin(int variable) const {
    return origins_[static_cast<std::size_t>(component_[static_cast<std::size_t>(variable)])];
  }
  /// Relative to that.
  Vector position(int variable) const {
    Vector t;
    Matrix unused;
    graph_.type(variable).placement()->split(graph_.state(variable).data(), unused.data(),
                                             t.data());
    return t - origin(variable);
  }

  /// Each piece that relative factors connect needs one pose whose place is known: held, or by a
  /// prior; else its first pose stays where it is. All others are unknown.
  void find_unknown_poses(std::vector<std::string>& notes) {
    std::vector<bool> linked(unknown_.size(), false), reached(unknown_.size(), false);
    std::vector<bool> is_link(static_cast<std::size_t>(graph_.factor_count()), false);
    for (const Link& link : links_)
      linked[link.from] = linked[link.to] = is_link[static_cast<std::size_t>(link.factor)] = true;
    std::vector<int> queue;
    const auto reach = [&](int v) {
      if (reached[v]) return;
      reached[v] = true;
      queue.push_back(v);
    };
    const auto spread = [&] {
      for (; !queue.empty();) {
        const int v = queue.back();
        queue.pop_back();
        for (int f : placing_.factors()[v]) {
          if (!is_link[static_cast<std::size_t>(f)]) continue;
          for (int other : graph_.factor_variables(f)) reach(other);
        }
      }
    };
    bool has_rest = false;
    for (int v = 0; v < graph_.variable_count(); ++v) {
      if (!linked[v] || !placing_.placed(v)) continue;
      has_rest = true;
      reach(v);
    }
    spread();
    std::int64_t kept = 0;
    int first_kept = -1;
    for (int v = 0; v < graph_.variable_count(); ++v) {
      if (!linked[v] || reached[v]) continue;
      if (kept++ == 0) first_kept = v;
      placing_.set_placed(v);
      reach(v);
      spread();
    }
    for (int v = 0; v < graph_.variable_count(); ++v) {
      if (!linked[v]) continue;
      if (placing_.placed(v)) {
        rotation(v) = split(graph_.state(v).data()).first;
        const auto component = static_cast<std::size_t>(component_[v]);
        if (origins_[component].isZero(0.0)) origins_[component] = position(v);
      } else {
        unknown_[v] = count_++;
        variables_.push_back(v);
      }
    }
    if (kept > (has_rest ? 0 : 1)) {
      notes.push_back(counted(kept, "group of poses has", "groups of poses have") +
                      " no relative pose to the rest; the first of each keeps its state (" +
                      graph_.describe_variable(first_kept) + (kept > 1 ? ", …)" : ")"));
    }
  }

  // Rows of the information are in the order of the tangent space, translation first. A factor
  // whose residual has another size says nothing of its parts and gets unit weights.
  static constexpr int kAngles = D * (D - 1) / 2;

  /// The mean of the diagonal of the information of the orientation.
  double rotation_weight(const Link& link) const {
    if (unit_weights_) return 1.0;
    const Eigen::MatrixXd information = information_matrix(graph_, link.factor);
    if (information.rows() != D + kAngles) return 1.0;
    return information.diagonal().template tail<kAngles>().mean();
  }
  Matrix translation_weight(const Link& link) const {
    const Eigen::MatrixXd information = information_matrix(graph_, link.factor);
    if (information.rows() != D + kAngles) return Matrix::Identity();
    return information.template topLeftCorner<D, D>();
  }

  void solve_rotations(LinearSolver& solver) {
    BlockProblem<D, D> problem(count_, pairs(links_));
    for (const Link& link : links_) {
      const int i = unknown_[link.from], j = unknown_[link.to];
      const Matrix Z = measured(link).first;
      const double kappa = rotation_weight(link);
      if (i != kNone) problem.add(i, i, kappa * Matrix::Identity());
      if (j != kNone) problem.add(j, j, kappa * Matrix::Identity());
      if (i != kNone && j != kNone) {
        problem.add(i, j, -kappa * Z);
      } else if (i != kNone) {
        problem.add_right(i, kappa * Z * rotation(link.to).transpose());
      } else if (j != kNone) {
        problem.add_right(j, kappa * Z.transpose() * rotation(link.from).transpose());
      }
    }
    check(problem.solve(solver));
    for (int k = 0; k < count_; ++k)
      rotation(variables_[k]) = nearest_rotation(problem.solution(k).transpose());
  }

  /// The rotation nearest to M in the Frobenius norm.
  static Matrix nearest_rotation(const Matrix& M) {
    const Eigen::JacobiSVD<Matrix> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Matrix U = svd.matrixU();
    if ((U * svd.matrixV().transpose()).determinant() < 0.0) U.col(D - 1) = -U.col(D - 1);
    return U * svd.matrixV().transpose();
  }

  bool has_rotation(int pose) const { return unknown_[pose] != kNone || placing_.placed(pose); }

  /// Points seen from poses whose orientation is known by now. Points that are held only bear
  /// witness.
  void add_unknown_points() {
    std::vector<Link> usable;
    for (const Link& link : points_) {
      if (!has_rotation(link.from)) continue;
      if (unknown_[link.from] == kNone)
        rotation(link.from) = split(graph_.state(link.from).data()).first;
      usable.push_back(link);
      if (unknown_[link.to] != kNone || placing_.placed(link.to)) continue;
      unknown_[link.to] = count_++;
      variables_.push_back(link.to);
    }
    points_ = std::move(usable);
  }

  void solve_translations(LinearSolver& solver) {
    std::vector<Link> all = links_;
    all.insert(all.end(), points_.begin(), points_.end());
    BlockProblem<D, 1> problem(count_, pairs(all));
    for (const Link& link : links_) {
      const auto [Z, z] = measured(link);
      const Matrix R_j =
          rotation(link.from) * Z;  // the error is measured in the frame of the second pose
      const Matrix W = translation_weight(link);
      add_difference(problem, link, R_j * W * R_j.transpose(), rotation(link.from) * z);
      hold_together(problem, link);
    }
    for (const Link& link : points_) {
      const Matrix& R_i = rotation(link.from);
      const Vector z = Eigen::Map<const Vector>(graph_.measurement(link.factor).data());
      const Matrix W = information_matrix(graph_, link.factor);
      add_difference(problem, link, R_i * W * R_i.transpose(), R_i * z);
      hold_together(problem, link);
    }
    check(problem.solve(solver));
    for (int k = 0; k < count_; ++k)
      set_state(variables_[k], problem.solution(k) + origin(variables_[k]));
  }

  /// Where a measurement lacks information: next to no weight on being in one place, or nothing
  /// would determine what only such measurements reach.
  void hold_together(BlockProblem<D, 1>& problem, const Link& link) {
    if (graph_.information_rank(link.factor) == graph_.factor_type(link.factor).residual_size())
      return;
    const double mean = information_matrix(graph_, link.factor).diagonal().mean();
    add_difference(problem, link, Matrix(kHeld * mean * Matrix::Identity()), Vector::Zero());
  }

  /// ‖t_j - t_i - d‖²_W.
  void add_difference(BlockProblem<D, 1>& problem, const Link& link, const Matrix& W,
                      const Vector& d) {
    const int i = unknown_[link.from], j = unknown_[link.to];
    if (i != kNone) {
      problem.add(i, i, W);
      problem.add_right(i, W * ((j == kNone ? position(link.to) : Vector::Zero().eval()) - d));
    }
    if (j != kNone) {
      problem.add(j, j, W);
      problem.add_right(j, W * ((i == kNone ? position(link.from) : Vector::Zero().eval()) + d));
    }
    if (i != kNone && j != kNone) problem.add(i, j, -W);
  }

  void set_state(int variable, const Vector& t) {
    const VariableType& type = graph_.type(variable);
    std::vector<double> x(static_cast<std::size_t>(type.ambient_size()));
    const double* R = has_orientation(type) ? rotation(variable).data() : nullptr;
    type.placement()->join(R, t.data(), x.data());
    graph_.set_state(variable, x);
    placing_.set_placed(variable);
  }

  std::vector<std::pair<std::int32_t, std::int32_t>> pairs(const std::vector<Link>& links) const {
    std::vector<std::pair<std::int32_t, std::int32_t>> result;
    result.reserve(links.size());
    for (const Link& link : links) {
      const int i = unknown_[link.from], j = unknown_[link.to];
      if (i != kNone && j != kNone) result.emplace_back(i, j);
    }
    return result;
  }

  void check(const Factorization& result) const {
    if (result.ok) return;
    const std::string where =
        result.failed_block >= 0 && result.failed_block < count_
            ? " at " + graph_.describe_variable(
                           variables_[static_cast<std::size_t>(result.failed_block)])
            : "";
    throw Error(ErrorCode::numerical,
                "initial guess chordal: its linear system is not positive definite" + where +
                    "; the information of the factors there may differ too much in size: try "
                    "weight=unit, another linear_solver, or the guess spanning_tree");
  }

  Graph& graph_;
  Placing& placing_;
  const VariableType& type_;
  const Placement& placement_;
  bool unit_weights_;
  std::vector<Link> links_, points_;
  std::vector<int> unknown_;    // by variable: its place among the unknowns
  std::vector<int> variables_;  // and back
  int count_ = 0;
  std::vector<Matrix> R_;  // by slot of the pool
  // The linear system is that of positions relative to a pose that is placed, of each component.
  std::vector<int> component_;  // by variable
  std::vector<Vector> origins_;
};

class Chordal final : public InitialGuess {
 public:
  Chordal(bool unit_weights, std::unique_ptr<LinearSolver> solver)
      : unit_weights_(unit_weights), solver_(std::move(solver)) {}

  std::vector<std::string> compute(Graph& graph) override {
    std::vector<std::string> notes;
    Placing placing(graph);
    const Gauge gauge = resolve_gauge(graph);
    placing.place_roots(gauge);
    for (std::size_t pool = 0; pool < graph.variable_pools().size(); ++pool) {
      const VariableType& type = *graph.variable_pools()[pool].type;
      if (!has_orientation(type)) continue;
      if (type.placement()->dimension() == 2) {
        compute_pool<2>(graph, placing, gauge, static_cast<int>(pool), notes);
      } else {
        compute_pool<3>(graph, placing, gauge, static_cast<int>(pool), notes);
      }
    }
    placing.spread();
    placing.finish(notes);
    return notes;
  }

 private:
  template <int D>
  void compute_pool(Graph& graph, Placing& placing, const Gauge& gauge, int pool,
                    std::vector<std::string>& notes) {
    ChordalPool<D>(graph, placing, gauge, pool, unit_weights_).compute(*solver_, notes);
  }

  bool unit_weights_;
  std::unique_ptr<LinearSolver> solver_;
};

}  // namespace

std::unique_ptr<InitialGuess> make_chordal(const ChordalOptions& options,
                                           std::unique_ptr<LinearSolver> solver) {
  return std::make_unique<Chordal>(options.weight == ChordalWeight::unit, std::move(solver));
}

}  // namespace cairn::initial
