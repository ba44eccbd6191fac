// SPDX-License-Identifier: BSD-3-Clause
// The factor that changes against dense algebra on what it is to be the factor of.
#include "tree.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "dense.hpp"
#include "factorization.hpp"
#include "inverse.hpp"
#include "substitution.hpp"
#include "support/dense_algebra.hpp"

namespace cairn::incremental {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A system that comes, changes and goes, with the tree on it: every variable has a prior, and
/// every edge adds JᵀJ of a random J to two of them.
class Changing {
 public:
  Changing(unsigned seed, const block::Kernels& kernels) : rng_(seed), tree_(kernels) {}
  Changing(const Changing&) = delete;
  Changing& operator=(const Changing&) = delete;

  std::int32_t add_variable(std::int32_t size) {
    const std::int32_t v = system_.add_variable(size);
    tree_.add_variable();
    tree_.bind(v, 1);
    touched_at_.push_back(time_);
    MatrixXd prior = MatrixXd::Identity(size, size);
    add_to_diagonal(v, prior);
    alive_.push_back(v);
    structure_changed_ = true;
    return v;
  }
  void add_edge(std::int32_t a, std::int32_t b) {
    system_.connect(a, b);
    edges_.push_back({std::min(a, b), std::max(a, b), {}});
    draw(edges_.back());
    add(edges_.back(), 1.0);
    touched_at_[a] = touched_at_[b] = time_;
    structure_changed_ = true;
  }
  void change_edge(std::size_t k) {
    add(edges_[k], -1.0);
    draw(edges_[k]);
    add(edges_[k], 1.0);
  }
  void remove_edge(std::size_t k) {
    add(edges_[k], -1.0);
    system_.disconnect(edges_[k].a, edges_[k].b);
    edges_.erase(edges_.begin() + static_cast<std::ptrdiff_t>(k));
    structure_changed_ = true;
  }
  void retire(std::int32_t v) {
    for (std::size_t k = edges_.size(); k-- > 0;) {
      if (edges_[k].a == v || edges_[k].b == v) remove_edge(k);
    }
    touched_.insert(v);
    retiring_.push_back(v);
    std::erase(alive_, v);
    structure_changed_ = true;
  }
  void touch(std::int32_t v) { touched_.insert(v); }
  void add_to_diagonal(std::int32_t v, const MatrixXd& part) {
    Eigen::Map<MatrixXd>(system_.diagonal(v), part.rows(), part.cols()) += part;
    touched_.insert(v);
  }

  /// One random change.
  void change() {
    const double what = std::uniform_real_distribution<double>(0.0, 1.0)(rng_);
    if (alive_.size() < 3 || what < 0.45) {
      const std::int32_t v = add_variable(1 + static_cast<std::int32_t>(rng_() % 6));
      // Mostly with one of the last; now and then on its own.
      if (alive_.size() > 1 && rng_() % 12 != 0) {
        const std::size_t back = std::min<std::size_t>(alive_.size() - 1, 1 + rng_() % 3);
        add_edge(v, alive_[alive_.size() - 1 - back]);
      }
    } else if (what < 0.65) {
      const std::int32_t a = any(), b = any();
      if (a != b) add_edge(a, b);
    } else if (what < 0.8) {
      if (!edges_.empty()) change_edge(rng_() % edges_.size());
    } else if (what < 0.9) {
      if (!edges_.empty()) remove_edge(rng_() % edges_.size());
    } else {
      retire(any());
    }
  }

  std::int32_t bring_up_to_date() {
    restructure();
    return factorization_.compute(system_, tree_);
  }
  /// The tree as it is to be, whose affected nodes are still to be factorised.
  void restructure() {
    tree_.clear_affected();
    for (const std::int32_t v : touched_) tree_.touch(v);
    for (const std::int32_t v : retiring_) tree_.retire(v);
    if (structure_changed_) tree_.restructure(system_, {touched_at_, time_ - 3, {}});
    touched_.clear();
    retiring_.clear();
    structure_changed_ = false;
    ++time_;
  }

  std::int32_t any() { return alive_[rng_() % alive_.size()]; }
  std::vector<std::int32_t> some(std::size_t count) {
    std::set<std::int32_t> chosen;
    for (std::size_t k = 0; k < count; ++k) chosen.insert(any());
    return {chosen.begin(), chosen.end()};
  }
  double number() { return std::uniform_real_distribution<double>(-1.0, 1.0)(rng_); }
  MatrixXd H() const { return dense(system_, tree_); }
  Tree& tree() { return tree_; }
  System& system() { return system_; }
  Factorization& factorization() { return factorization_; }
  Substitution& substitution() { return substitution_; }
  /// Solves for what is in g of the system.
  double solve(std::span<const std::int32_t> sources, double tolerance, Steps& steps) {
    return substitution_.solve(system_, tree_, states_, motions_, sources, tolerance, steps);
  }
  void follow(std::int32_t v, Steps& steps) {
    substitution_.follow(system_, tree_, states_, motions_, v, steps);
  }
  const std::vector<std::int32_t>& alive() const { return alive_; }
  std::mt19937& rng() { return rng_; }

 private:
  struct Edge {
    std::int32_t a, b;
    MatrixXd J;
  };
  void draw(Edge& edge) {
    edge.J.resize(3, system_.size(edge.a) + system_.size(edge.b));
    for (double& value : edge.J.reshaped()) value = number();
  }
  void add(const Edge& edge, double sign) {
    const Eigen::Index na = system_.size(edge.a), nb = system_.size(edge.b);
    const MatrixXd H = sign * edge.J.transpose() * edge.J;
    add_to_diagonal(edge.a, H.topLeftCorner(na, na));
    add_to_diagonal(edge.b, H.bottomRightCorner(nb, nb));
    Eigen::Map<MatrixXd>(system_.block(system_.find(edge.a, edge.b)), na, nb) +=
        H.topRightCorner(na, nb);
  }

  std::mt19937 rng_;
  System system_;
  States states_;
  Tree tree_;
  Factorization factorization_;
  Substitution substitution_;
  Motions motions_;
  std::vector<Edge> edges_;
  std::vector<std::int32_t> alive_, retiring_;
  std::set<std::int32_t> touched_;
  std::vector<std::int64_t> touched_at_;
  std::int64_t time_ = 0;
  bool structure_changed_ = false;
};

/// What must hold of every tree.
void expect_sound(Changing& changing) {
  const Tree& tree = changing.tree();
  std::vector<int> seen(static_cast<std::size_t>(changing.system().variables()));
  for (std::size_t n = 0; n < tree.nodes().size(); ++n) {
    const Node& node = tree.nodes()[n];
    if (!node.live) continue;
    for (const std::int32_t v : node.own_variables()) {
      ++seen[static_cast<std::size_t>(v)];
      ASSERT_EQ(tree.node_of(v), static_cast<std::int32_t>(n));
    }
    ASSERT_EQ(node.parent < 0, node.separator().empty());
    if (node.parent < 0) continue;
    const Node& parent = tree.nodes()[static_cast<std::size_t>(node.parent)];
    ASSERT_TRUE(parent.live);
    ASSERT_LT(node.sequence, parent.sequence);
    for (const std::int32_t v : node.separator())
      ASSERT_EQ(std::ranges::count(parent.variables, v), 1);
  }
  for (std::int32_t v = 0; v < changing.system().variables(); ++v)
    ASSERT_EQ(seen[static_cast<std::size_t>(v)], std::ranges::count(changing.alive(), v));
}

Eigen::Map<const VectorXd> all_of(const Steps& steps) {
  return {steps.values.data(), std::ssize(steps.values)};
}

void expect_solutions(Changing& changing) {
  System& system = changing.system();
  Tree& tree = changing.tree();
  const MatrixXd H = changing.H(), Sigma = test::inverse_of(H);
  const auto n = static_cast<std::size_t>(system.scalars());
  const std::vector<std::int32_t> sources = changing.some(3);
  std::vector<double>& g = system.g();
  Steps steps{std::vector<double>(n, 0.0), {}};
  for (const std::int32_t v : sources) {
    for (int k = 0; k < system.size(v); ++k)
      g[static_cast<std::size_t>(system.offset(v) + k)] = changing.number();
  }
  const std::vector<double> before = g;
  const VectorXd right = Eigen::Map<const VectorXd>(g.data(), std::ssize(g));
  const VectorXd wanted = Sigma * right;
  const double decrement = right.dot(wanted), tolerance = 1e-10 * wanted.norm();

  EXPECT_NEAR(changing.substitution().decrement(system, tree, sources), decrement,
              1e-10 * decrement);
  EXPECT_TRUE(std::ranges::all_of(g, [](double value) { return value == 0.0; }));
  g = before;
  EXPECT_NEAR(changing.solve(sources, 0.0, steps), decrement, 1e-10 * decrement);
  EXPECT_EQ(g, std::vector<double>(n, 0.0));
  EXPECT_LT((all_of(steps) - wanted).norm(), tolerance);
  std::set<std::int32_t> listed(steps.changed.begin(), steps.changed.end());
  EXPECT_EQ(listed.size(), steps.changed.size());
  for (std::int32_t v = 0; v < system.variables(); ++v) {
    if (listed.contains(v)) continue;
    for (int k = 0; k < system.size(v); ++k)
      EXPECT_EQ(steps.values[static_cast<std::size_t>(system.offset(v) + k)], 0.0);
  }
  EXPECT_NEAR(tree.log_determinant(),
              2.0 * MatrixXd(H.llt().matrixL()).diagonal().array().log().sum(), 1e-9);
}

void expect_columns(Changing& changing) {
  const System& system = changing.system();
  const Tree& tree = changing.tree();
  const Eigen::Index n = system.scalars();
  const std::vector<std::int32_t> sources = changing.some(4);
  Eigen::Matrix<double, Eigen::Dynamic, 8, Eigen::RowMajor> B(n, 8);
  B.setZero();
  for (const std::int32_t v : sources) {
    for (double& value : B.middleRows(system.offset(v), system.size(v)).reshaped())
      value = changing.number();
  }
  const MatrixXd wanted = test::inverse_of(changing.H()) * B;
  const double tolerance = 1e-10 * wanted.norm();
  AlignedVector X(B.data(), B.data() + B.size());
  changing.substitution().solve_many(system, tree, sources, X);
  EXPECT_LT((Eigen::Map<decltype(B)>(X.data(), n, 8) - wanted).norm(), tolerance);

  X.assign(B.data(), B.data() + B.size());
  changing.substitution().solve_many_above(system, tree, sources, X);
  const Eigen::Map<decltype(B)> above(X.data(), n, 8);
  for (const std::int32_t source : sources) {
    for (std::int32_t at = tree.node_of(source); at >= 0;) {
      const Node& node = tree.nodes()[static_cast<std::size_t>(at)];
      for (const std::int32_t v : node.own_variables()) {
        const auto rows = [&](const auto& M) {
          return M.middleRows(system.offset(v), system.size(v));
        };
        EXPECT_LT((rows(above) - rows(wanted)).norm(), tolerance) << v;
      }
      at = node.parent;
    }
  }
}

void expect_inverse(Changing& changing) {
  const System& system = changing.system();
  const MatrixXd Sigma = test::inverse_of(changing.H());
  std::set<std::int32_t> visited;
  diagonal_of_inverse(system, changing.tree(),
                      [&](std::int32_t v, const double* block, std::int64_t stride) {
                        EXPECT_TRUE(visited.insert(v).second);
                        const Eigen::Index size = system.size(v), at = system.offset(v);
                        const Eigen::Map<const MatrixXd, 0, Eigen::OuterStride<>> Z(
                            block, size, size, Eigen::OuterStride<>(stride));
                        const MatrixXd wanted = Sigma.block(at, at, size, size);
                        EXPECT_LT((Z - wanted).norm(), 1e-10 * wanted.norm()) << v;
                      });
  EXPECT_EQ(visited, std::set<std::int32_t>(changing.alive().begin(), changing.alive().end()));
}

TEST(Tree, AgreesWithDenseAlgebraWhateverChanges) {
  for (const block::Kernels* kernels : kernel_sets()) {
    for (unsigned seed = 1; seed <= 12; ++seed) {
      Changing changing(seed, *kernels);
      for (int update = 0; update < 40; ++update) {
        for (unsigned k = 0; k < 1 + changing.rng()() % 4; ++k) changing.change();
        ASSERT_EQ(changing.bring_up_to_date(), -1);
        expect_sound(changing);
        expect_solutions(changing);
        if (update % 4 == 3) {
          expect_columns(changing);
          expect_inverse(changing);
        }
        ASSERT_FALSE(testing::Test::HasFailure())
            << kernels->name << ", seed " << seed << ", update " << update;
      }
    }
  }
}

TEST(Tree, AgreesInWideFronts) {
  for (const block::Kernels* kernels : kernel_sets()) {
    Changing changing(7, *kernels);
    for (int k = 0; k < 90; ++k) {
      changing.add_variable(1 + static_cast<std::int32_t>(changing.rng()() % 6));
      for (int j = std::max(0, k - 75); j < k; ++j) changing.add_edge(k, j);
    }
    ASSERT_EQ(changing.bring_up_to_date(), -1);
    ASSERT_TRUE(std::ranges::any_of(changing.tree().nodes(),
                                    [](const Node& node) { return node.m > 256; }));
    expect_sound(changing);
    expect_solutions(changing);
    expect_columns(changing);
    expect_inverse(changing);
    changing.change_edge(3);  // the numbers alone
    ASSERT_EQ(changing.bring_up_to_date(), -1);
    expect_solutions(changing);
    ASSERT_FALSE(testing::Test::HasFailure()) << kernels->name;
  }
}

/// L and all update matrices.
std::vector<double> numbers_of(const Tree& tree) {
  std::vector<double> all;
  for (const Node& node : tree.nodes()) {
    if (!node.live) continue;
    for (std::int64_t c = 0; c < node.columns; ++c) {
      const auto column = node.panel.begin() + c * node.stride;
      all.insert(all.end(), column + c, column + node.m);
    }
    for (std::int32_t c = node.columns; c < node.m; ++c) {
      const auto column = node.update.begin() + node.update_place(c, c);
      all.insert(all.end(), column, column + node.m - c);
    }
  }
  return all;
}

/// Goes on with a factorisation, one piece at a time; `pause` is called after each, with how much
/// work it was.
template <class Pause>
std::int32_t factorize_in_pieces(Changing& changing, Pause pause) {
  double reads = 0.0;
  Pace pace;
  pace.set_clock([&] { return reads += 1.0; });
  std::int32_t result = Factorization::kPaused;
  while (result == Factorization::kPaused) {
    pace.begin(0.5);
    result = changing.factorization().more(changing.system(), changing.tree(), pace);
    if (result == Factorization::kPaused) pause(pace.largest());
  }
  return result;
}

/// Variables of a solid grid, whose fronts are large and have others above them; and more that come
/// later and make children whose separators have another order than their parents' fronts.
void fill_with_large_fronts(Changing& changing) {
  constexpr int kSide = 6;
  for (int k = 0; k < kSide * kSide * kSide; ++k) {
    changing.add_variable(6);
    if (k % kSide > 0) changing.add_edge(k - 1, k);
    if (k / kSide % kSide > 0) changing.add_edge(k - kSide, k);
    if (k >= kSide * kSide) changing.add_edge(k - kSide * kSide, k);
  }
  ASSERT_EQ(changing.bring_up_to_date(), -1);
  for (int more = 0; more < 6; ++more) {
    const std::int32_t v = changing.add_variable(5);
    for (int k = 0; k < 3; ++k) {
      if (const std::int32_t other = changing.any(); other != v) changing.add_edge(v, other);
    }
    ASSERT_EQ(changing.bring_up_to_date(), -1);
  }
}

TEST(Tree, AFactorizationThatPausesHasTheSameBits) {
  for (const block::Kernels* kernels : kernel_sets()) {
    Changing changing(11, *kernels);
    fill_with_large_fronts(changing);
    Tree& tree = changing.tree();
    const auto large = [](const Node& node) {
      return node.live && node.m > 256 && node.below() > 0 && !node.children.empty();
    };
    ASSERT_TRUE(std::ranges::any_of(tree.nodes(), large));
    ASSERT_TRUE(std::ranges::any_of(tree.nodes(), [&](const Node& node) {
      return node.live && node.parent >= 0 && !node.straight &&
             large(tree.nodes()[static_cast<std::size_t>(node.parent)]);
    }));
    for (const std::int32_t v : changing.alive()) changing.touch(v);
    changing.restructure();
    const auto nodes = static_cast<int>(tree.affected().size());
    ASSERT_EQ(changing.factorization().compute(changing.system(), tree), -1);
    const std::vector<double> wanted = numbers_of(tree);

    changing.factorization().begin(tree, 0.0);
    int pauses = 0;
    const auto pause = [&](double) {
      if (++pauses % 40 != 0) return;
      Tree copy = tree;
      Factorization rest = changing.factorization();
      Pace any;
      ASSERT_EQ(rest.more(changing.system(), copy, any), -1);
      ASSERT_EQ(numbers_of(copy), wanted) << kernels->name << ": a copy at pause " << pauses;
    };
    ASSERT_EQ(factorize_in_pieces(changing, pause), -1);
    EXPECT_EQ(numbers_of(tree), wanted) << kernels->name;
    EXPECT_GT(pauses, nodes + 20) << "large fronts are divided";
    expect_solutions(changing);

    const std::int32_t bad = changing.any();
    const MatrixXd much = 1e6 * MatrixXd::Identity(6, 6).topLeftCorner(changing.system().size(bad),
                                                                       changing.system().size(bad));
    changing.add_to_diagonal(bad, -much);
    changing.restructure();
    changing.factorization().begin(tree, 0.0);
    EXPECT_EQ(factorize_in_pieces(changing, [](double) {}), bad) << kernels->name;
  }
}

/// Wherever in a front they begin.
TEST(Tree, PiecesOfLargeFrontsAreAllSmall) {
  Changing changing(3, *kernel_sets().front());
  // Two groups that are joined with a third, but not with each other, are eliminated before it.
  constexpr int kGroup = 60, kThird = 100;
  for (int k = 0; k < 2 * kGroup + kThird; ++k) {
    changing.add_variable(6);
    for (int j = k < 2 * kGroup ? k / kGroup * kGroup : 0; j < k; ++j) changing.add_edge(j, k);
  }
  for (const std::int32_t v : changing.alive()) changing.touch(v);
  changing.restructure();
  Tree& tree = changing.tree();
  EXPECT_GE(std::ranges::count_if(tree.affected(),
                                  [&](std::int32_t n) {
                                    const Node& node = tree.nodes()[static_cast<std::size_t>(n)];
                                    return node.columns > 300 && node.below() > 500;
                                  }),
            2);
  changing.factorization().begin(tree, 0.0);
  double largest = 0.0;  // [ns by the cost model]
  ASSERT_EQ(
      factorize_in_pieces(changing, [&](double amount) { largest = std::max(largest, amount); }),
      -1);
  EXPECT_LT(largest, 4e5);
}

TEST(Tree, WhatIsOwedAndFollowedIsTheWholeSolution) {
  const block::Kernels& kernels = *kernel_sets().front();
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Changing changing(seed, kernels);
    for (int k = 0; k < 150; ++k) changing.change();
    ASSERT_EQ(changing.bring_up_to_date(), -1);
    System& system = changing.system();
    const auto n = static_cast<std::size_t>(system.scalars());
    std::vector<double>& g = system.g();
    Steps steps{std::vector<double>(n, 0.0), {}};
    VectorXd wanted = VectorXd::Zero(system.scalars());
    const MatrixXd Sigma = test::inverse_of(changing.H());
    for (int solution = 0; solution < 3; ++solution) {
      const std::vector<std::int32_t> sources = changing.some(2);
      for (const std::int32_t v : sources)
        g[static_cast<std::size_t>(system.offset(v))] = changing.number();
      wanted += Sigma * Eigen::Map<const VectorXd>(g.data(), std::ssize(g));
      steps.changed.clear();
      changing.solve(sources, 1e-4, steps);
      if (solution == 0) {
        EXPECT_LT(steps.changed.size(), changing.alive().size()) << "seed " << seed;
      }
    }
    // Its share is what each variable has got so far, and what it owes is all that is missing.
    EXPECT_LT((all_of(steps) - wanted).norm(), 0.1) << "seed " << seed;
    for (const std::int32_t v : changing.alive()) changing.follow(v, steps);
    EXPECT_LT((all_of(steps) - wanted).norm(), 1e-10 * wanted.norm()) << "seed " << seed;
    ASSERT_TRUE(std::ranges::none_of(changing.tree().nodes(), &Node::owes));
  }
}

TEST(Tree, NamesTheVariableWhosePivotsAreNotPositive) {
  for (const block::Kernels* kernels : kernel_sets()) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
      Changing changing(seed, *kernels);
      for (int k = 0; k < 60; ++k) changing.change();
      ASSERT_EQ(changing.bring_up_to_date(), -1);
      const std::int32_t bad = changing.any();
      const Eigen::Index size = changing.system().size(bad);
      const MatrixXd much = 1e4 * MatrixXd::Identity(size, size);
      changing.add_to_diagonal(bad, -much);
      ASSERT_EQ(changing.bring_up_to_date(), bad) << kernels->name << ", seed " << seed;
      changing.add_to_diagonal(bad, much);
      for (const std::int32_t v : changing.alive()) changing.touch(v);
      ASSERT_EQ(changing.bring_up_to_date(), -1);
      expect_solutions(changing);
    }
  }
}

TEST(Tree, SaysSoOfWhatIsNoNumber) {
  for (const block::Kernels* kernels : kernel_sets()) {
    Changing changing(1, *kernels);
    for (int k = 0; k < 60; ++k) changing.change();
    ASSERT_EQ(changing.bring_up_to_date(), -1);
    const std::int32_t bad = changing.any();
    *changing.system().diagonal(bad) = std::numeric_limits<double>::quiet_NaN();
    changing.touch(bad);
    EXPECT_EQ(changing.bring_up_to_date(), bad) << kernels->name;
  }
}

TEST(Tree, LeavesAloneWhatAChangeDoesNotReach) {
  Changing changing(5, *kernel_sets().back());
  constexpr int kLength = 300;
  for (int k = 0; k < kLength; ++k) {
    changing.add_variable(3);
    if (k > 0) changing.add_edge(k - 1, k);
    ASSERT_EQ(changing.bring_up_to_date(), -1);
  }
  std::map<std::int32_t, const double*> before;
  for (int v = 0; v < kLength - 30; ++v) {
    const std::int32_t n = changing.tree().node_of(v);
    before[n] = changing.tree().nodes()[static_cast<std::size_t>(n)].panel.data();
  }
  changing.add_variable(3);
  changing.add_edge(kLength - 1, kLength);
  ASSERT_EQ(changing.bring_up_to_date(), -1);
  EXPECT_LT(changing.tree().affected_variables(), 60);
  std::size_t kept = 0;
  for (const auto& [n, panel] : before) {
    const Node& node = changing.tree().nodes()[static_cast<std::size_t>(n)];
    kept += node.live && !node.affected && node.panel.data() == panel;
  }
  EXPECT_GT(kept, before.size() / 2);
  expect_sound(changing);
  expect_solutions(changing);
}

TEST(Tree, ChangedNumbersAloneKeepTheTree) {
  Changing changing(6, *kernel_sets().back());
  for (int k = 0; k < 100; ++k) changing.change();
  ASSERT_EQ(changing.bring_up_to_date(), -1);
  std::vector<std::int32_t> nodes;
  for (const std::int32_t v : changing.alive()) nodes.push_back(changing.tree().node_of(v));
  changing.change_edge(0);
  ASSERT_EQ(changing.bring_up_to_date(), -1);
  for (std::size_t k = 0; k < nodes.size(); ++k)
    EXPECT_EQ(changing.tree().node_of(changing.alive()[k]), nodes[k]);
  expect_solutions(changing);
}

TEST(Tree, ACopyStandsOnItsOwn) {
  Changing changing(8, *kernel_sets().back());
  for (int k = 0; k < 80; ++k) changing.change();
  ASSERT_EQ(changing.bring_up_to_date(), -1);
  const System system = changing.system();
  const Tree copy = changing.tree();
  const double log_determinant = copy.log_determinant();
  const MatrixXd H = dense(system, copy);
  for (int k = 0; k < 20; ++k) changing.change();
  ASSERT_EQ(changing.bring_up_to_date(), -1);
  EXPECT_EQ(copy.log_determinant(), log_determinant);
  EXPECT_EQ(dense(system, copy), H);
  EXPECT_NE(changing.tree().log_determinant(), log_determinant);
}

}  // namespace
}  // namespace cairn::incremental
