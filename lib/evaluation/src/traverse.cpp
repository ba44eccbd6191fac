// SPDX-License-Identifier: BSD-3-Clause
#include "traverse.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>

#include <fmt/core.h>
#include <Eigen/Geometry>

#include "cairn/evaluation/plausibility.hpp"
#include "cairn/geometry/pose.hpp"
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"

namespace cairn {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using State = std::vector<double>;

std::vector<int> Traverse::factors() const {
  std::vector<int> all = closing;
  for (const Step& step : steps) {
    if (step.factor >= 0 && !std::ranges::binary_search(known, step.variable))
      all.push_back(step.factor);
  }
  std::ranges::sort(all);
  return all;
}

bool Misclosure::is_plausible() const { return chi2 <= kImplausibleChi2 * freedoms; }

double Misclosure::chi2_after(int v, const VectorXd& delta) const {
  const VectorXd moved = b + dense::product(A.at(v), delta);
  return moved.dot(dense::product(P, moved).col(0));
}

namespace {

constexpr int kMostIterations = 50;
constexpr double kSettled = 1e-4;                // of chi2, from one iteration to the next
constexpr double kQuarter = 1.5707963267948966;  // of a turn
constexpr double kFlat = 1e-9;  // of the eigenvalues of a matrix that is scaled to unit diagonal

/// A⁺ of a positive semidefinite matrix, and its rank.
std::pair<MatrixXd, int> pseudo_inverse(const MatrixXd& A) {
  VectorXd scale = A.diagonal().cwiseSqrt();
  for (double& s : scale) s = s > 0.0 ? 1.0 / s : 0.0;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> of(
      MatrixXd(scale.asDiagonal() * A * scale.asDiagonal()));
  VectorXd inverse = of.eigenvalues();
  int rank = 0;
  for (double& value : inverse) {
    rank += value > kFlat;
    value = value > kFlat ? 1.0 / value : 0.0;
  }
  const MatrixXd scaled = dense::from_eigenvalues(of.eigenvectors(), inverse);
  return {scale.asDiagonal() * scaled * scale.asDiagonal(), rank};
}

/// All rotations by which a cube comes to lie on itself, or eight in the plane.
std::vector<Eigen::Matrix3d> turns(int dimension) {
  std::vector<Eigen::Matrix3d> all;
  const auto about = [](int axis, double angle) {
    return Eigen::AngleAxisd(angle, Eigen::Vector3d::Unit(axis)).matrix();
  };
  if (dimension == 2) {
    for (int k = 0; k < 8; ++k) all.push_back(about(2, k * kQuarter / 2));
    return all;
  }
  for (int k = 0; k < 4; ++k) {
    const Eigen::Matrix3d R = about(2, k * kQuarter);
    for (int face = 0; face < 4; ++face) all.push_back(about(1, face * kQuarter) * R);
    for (const double sign : {-1.0, 1.0}) all.push_back(about(0, sign * kQuarter) * R);
  }
  return all;
}

/// The least-squares problem of a traverse, its unknowns being the noise of each step and the state
/// of what is loose: all residuals but those of the closing factors are noise.
class TraverseProblem {
 public:
  TraverseProblem(const Graph& graph, const Traverse& traverse)
      : graph_(graph), traverse_(traverse), noise_(traverse.steps.size()) {
    for (std::size_t k = 0; k < traverse.steps.size(); ++k) {
      const int v = traverse.steps[k].variable;
      step_of_[v] = k;
      const auto x = graph.state(v);
      states_.emplace_back(x.begin(), x.end());
    }
    for (const int f : traverse.closing) {
      rows_ += graph.factor_type(f).residual_size();
      rank_ += graph.information_rank(f);
    }
  }

  Misclosure solve() {
    Misclosure best;
    best.chi2 = std::numeric_limits<double>::infinity();
    try_from_here(best);
    if (traverse_.loose < 0 || best.is_plausible()) return best;
    for (const State& start : starts()) {
      states_[step_of_[traverse_.loose]] = start;
      try_from_here(best);
      if (best.is_plausible()) break;
    }
    return best;
  }

 private:
  void try_from_here(Misclosure& best) {
    if (!linearize()) return;
    const bool is_plain = traverse_.loose < 0 && promised_ <= kImplausibleChi2 * freedoms_;
    const double chi2 = is_plain ? promised_ : minimize();
    noise_.assign(noise_.size(), {});
    if (linearize() && chi2 < best.chi2) best = described(chi2);
  }

  struct Evaluated {
    VectorXd r;
    std::vector<MatrixXd> J;
  };
  Evaluated evaluate(int f) const {
    const FactorType& type = graph_.factor_type(f);
    Evaluated at{VectorXd(type.residual_size()), {}};
    std::vector<const double*> x;
    std::vector<double*> jacobians;
    for (const int v : graph_.factor_variables(f)) {
      x.push_back(states_[step_of_.at(v)].data());
      at.J.emplace_back(type.residual_size(), graph_.type(v).tangent_size());
    }
    for (MatrixXd& J : at.J) jacobians.push_back(J.data());
    type.evaluate(x.data(), graph_.measurement(f).data(), graph_.sqrt_information(f).data(),
                  at.r.data(), jacobians.data());
    return at;
  }
  static std::size_t end_of(std::span<const std::int32_t> variables, int v) {
    return static_cast<std::size_t>(std::ranges::find(variables, v) - variables.begin());
  }
  void move(std::size_t k, const VectorXd& delta) {
    constexpr std::int64_t kOffset = 0;
    graph_.type(traverse_.steps[k].variable)
        .retract(1, states_[k].data(), &kOffset, delta.data(), states_[k].data());
  }

  /// Places the variable of a step so that the residual of its factor is the noise of that.
  bool place(std::size_t k) {
    constexpr int kMost = 10;
    constexpr double kClose = 1e-9;
    const auto [v, f] = traverse_.steps[k];
    const auto variables = graph_.factor_variables(f);
    std::vector<const double*> x;
    for (const int w : variables) x.push_back(states_[step_of_.at(w)].data());
    const std::size_t end = end_of(variables, v);
    State there(states_[k].size());
    if (!graph_.factor_type(f).propagate(static_cast<int>(end), x.data(),
                                         graph_.measurement(f).data(), there.data()))
      return false;
    states_[k] = std::move(there);
    if (noise_[k].size() == 0) return true;
    for (int iteration = 0; iteration < kMost; ++iteration) {
      const Evaluated at = evaluate(f);
      const VectorXd short_of = noise_[k] - at.r;
      if (short_of.norm() <= kClose * (1.0 + noise_[k].norm())) return true;
      move(k, Eigen::PartialPivLU<MatrixXd>(at.J[end]).solve(short_of));
    }
    return false;
  }

  /// Places all, and computes by going back what the closing residual depends on. False where that
  /// is not finite.
  bool linearize() {
    std::vector<MatrixXd> by_state(states_.size());
    for (std::size_t k = 0; k < states_.size(); ++k) {
      if (traverse_.steps[k].factor >= 0 && !place(k)) return false;
      by_state[k] = MatrixXd::Zero(rows_, graph_.type(traverse_.steps[k].variable).tangent_size());
    }
    b_.resize(rows_);
    Eigen::Index row = 0;
    for (const int f : traverse_.closing) {
      const Evaluated at = evaluate(f);
      const auto variables = graph_.factor_variables(f);
      b_.segment(row, at.r.size()) = at.r;
      for (std::size_t end = 0; end < at.J.size(); ++end)
        by_state[step_of_.at(variables[end])].middleRows(row, at.r.size()) += at.J[end];
      row += at.r.size();
    }
    chi2_ = b_.squaredNorm();
    for (const VectorXd& noise : noise_) chi2_ += noise.squaredNorm();
    MatrixXd S = MatrixXd::Identity(rows_, rows_);
    by_noise_.assign(states_.size(), {});
    known_.clear();
    for (std::size_t k = states_.size(); k-- > 0;) {
      const auto [v, f] = traverse_.steps[k];
      if (std::ranges::binary_search(traverse_.known, v)) known_[v] = by_state[k];
      if (f < 0) continue;
      const Evaluated at = evaluate(f);
      const auto variables = graph_.factor_variables(f);
      const std::size_t own = end_of(variables, v);
      const Eigen::PartialPivLU<MatrixXd> lu(MatrixXd(at.J[own].transpose()));
      by_noise_[k] = lu.solve(MatrixXd(by_state[k].transpose())).transpose();
      dense::add_product_with_transpose(by_noise_[k], by_noise_[k], S);
      if (noise_[k].size() > 0) b_ -= by_noise_[k] * noise_[k];
      for (std::size_t end = 0; end < at.J.size(); ++end) {
        if (end != own)
          dense::subtract_product(by_noise_[k], at.J[end], by_state[step_of_.at(variables[end])]);
      }
    }
    return std::isfinite(chi2_) && eliminate(S, by_state);
  }

  bool eliminate(const MatrixXd& S, const std::vector<MatrixXd>& by_state) {
    const Eigen::LLT<MatrixXd> llt(S);
    if (llt.info() != Eigen::Success || !S.allFinite()) return false;
    P_ = llt.solve(MatrixXd::Identity(rows_, rows_));
    promised_ = b_.dot(P_ * b_);
    freedoms_ = rank_;
    if (traverse_.loose < 0) return true;
    const MatrixXd& A = by_state[step_of_[traverse_.loose]];
    const MatrixXd H = dense::congruent_of_transpose(A, P_), PA = dense::product(P_, A);
    if (!H.allFinite()) return false;
    const auto [inverse, rank] = pseudo_inverse(H);
    step_ = -(inverse * VectorXd(PA.transpose() * b_));
    P_ -= dense::congruent(PA, inverse);
    promised_ = b_.dot(P_ * b_);
    freedoms_ -= rank;
    return true;
  }

  /// Gauss-Newton, with shorter steps where these lead up, for the noise of all steps and what is
  /// loose. Returns the least chi2, or where it does not come there a lower one.
  double minimize() {
    constexpr int kMostHalvings = 12;
    for (int iteration = 0; iteration < kMostIterations; ++iteration) {
      const double before = chi2_, promised = promised_;
      if (before - promised <= kSettled * (1.0 + before)) return before;
      const std::vector<State> states = states_;
      const std::vector<VectorXd> noise = noise_, toward = best_noise();
      const VectorXd step = step_;
      double part = 1.0;
      for (int halving = 0;; ++halving, part *= 0.5) {
        if (halving == kMostHalvings) return promised;
        states_ = states;
        if (traverse_.loose >= 0) move(step_of_[traverse_.loose], VectorXd(part * step));
        for (std::size_t k = 0; k < noise.size(); ++k) {
          noise_[k] = part * toward[k];
          if (noise[k].size() > 0) noise_[k] += (1.0 - part) * noise[k];
        }
        if (linearize() && chi2_ < before) break;
      }
    }
    return promised_;
  }
  /// After the full step.
  std::vector<VectorXd> best_noise() const {
    const VectorXd left = P_ * b_;
    std::vector<VectorXd> noise(by_noise_.size());
    for (std::size_t k = 0; k < noise.size(); ++k) {
      if (by_noise_[k].size() > 0) noise[k] = -(by_noise_[k].transpose() * left);
    }
    return noise;
  }

  Misclosure described(double chi2) const {
    Misclosure found{freedoms_, chi2, b_, P_, known_, {}};
    for (const auto& [v, k] : step_of_) found.states[v] = states_[k];
    return found;
  }

  /// States of what is loose around what it is measured from, those that fit best first: minima may
  /// be out of reach of the graph's.
  std::vector<State> starts() {
    constexpr std::size_t kMost = 8;
    std::vector<std::pair<double, State>> by_chi2;
    for (State& start : around()) {
      states_[step_of_[traverse_.loose]] = start;
      if (linearize()) by_chi2.emplace_back(chi2_, std::move(start));
    }
    std::ranges::stable_sort(by_chi2, {}, &std::pair<double, State>::first);
    by_chi2.resize(std::min(kMost, by_chi2.size()));
    std::vector<State> best;
    for (auto& [chi2, start] : by_chi2) best.push_back(std::move(start));
    return best;
  }
  /// Where what is not loose of the closing factors is.
  std::vector<Eigen::Vector3d> measured_from() const {
    std::vector<Eigen::Vector3d> places;
    for (const int f : traverse_.closing) {
      for (const int v : graph_.factor_variables(f)) {
        const std::size_t k = step_of_.at(v);  // those that depend on what is loose come after it
        if (k < step_of_.at(traverse_.loose) && has_position(graph_.type(v)))
          places.push_back(position(graph_.type(v), states_[k]));
      }
    }
    return places;
  }
  std::vector<State> around() const {
    const Placement* placement = graph_.type(traverse_.loose).placement();
    const std::vector<Eigen::Vector3d> from = measured_from();
    if (!placement || from.empty()) return {};
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& p : from) centre += p / static_cast<double>(from.size());
    double reach = 0.0;
    for (const Eigen::Vector3d& p : from) reach = std::max(reach, (p - centre).norm());
    const int n = placement->dimension();
    std::vector<State> all;
    const auto add = [&](const Eigen::Matrix3d& Q, const Eigen::Vector3d& t) {
      const MatrixXd R = Q.topLeftCorner(n, n);
      all.push_back(states_[step_of_.at(traverse_.loose)]);
      placement->join(R.data(), t.data(), all.back().data());
    };
    for (const Eigen::Matrix3d& Q : turns(n)) {
      if (placement->has_orientation()) {
        add(Q, centre);
        continue;
      }
      for (const Eigen::Vector3d& p : from) {
        for (const double distance : {0.3, 1.0, 3.0}) add(Q, p + distance * reach * Q.col(0));
      }
    }
    return all;
  }

  const Graph& graph_;
  const Traverse& traverse_;
  std::map<int, std::size_t> step_of_;  ///< by variable
  Eigen::Index rows_ = 0;
  int rank_ = 0;
  std::vector<State> states_;    ///< by step, as what follows
  std::vector<VectorXd> noise_;  ///< empty: zero

  VectorXd b_;                      ///< the closing residual, linearly, without noise
  std::vector<MatrixXd> by_noise_;  ///< its derivative by the noise of each step
  std::map<int, MatrixXd> known_;   ///< by what is known
  MatrixXd P_;
  VectorXd step_;                       ///< of what is loose
  double chi2_ = 0.0, promised_ = 0.0;  ///< as it is, and after a full step, as it seems
  int freedoms_ = 0;
};

}  // namespace

Misclosure misclosure(const Graph& graph, const Traverse& traverse) {
  return TraverseProblem(graph, traverse).solve();
}

}  // namespace cairn
