// SPDX-License-Identifier: BSD-3-Clause
#include "tree.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <utility>

#include <fmt/core.h>
#include <boost/graph/adjacency_list.hpp>
#include <boost/graph/kruskal_min_spanning_tree.hpp>

#include "approximation.hpp"
#include "blanket_matrices.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"

namespace cairn::sparsify {
namespace {

/// By model ln |J Σ Jᵀ|, what each factor of a tree adds to twice the divergence: with (T 4.4) that
/// is ½ (Σ_k ln |J_k Σ J_kᵀ| − ln |Σ|) up to the determinant of all J, which is the same for all
/// trees where |det Ad| = 1, as of poses in the plane and in space.
Vector tree_costs(const DenseBlanket& blanket) {
  const int d = blanket.size();
  const BlanketProjection projection = project(blanket, Projection::node);
  Vector costs(std::ssize(blanket.models));
  for (std::size_t k = 0; k < blanket.models.size(); ++k) {
    const Matrix JT = dense::product(jacobian(blanket.models[k], d), coordinates(projection, d));
    costs[static_cast<Eigen::Index>(k)] = log_determinant(dense::product_with_transpose(JT, JT));
  }
  return costs;
}

/// Which pairs a spanning tree of the largest weight is made of: of poses only, with each landmark
/// at the end of one pair, since a landmark does not hold two poses together.
std::vector<FactorChoice> spanning_tree(const DenseBlanket& blanket,
                                        const std::vector<Pair>& pairs) {
  using Edge =
      boost::property<boost::edge_index_t, int, boost::property<boost::edge_weight_t, double>>;
  using Tree =
      boost::adjacency_list<boost::vecS, boost::vecS, boost::undirectedS, boost::no_property, Edge>;
  const std::size_t nodes = blanket.node_sizes.size();
  Tree graph(nodes);
  std::vector<bool> placed(nodes);
  for (int k = 0; k < static_cast<int>(std::ssize(pairs)); ++k) {
    const FactorModel& model = blanket.models[pairs[k].model];
    const int last = std::max(model.nodes[0], model.nodes[1]);
    if (blanket.is_landmark(last)) {
      if (placed[last]) continue;
      placed[last] = true;
    }
    // By rank, not by weight: ties are broken in the order of the pairs on every machine.
    boost::add_edge(static_cast<std::size_t>(model.nodes[0]),
                    static_cast<std::size_t>(model.nodes[1]), Edge(k, k), graph);
  }
  std::vector<boost::graph_traits<Tree>::edge_descriptor> tree;
  boost::kruskal_minimum_spanning_tree(graph, std::back_inserter(tree));
  if (tree.size() + 1 < nodes) {
    throw Error(
        ErrorCode::usage,
        fmt::format("the {} nodes of a blanket cannot be connected by relative factors", nodes));
  }
  std::vector<FactorChoice> chosen;
  for (const auto& edge : tree)
    chosen.push_back({pairs[boost::get(boost::edge_index, graph, edge)].model});
  return chosen;
}

}  // namespace

double log_determinant(const Matrix& A) {
  const Eigen::LLT<Matrix> llt(A);
  if (llt.info() == Eigen::Success) return 2.0 * llt.matrixLLT().diagonal().array().log().sum();
  return std::log(std::max(std::abs(A.determinant()), 1e-300));
}

std::vector<int> pair_models(const DenseBlanket& blanket) {
  std::vector<int> models;
  std::set<std::pair<int, int>> seen;
  for (int k = 0; k < static_cast<int>(std::ssize(blanket.models)); ++k) {
    const std::vector<int>& nodes = blanket.models[k].nodes;
    if (nodes.size() == 2 && seen.insert(std::minmax(nodes[0], nodes[1])).second)
      models.push_back(k);
  }
  return models;
}

std::vector<int> prior_models(const DenseBlanket& blanket) {
  std::vector<int> models;
  std::set<int> seen;
  for (int k = 0; k < static_cast<int>(std::ssize(blanket.models)); ++k) {
    const std::vector<int>& nodes = blanket.models[k].nodes;
    if (nodes.size() == 1 && seen.insert(nodes.front()).second) models.push_back(k);
  }
  return models;
}

void fill_up(const DenseBlanket& blanket, const std::vector<Pair>& pairs, int population,
             std::vector<FactorChoice>& chosen) {
  std::vector<bool> taken(blanket.models.size());
  for (const FactorChoice& choice : chosen) taken[choice.front()] = true;
  for (const Pair& pair : pairs) {
    if (static_cast<int>(std::ssize(chosen)) >= population) break;
    if (!taken[pair.model]) chosen.push_back({pair.model});
  }
}

int tree_size(const DenseBlanket& blanket) {
  return static_cast<int>(std::ssize(blanket.node_sizes)) - (blanket.absolute ? 0 : 1);
}

std::vector<FactorChoice> tree_first(const DenseBlanket& blanket, const std::vector<Pair>& pairs,
                                     int population) {
  const int nodes = static_cast<int>(std::ssize(blanket.node_sizes));
  std::vector<FactorChoice> chosen;
  if (blanket.absolute || blanket.is_landmark(nodes - 1)) {
    const Vector costs = tree_costs(blanket);
    std::vector<Pair> ranked = pairs;
    std::ranges::stable_sort(ranked, {}, [&](const Pair& pair) { return costs[pair.model]; });
    chosen = spanning_tree(blanket, ranked);
    const std::vector<int> priors = blanket.absolute ? prior_models(blanket) : std::vector<int>();
    const auto prior = std::ranges::min_element(priors, {}, [&](int k) { return costs[k]; });
    if (prior != priors.end()) chosen.push_back({*prior});
  } else {
    chosen = spanning_tree(blanket, pairs);
  }
  fill_up(blanket, pairs, population, chosen);
  return chosen;
}

}  // namespace cairn::sparsify
