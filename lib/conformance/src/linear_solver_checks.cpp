// SPDX-License-Identifier: BSD-3-Clause
// Laws of linear solvers: against dense algebra, on small random block systems.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/conformance/checker.hpp"
#include "cairn/conformance/repetition.hpp"
#include "cairn/conformance/samples.hpp"
#include "cairn/io/random_numbers.hpp"
#include "cairn/linear/iterative_solver.hpp"
#include "cairn/linear/jacobian.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/linear/marginals.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"
#include "dense/products.hpp"
#include "own_checks.hpp"

namespace cairn::conformance {
namespace {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kAccuracy = 1e-8;  // of a solution, relative to its length

/// A random J with its H = JᵀJ: block rows between two unknowns, and one on each unknown alone that
/// makes H regular.
struct System {
  JacobianStructure J_structure;
  JacobianMatrix J;
  BlockStructure H_structure;
  BlockMatrix H;
  MatrixXd dense_J;
  VectorXd residual;

  System(const System&) = delete;
  System& operator=(const System&) = delete;
  System(RandomNumbers& random, int blocks, int extra) {
    std::vector<std::int32_t> columns, row_sizes, sizes;
    std::vector<std::int64_t> row_begin{0};
    std::vector<std::pair<std::int32_t, std::int32_t>> entries;
    for (int k = 0; k < blocks; ++k) sizes.push_back(static_cast<int>(1 + random.below(6)));
    const auto add_row = [&](std::int32_t size, std::vector<std::int32_t> on) {
      columns.insert(columns.end(), on.begin(), on.end());
      row_sizes.push_back(size);
      row_begin.push_back(std::ssize(columns));
      if (on.size() == 2) entries.emplace_back(on[0], on[1]);
    };
    for (int k = 0; k < blocks; ++k) add_row(sizes[static_cast<std::size_t>(k)], {k});
    for (int k = 1; k < blocks; ++k) add_row(3, {k - 1, k});
    for (int k = 0; k < extra; ++k) {
      const auto a = static_cast<std::int32_t>(random.below(static_cast<std::size_t>(blocks))),
                 b = static_cast<std::int32_t>(random.below(static_cast<std::size_t>(blocks)));
      if (a != b) add_row(2, {a, b});
    }
    J_structure = JacobianStructure(row_sizes, sizes, row_begin, columns);
    H_structure = BlockStructure(sizes, entries);
    J = JacobianMatrix(J_structure);
    H = BlockMatrix(H_structure);
    for (double& value : J.values()) value = random.uniform(-1.0, 1.0);
    for (double& value : J.residual()) value = random.uniform(-1.0, 1.0);
    for (int k = 0; k < blocks; ++k) {  // the rows on one unknown
      const int n = sizes[static_cast<std::size_t>(k)];
      for (int d = 0; d < n; ++d) J.block(k)[d * n + d] += 2.0;
    }
    fill();
  }

  /// H and the dense copies, from J.
  void fill() {
    const JacobianStructure& s = J_structure;
    dense_J = MatrixXd::Zero(s.rows(), s.size());
    for (int row = 0; row < s.block_rows(); ++row) {
      for (auto e = s.row_begin()[static_cast<std::size_t>(row)];
           e < s.row_begin()[static_cast<std::size_t>(row) + 1]; ++e) {
        const auto r = static_cast<std::size_t>(row);
        const auto c = static_cast<std::size_t>(s.columns()[static_cast<std::size_t>(e)]);
        dense_J.block(s.row_offsets()[r], s.column_offsets()[c], s.row_sizes()[r],
                      s.column_sizes()[c]) =
            Map<const MatrixXd>(J.block(e), s.row_sizes()[r], s.column_sizes()[c]);
      }
    }
    residual = Map<const VectorXd>(J.residual().data(), std::ssize(J.residual()));
    const MatrixXd whole = dense_H();
    for (int column = 0; column < H_structure.blocks(); ++column) {
      const auto c = static_cast<std::size_t>(column);
      for (auto e = H_structure.column_begin()[c]; e < H_structure.column_begin()[c + 1]; ++e) {
        const auto row = static_cast<std::size_t>(H_structure.rows()[static_cast<std::size_t>(e)]);
        const Index rows = H_structure.sizes()[row], width = H_structure.sizes()[c];
        Map<MatrixXd>(H.block(e), rows, width) =
            whole.block(H_structure.offsets()[row], H_structure.offsets()[c], rows, width);
      }
    }
  }
  MatrixXd dense_H() const { return dense::product_of_transpose(dense_J, dense_J); }
  Index size() const { return dense_J.cols(); }
  /// −Jᵀr
  VectorXd gradient() const { return -(dense_J.transpose() * residual); }

  /// Nothing depends on this unknown any more.
  void clear(int unknown) {
    const JacobianStructure& s = J_structure;
    for (int row = 0; row < s.block_rows(); ++row) {
      const auto r = static_cast<std::size_t>(row);
      for (auto e = s.row_begin()[r]; e < s.row_begin()[r + 1]; ++e) {
        if (s.columns()[static_cast<std::size_t>(e)] != unknown) continue;
        std::fill_n(J.block(e),
                    s.row_sizes()[r] * s.column_sizes()[static_cast<std::size_t>(unknown)], 0.0);
      }
    }
    fill();
  }

  std::string text() const {
    return fmt::format("{} blocks, {} rows, {} blocks of H stored", H_structure.blocks(), size(),
                       H_structure.entries());
  }
};

VectorXd dense_solution(const MatrixXd& H, const VectorXd& g) {
  return Eigen::LDLT<MatrixXd>(H).solve(g);
}

/// One solver by name, through H or, where it takes nothing but the Jacobian, through that.
class Solver {
 public:
  Solver(const Subject& subject, Checker& check)
      : check_(check), solver_(made<LinearSolver>(subject, check)) {
    jacobian_ = query<JacobianSolver>(*solver_);
    if (!jacobian_) return;
    try {
      solver_->analyze(BlockStructure({1}, {}));
      by_jacobian_ = false;  // it can do both: H is checked here
    } catch (const Error&) {
      by_jacobian_ = true;
    }
  }

  bool by_jacobian() const { return by_jacobian_; }
  LinearSolver& solver() { return *solver_; }

  void analyze(const System& system) {
    check_.call("analyze", [&] {
      if (by_jacobian_)
        jacobian_->analyze(system.J_structure);
      else
        solver_->analyze(system.H_structure);
    });
  }
  Factorization factorize(const System& system) {
    return check_.call("factorize", [&] {
      return by_jacobian_ ? jacobian_->factorize(system.J, {}) : solver_->factorize(system.H);
    });
  }
  /// x with H x = g, g = −Jᵀr.
  VectorXd solve(const System& system) {
    const VectorXd g = system.gradient();
    const auto n = static_cast<std::size_t>(g.size());
    Guarded x("x", n);
    if (by_jacobian_) {
      const Guarded r("residual", system.J.residual());
      Guarded in = r;
      check_.call("minimize", {&in, &x}, [&] { jacobian_->minimize(in.span(), x.span()); });
    } else {
      Guarded in("g", {g.data(), n});
      check_.call("solve", {&in, &x}, [&] { solver_->solve(in.span(), x.span()); });
    }
    const std::vector<double> values = x.values();
    return Map<const VectorXd>(values.data(), g.size());
  }

  /// All of it, without guards and from any thread.
  State solve_all(const System& system) {
    const VectorXd g = system.gradient();
    State x(static_cast<std::size_t>(g.size()));
    if (by_jacobian_) {
      jacobian_->analyze(system.J_structure);
      if (jacobian_->factorize(system.J, {}).ok) jacobian_->minimize(system.J.residual(), x);
    } else {
      solver_->analyze(system.H_structure);
      if (solver_->factorize(system.H).ok) solver_->solve({g.data(), x.size()}, x);
    }
    return x;
  }

  /// How far a solution may be off: an iterative solver answers for its residual, and that allows
  /// an error of the solution by the condition number.
  double accuracy(const System& system) const {
    const auto* iterative = query<IterativeSolver>(*solver_);
    if (!iterative) return kAccuracy;
    const VectorXd eigenvalues =
        Eigen::SelfAdjointEigenSolver<MatrixXd>(system.dense_H()).eigenvalues();
    return std::max(kAccuracy, 10.0 * iterative->tolerance()) * eigenvalues.maxCoeff() /
           eigenvalues.minCoeff();
  }

 private:
  Checker& check_;
  Made<LinearSolver> solver_;
  JacobianSolver* jacobian_ = nullptr;
  bool by_jacobian_ = false;
};

/// Calls body(solver, system) for systems from one block to a few dozen, each with a new solver.
template <class Body>
void for_systems(const Subject& subject, Checker& check, const Body& body) {
  RandomNumbers random(RandomNumbers::mixed(check.options().seed + 31));
  for (int k = 0; k < check.options().samples; ++k) {
    const int blocks = k == 0 ? 1 : static_cast<int>(2 + random.below(40));
    System system(random, blocks, k % 3 * blocks / 2);
    check.sample(system.text(), [&] {
      Solver solver(subject, check);
      solver.analyze(system);
      body(solver, system, random);
    });
  }
}

/// Factorises and solves, and compares with dense algebra.
void agree(Solver& solver, const System& system, Checker& check, std::string_view law) {
  const Factorization factorization = solver.factorize(system);
  check.expect(factorization.ok, "factorize accepts a positive definite system",
               [&] { return fmt::format("it stopped at block {}", factorization.failed_block); });
  if (!factorization.ok) return;
  const VectorXd x = solver.solve(system),
                 expected = dense_solution(system.dense_H(), system.gradient());
  check.within((x - expected).norm() / expected.norm(), solver.accuracy(system), law);
}

void check_solutions(const Subject& subject, Checker& check) {
  for_systems(subject, check, [&](Solver& solver, System& system, RandomNumbers& random) {
    agree(solver, system, check, "H x = g, as dense algebra solves it");
    for (double& value : system.J.values()) value *= random.uniform(0.9, 1.1);
    system.fill();
    agree(solver, system, check, "new values need no new analysis");
    if (solver.by_jacobian()) return;
    const VectorXd g = system.gradient(), apart = solver.solve(system);
    Guarded both = Guarded::in_place("x", {g.data(), static_cast<std::size_t>(g.size())});
    check.call("solve", {&both}, [&] { solver.solver().solve(both.span(), both.span()); });
    const std::vector<double> values = both.values();
    check.within((Map<const VectorXd>(values.data(), g.size()) - apart).norm(),
                 kAccuracy * apart.norm(), "x may be g");
  });
}

/// A system that has no solution must be an outcome, and the next one is solved.
void check_failures(const Subject& subject, Checker& check) {
  for_systems(subject, check, [&](Solver& solver, System& good, RandomNumbers& random) {
    const auto blocks = static_cast<std::size_t>(good.H_structure.blocks());
    const int spoilt = static_cast<int>(random.below(blocks));
    const std::vector<double> J(good.J.values().begin(), good.J.values().end());
    const auto restore = [&] {
      std::ranges::copy(J, good.J.values().begin());
      good.fill();
    };
    const auto expect_refusal = [&](std::string_view what) {
      const Factorization factorization = solver.factorize(good);
      check.expect(!factorization.ok, fmt::format("factorize reports {}", what), [&] {
        const VectorXd x = solver.solve(good);
        return fmt::format("it returned ok, and solve gave {}",
                           text_of({x.data(), static_cast<std::size_t>(x.size())}));
      });
      check.expect(factorization.failed_block < good.H_structure.blocks(),
                   "failed_block is a block, or -1",
                   [&] { return fmt::format("it is {}", factorization.failed_block); });
      restore();
      agree(solver, good, check, "a good system is solved after one that was not");
    };
    good.clear(spoilt);
    check.describe(fmt::format("{}; block {} of H is zero", good.text(), spoilt));
    expect_refusal("a singular system");
    for (const double value :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
      good.J.block(spoilt)[0] = value;
      const auto diagonal = good.H_structure.column_begin()[static_cast<std::size_t>(spoilt)];
      good.H.block(diagonal)[0] = value;
      check.describe(fmt::format("{}; {} in diagonal block {}", good.text(), value, spoilt));
      expect_refusal("a system that is not finite");
    }
    if (solver.by_jacobian()) return;  // JᵀJ is never indefinite
    const auto diagonal = good.H_structure.column_begin()[static_cast<std::size_t>(spoilt)];
    const int n = good.H_structure.block_size(spoilt);
    for (int d = 0; d < n; ++d) good.H.block(diagonal)[d * n + d] = -1e3;
    check.describe(fmt::format("{}; the diagonal of block {} is -1000", good.text(), spoilt));
    expect_refusal("a system that is indefinite");
  });
}

void check_abilities(const Subject& subject, Checker& check) {
  bool some = false;
  for_systems(subject, check, [&](Solver& solver, System& system, RandomNumbers&) {
    if (!solver.factorize(system).ok) return;  // a finding of the other groups
    const MatrixXd H = system.dense_H();
    const Index n = H.rows();
    if (auto* ability = query<LogDeterminant>(solver.solver())) {
      some = true;
      const VectorXd D = Eigen::LDLT<MatrixXd>(H).vectorD();
      const double expected = D.array().log().sum();
      const double found =
          check.call("log_determinant", [&] { return ability->log_determinant(); });
      check.within(std::abs(found - expected), kAccuracy * (1.0 + std::abs(expected)),
                   "log_determinant is ln|H|");
    }
    if (solver.by_jacobian()) return;
    if (auto* ability = query<ManyRightHandSides>(solver.solver())) {
      some = true;
      for (const int columns : {0, 1, 5, 8, 11}) {
        MatrixXd G = MatrixXd::Zero(n, columns);
        for (int c = 0; c < columns; ++c) G.col(c) = (1.0 + c) * system.gradient();
        G.diagonal().array() += 1.0;
        const auto size = static_cast<std::size_t>(G.size());
        Guarded in("G", {G.data(), size}), X("X", size);
        check.call("solve of several right-hand sides", {&in, &X},
                   [&] { ability->solve(in.span(), X.span(), columns); });
        const std::vector<double> values = X.values();
        const MatrixXd expected = Eigen::LDLT<MatrixXd>(H).solve(G);
        check.within((Map<const MatrixXd>(values.data(), n, columns) - expected).norm(),
                     solver.accuracy(system) * expected.norm(), "X = H⁻¹ G");
      }
    }
    if (auto* ability = query<Marginals>(solver.solver())) {
      some = true;
      const MatrixXd Sigma = Eigen::LDLT<MatrixXd>(H).solve(MatrixXd(MatrixXd::Identity(n, n)));
      std::size_t size = 0;
      for (const int s : system.H_structure.sizes()) size += static_cast<std::size_t>(s) * s;
      Guarded out("out", size);
      check.call("diagonal_blocks", {&out}, [&] { ability->diagonal_blocks(out.span()); });
      const std::vector<double> values = out.values();
      const double* at = values.data();
      double worst = 0.0;
      for (std::size_t b = 0; b < system.H_structure.sizes().size(); ++b) {
        const Index first = system.H_structure.offsets()[b], s = system.H_structure.sizes()[b];
        const double off = (Map<const MatrixXd>(at, s, s) - Sigma.block(first, first, s, s)).norm();
        if (!(off <= worst)) worst = off;
        at += s * s;
      }
      check.within(worst, kAccuracy * Sigma.norm(), "diagonal_blocks are those of H⁻¹");
    }
  });
  if (!some) check.note("it has none of log_determinant, many_right_hand_sides, marginals");
}

/// Analysed, factorised and solved again each time.
Repetition linear_solver_uses(const Subject& subject, Checker& check) {
  return {"analyze, factorize and solve", 10, [&subject, &check](std::uint64_t input) {
            RandomNumbers random(RandomNumbers::mixed(check.options().seed + 31 + input));
            const auto system = std::make_shared<System>(random, 20, 10);
            const auto solver = std::make_shared<Solver>(subject, check);
            return [solver, system] { return solver->solve_all(*system); };
          }};
}

}  // namespace

std::span<const Group> linear_solver_groups() {
  static constexpr std::array<Group, 5> groups{
      {{"solutions", check_solutions},
       {"systems without a solution", check_failures},
       {"abilities", check_abilities},
       {"memory", memory_group<linear_solver_uses>, true},
       {"threads", threads_group<linear_solver_uses>, true}}};
  return groups;
}

}  // namespace cairn::conformance
