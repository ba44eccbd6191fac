// SPDX-License-Identifier: BSD-3-Clause
#include "topologies.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>

#include <fmt/core.h>

#include "blanket_matrices.hpp"
#include "cairn/information/gaussian.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"
#include "recovery.hpp"
#include "tree.hpp"

namespace cairn::sparsify {
namespace {

/// Passes of factor descent over the chosen factors, whenever these have become more by a part.
constexpr int kRelaxations = 2;
constexpr double kGrowth = 0.1;

/// ε in Λ's units.
double epsilon_of(const DenseBlanket& blanket, const TopologyOptions& options) {
  if (options.absolute) return options.epsilon;
  return options.epsilon * information(blanket).trace() / std::max(1, blanket.size());
}

Matrix regularized_covariance(const DenseBlanket& blanket, const TopologyOptions& options) {
  const int d = blanket.size();
  const Matrix sum =
      Matrix(information(blanket)) + epsilon_of(blanket, options) * Matrix::Identity(d, d);
  return sum.llt().solve(Matrix::Identity(d, d));
}

/// The blocks of two nodes.
Matrix pair_block(const Matrix& A, const std::vector<int>& begin, int i, int j) {
  const int m = begin[i + 1] - begin[i], n = begin[j + 1] - begin[j];
  Matrix block(m + n, m + n);
  block << A.block(begin[i], begin[i], m, m), A.block(begin[i], begin[j], m, n),
      A.block(begin[j], begin[i], n, m), A.block(begin[j], begin[j], n, n);
  return block;
}

/// (T 4.17): what i knows by itself, over what it would know if j were unknown.
double information_form(const DenseBlanket& blanket, const std::vector<int>& begin, int i, int j,
                        double epsilon) {
  const Matrix L = information(blanket);
  std::vector<int> kept, others;
  for (int node = 0; node + 1 < static_cast<int>(begin.size()); ++node) {
    for (int k = begin[node]; k < begin[node + 1]; ++k)
      (node == i || node == j ? kept : others).push_back(k);
  }
  Matrix pair = L(kept, kept);
  if (!others.empty()) {
    const Matrix across = L(kept, others);
    pair -= across * Matrix(L(others, others)).ldlt().solve(across.transpose());
  }
  // `kept` is in the order of the nodes; which of the two is first makes no difference.
  const int m = begin[std::min(i, j) + 1] - begin[std::min(i, j)];
  const auto n = pair.rows() - m;
  const Matrix first = pair.topLeftCorner(m, m), across = pair.topRightCorner(m, n);
  const Matrix I = epsilon * Matrix::Identity(m, m);
  // The inverse has no εI: where i and j determine each other only, nothing but εI is left.
  const Eigen::SelfAdjointEigenSolver<Matrix> second(pair.bottomRightCorner(n, n));
  const double least = 1e-12 * std::max(second.eigenvalues()[n - 1], 0.0);
  const Vector inverse = (second.eigenvalues().array() > least)
                             .select(second.eigenvalues().cwiseInverse(), Vector::Zero(n));
  const Matrix known =
      dense::congruent(across, dense::from_eigenvalues(second.eigenvectors(), inverse));
  return 0.5 * (log_determinant(first + I) - log_determinant(first - known + I));
}

/// The models of pairs of nodes, each with a weight.
template <class Weight>
std::vector<Pair> weighted_pairs(const DenseBlanket& blanket, const Weight& weight) {
  std::vector<Pair> pairs;
  for (const int k : pair_models(blanket)) {
    const std::vector<int>& nodes = blanket.models[k].nodes;
    pairs.push_back({k, weight(nodes[0], nodes[1])});
  }
  std::ranges::stable_sort(pairs, std::greater{}, &Pair::weight);
  return pairs;
}

std::vector<Pair> by_matrix(const DenseBlanket& blanket, const Matrix& weights) {
  return weighted_pairs(blanket, [&](int i, int j) { return weights(i, j); });
}

/// Σ̂ without what the factors of a tree tell: (T 4.23), or exactly.
Matrix downdated(const DenseBlanket& blanket, const std::vector<FactorChoice>& tree,
                 const TopologyOptions& options, Downdate how) {
  const int d = blanket.size();
  const Matrix S = regularized_covariance(blanket, options);
  Matrix grown = S, left = information(blanket);
  const BlanketProjection projection = project(blanket, Projection::node);
  for (const FactorChoice& choice : tree) {
    const auto J = jacobian(blanket.models[choice.front()], d);
    const Matrix JT = dense::product(J, coordinates(projection, d));
    const Matrix spread = dense::product_with_transpose(JT, JT);  // Ω⁻¹ by (T 4.4)
    if (how == Downdate::exact) {
      left -= dense::congruent_of_transpose(J, spread.inverse());
    } else {
      const Matrix SJt = dense::product_with_transpose(S, J);
      Matrix sum = spread;
      dense::add_product(J, SJt, sum);
      grown += SJt * sum.llt().solve(SJt.transpose());
    }
  }
  if (how == Downdate::sum) return grown;
  // A tree alone claims more than all of Λ in some directions, so what is left may be negative.
  return nearest_positive(left, epsilon_of(blanket, options)).inverse();
}

}  // namespace

Matrix mutual_information(const DenseBlanket& blanket, const TopologyOptions& options) {
  const int n = static_cast<int>(std::ssize(blanket.node_sizes));
  const std::vector<int> begin = blanket.offsets();
  Matrix result = Matrix::Zero(n, n);
  const bool by_covariance = options.regularization == Regularization::covariance;
  const Matrix S = by_covariance ? regularized_covariance(blanket, options) : Matrix();
  const double epsilon = epsilon_of(blanket, options);
  for (int i = 0; i < n; ++i) {
    for (int j = i + 1; j < n; ++j) {
      result(i, j) = result(j, i) =
          by_covariance
              ? cairn::mutual_information(pair_block(S, begin, i, j), blanket.node_sizes[i])
              : information_form(blanket, begin, i, j, epsilon);
    }
  }
  return result;
}

std::vector<FactorChoice> ChowLiuTree::choose(const DenseBlanket& blanket, int /*population*/) {
  return tree_first(blanket, by_matrix(blanket, mutual_information(blanket, options_)),
                    tree_size(blanket));
}

std::vector<FactorChoice> DenseConstraint::choose(const DenseBlanket& blanket, int /*population*/) {
  if (blanket.models.size() != 1) {
    throw Error(ErrorCode::usage,
                "topology glc has one factor on all nodes of a blanket, and this one has models of "
                "its pairs only: take another topology");
  }
  return {{0}};
}

std::vector<FactorChoice> MutualInformation::choose(const DenseBlanket& blanket, int population) {
  return tree_first(blanket, by_matrix(blanket, mutual_information(blanket, options_)), population);
}

std::vector<FactorChoice> DowndatedInformation::choose(const DenseBlanket& blanket,
                                                       int population) {
  std::vector<FactorChoice> chosen = ChowLiuTree::choose(blanket, population);
  if (static_cast<int>(std::ssize(chosen)) >= population) return chosen;
  const Matrix S = downdated(blanket, chosen, options_, downdate_);
  const std::vector<int> begin = blanket.offsets();
  const std::vector<Pair> pairs = weighted_pairs(blanket, [&](int i, int j) {
    return cairn::mutual_information(pair_block(S, begin, i, j), blanket.node_sizes[i]);
  });
  fill_up(blanket, pairs, population, chosen);
  return chosen;
}

std::vector<FactorChoice> ExpectedDivergence::choose(const DenseBlanket& blanket, int population) {
  std::vector<FactorChoice> chosen = ChowLiuTree::choose(blanket, population);
  if (static_cast<int>(std::ssize(chosen)) >= population) return chosen;
  std::vector<bool> taken(blanket.models.size());
  for (const FactorChoice& choice : chosen) taken[choice.front()] = true;
  std::vector<Candidate> candidates;
  for (const int k : pair_models(blanket)) {
    if (!taken[k]) candidates.push_back({k, 1});
  }
  const int budget = population - static_cast<int>(std::ssize(chosen));
  return grow(blanket, std::move(chosen), candidates, budget, {});
}

std::vector<FactorChoice> ExpectedDivergence::grow(const DenseBlanket& blanket,
                                                   std::vector<FactorChoice> chosen,
                                                   const std::vector<Candidate>& candidates,
                                                   int budget,
                                                   const std::function<bool(int, int)>& excludes) {
  // All models at once: those that are not chosen weigh nothing yet.
  const int begun = static_cast<int>(std::ssize(chosen));
  std::vector<FactorChoice> all = chosen;
  int sum = 0;
  for (const Candidate& candidate : candidates) {
    all.push_back({candidate.model});
    sum += candidate.cost;
  }
  if (sum <= budget && !excludes) return all;
  const RecoveryProblem problem = project(blanket, Projection::node).problem(blanket, all);
  const ScaledProblem scaled(problem);
  Approximation at(scaled);
  std::vector<Matrix> W;
  for (int k = 0; k < scaled.factors(); ++k) {
    const int m = scaled.size(k);
    W.push_back(k < begun ? Matrix(Matrix::Identity(m, m)) : Matrix(Matrix::Zero(m, m)));
  }
  if (!at.set(std::move(W))) return chosen;
  std::vector<int> in(chosen.size()), open(candidates.size());
  std::iota(in.begin(), in.end(), 0);
  std::iota(open.begin(), open.end(), begun);
  const auto cost = [&](int k) { return candidates[k - begun].cost; };
  // The factors chosen before are relaxed: each had its optimum with those that were there then,
  // and together they would claim more and more, so that further gains would be misjudged.
  const auto relax = [&] {
    at.follow(in);
    for (int pass = 0; pass < kRelaxations; ++pass) {
      for (const int k : in) {
        check_interruption();
        at.change(k, at.best(k).W);
      }
    }
    at.follow_all();
  };
  double relax_at = 0.0;
  while (true) {
    std::erase_if(open, [&](int k) { return cost(k) > budget; });
    if (open.empty()) return chosen;
    Approximation::Best best;
    double most = 0.0;  // per cost
    auto which = open.end();
    for (auto k = open.begin(); k != open.end(); ++k) {
      check_interruption();
      if (which != open.end() && at.bound(*k) <= most * cost(*k)) continue;
      Approximation::Best tried = at.best(*k);
      if (which == open.end() || tried.gain > most * cost(*k)) {
        most = tried.gain / cost(*k);
        best = std::move(tried);
        which = k;
      }
    }
    const int added = *which;
    at.change(added, best.W);
    in.push_back(added);
    chosen.push_back(all[added]);
    budget -= cost(added);
    if (budget <= 0) return chosen;
    open.erase(which);
    if (excludes) {
      std::erase_if(open, [&](int k) { return excludes(all[added].front(), all[k].front()); });
    }
    if (static_cast<double>(std::ssize(in)) >= relax_at) {
      relax();
      relax_at = (1.0 + kGrowth) * static_cast<double>(std::ssize(in));
    }
  }
}

std::vector<FactorChoice> OffDiagonalDeterminant::choose(const DenseBlanket& blanket,
                                                         int population) {
  const std::vector<int> begin = blanket.offsets();
  const auto L = information(blanket);
  const std::vector<Pair> pairs = weighted_pairs(blanket, [&](int i, int j) {
    const int m = blanket.node_sizes[i], n = blanket.node_sizes[j];
    const Matrix block = L.block(begin[i], begin[j], m, n);
    return m == n ? std::abs(block.determinant()) : block.norm();
  });
  return tree_first(blanket, pairs, population);
}

std::vector<FactorChoice> SparseInverse::choose(const DenseBlanket& blanket, int population) {
  const int d = blanket.size();
  // In units in which every variance is 1, or λ would mean another thing for metres and radians.
  Matrix S = regularized_covariance(blanket, options_);
  const Vector scale = S.diagonal().cwiseSqrt().cwiseInverse();
  S = (scale.asDiagonal() * S * scale.asDiagonal()).eval();
  const Matrix off = S - Matrix(S.diagonal().asDiagonal());
  const double lambda = weight_ * off.cwiseAbs().maxCoeff();
  Matrix Z = Matrix::Identity(d, d), U = Matrix::Zero(d, d);
  double rho = 1.0;
  for (int k = 0; k < 500; ++k) {
    check_interruption();
    const Eigen::SelfAdjointEigenSolver<Matrix> eigen(Matrix(rho * (Z - U) - S));
    const Vector x =
        (eigen.eigenvalues().array() + (eigen.eigenvalues().array().square() + 4.0 * rho).sqrt()) /
        (2.0 * rho);
    const Matrix X = dense::from_eigenvalues(eigen.eigenvectors(), x);
    const Matrix before = Z, sum = X + U;
    Z = sum.array().sign() * (sum.array().abs() - lambda / rho).max(0.0);
    U += X - Z;
    const double primal = (X - Z).norm(), dual = rho * (Z - before).norm();
    if (primal + dual < 1e-6 * d) break;
    // Boyd, Parikh, Chu, Peleato and Eckstein 2011, section 3.4.1.
    const double factor = primal > 10.0 * dual ? 2.0 : dual > 10.0 * primal ? 0.5 : 1.0;
    rho *= factor;
    U /= factor;
  }
  const std::vector<int> begin = blanket.offsets();
  return tree_first(
      blanket,
      weighted_pairs(
          blanket,
          [&](int i, int j) {
            return Z.block(begin[i], begin[j], blanket.node_sizes[i], blanket.node_sizes[j]).norm();
          }),
      population);
}

std::vector<FactorChoice> Cliquey::choose(const DenseBlanket& blanket, int population) {
  const std::vector<FactorChoice> tree = ChowLiuTree::choose(blanket, population);
  // Edges that share a node, in the order of the tree: the strongest is paired first. Only whole
  // relative poses are: priors and what measures landmarks stay as they are.
  std::vector<FactorChoice> chosen;
  std::vector<bool> taken(tree.size());
  const auto nodes = [&](std::size_t k) -> const std::vector<int>& {
    return blanket.models[tree[k].front()].nodes;
  };
  const auto whole = [&](std::size_t k) {
    return nodes(k).size() == 2 &&
           blanket.models[tree[k].front()].size == blanket.node_sizes.front();
  };
  for (std::size_t i = 0; i < tree.size(); ++i) {
    if (taken[i]) continue;
    taken[i] = true;
    chosen.push_back(tree[i]);
    for (std::size_t j = i + 1; whole(i) && j < tree.size(); ++j) {
      if (taken[j] || !whole(j) || std::ranges::find_first_of(nodes(i), nodes(j)) == nodes(i).end())
        continue;
      taken[j] = true;
      chosen.back().push_back(tree[j].front());
      break;
    }
  }
  return chosen;
}

std::vector<FactorChoice> Exhaustive::choose(const DenseBlanket& blanket, int population) {
  const std::vector<Pair> pairs = weighted_pairs(blanket, [](int, int) { return 0.0; });
  const int all = static_cast<int>(std::ssize(pairs));
  // The prior is in all of them.
  std::vector<FactorChoice> prior = tree_first(blanket, pairs, 0);
  std::erase_if(prior, [&](const FactorChoice& choice) {
    return blanket.models[choice.front()].nodes.size() > 1;
  });
  const int priors = static_cast<int>(std::ssize(prior));
  const int count = std::clamp(population - priors, tree_size(blanket) - priors, all);
  double topologies = 1.0;
  for (int k = 0; k < count; ++k) topologies *= static_cast<double>(all - k) / (k + 1);
  instead_ = topologies > static_cast<double>(most_);
  if (instead_) {
    if (beyond_ == Beyond::ekld) {
      ExpectedDivergence instead(options_);
      instead.watch([this] {
        check_interruption();
        return true;
      });
      return instead.choose(blanket, population);
    }
    throw Error(ErrorCode::usage,
                fmt::format("best: {} nodes have {:.3g} topologies of {} factors; at most {} are "
                            "tried (option most), since it takes every one of them",
                            blanket.node_sizes.size(), topologies, count, most_));
  }
  const BlanketProjection coordinates = project(blanket, Projection::node);
  FactorDescent descent({.initial = InitialInformation::scaled, .tolerance = 1e-4},
                        /*greedy=*/true);
  std::vector<int> picked(count);
  std::iota(picked.begin(), picked.end(), 0);
  std::vector<FactorChoice> best;
  double least = std::numeric_limits<double>::infinity();
  while (true) {
    check_interruption();
    std::vector<FactorChoice> topology = prior;
    for (const int k : picked) topology.push_back({pairs[k].model});
    try {
      const double kld = descent.recover(coordinates.problem(blanket, topology)).kld;
      if (kld < least) {
        least = kld;
        best = topology;
      }
    } catch (const Error&) {  // does not connect all nodes
    }
    int k = count - 1;
    while (k >= 0 && picked[k] == all - count + k) --k;
    if (k < 0) break;
    ++picked[k];
    for (int next = k + 1; next < count; ++next) picked[next] = picked[next - 1] + 1;
  }
  if (best.empty())
    throw Error(ErrorCode::usage, "the nodes of a blanket cannot be connected by relative factors");
  return best;
}

std::string Exhaustive::note() const {
  if (!instead_) return {};
  return fmt::format(
      "the topology is that of ekld instead of best, since there are more than {} to try (its "
      "options most and beyond)",
      most_);
}

}  // namespace cairn::sparsify
