// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/fixed_variables.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Core>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/factors_by_variable.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "dense/eigenvalues.hpp"
#include "dense/products.hpp"
#include "traverse.hpp"

namespace cairn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t kMostSteps = 100'000;  // of all ways that are compared
constexpr std::size_t kMostOfASet = 10;      // ways between the same variables
constexpr double kDegrees = 57.29577951308232;

/// A way of measurements between variables whose place is known, and what it says of them.
struct Way {
  Traverse traverse;
  Misclosure misclosure;
};

/// Trees of the variables that measurements place, each by the one before it. Those that are fixed
/// or have a prior on all of them are roots whose place is known; what they do not reach has roots
/// whose place is not.
class Trees {
 public:
  explicit Trees(const Graph& graph)
      : graph_(graph), nodes_(static_cast<std::size_t>(graph.variable_count())) {
    for (int v = 0; v < graph.variable_count(); ++v) {
      if (graph.fixed(v)) add_root(v, -1);
    }
    for (const FactorPool& pool : graph.factor_pools()) {
      if (pool.type->arity() != 1) continue;
      for (const int f : pool.sequence) {
        const int v = graph.factor_variables(f)[0];
        if (nodes_[v].root < 0 && determines(f, 0)) add_root(v, f);
      }
    }
    known_ = order_.size();
  }
  bool have_several_known() const { return known_ > 1; }

  /// Ways between those whose place is known, the shortest first.
  std::vector<Traverse> ways() {
    grow();
    std::vector<std::vector<int>> all = closing_factors();
    std::ranges::stable_sort(all, {},
                             [&](const std::vector<int>& closing) { return length(closing); });
    std::vector<Traverse> ways;
    std::map<std::vector<int>, std::size_t> of_a_set;
    std::size_t steps = 0;
    for (const std::vector<int>& closing : all) {
      if (of_a_set[known(closing)]++ >= kMostOfASet) continue;
      if ((steps += length(closing)) > kMostSteps) break;
      ways.push_back(way(closing));
    }
    return ways;
  }

 private:
  struct Node {
    int root = -1;  ///< −1: not reached
    int factor = -1, before = -1;
    std::size_t depth = 0, place = 0;  ///< place: in `order_`
  };

  void add_root(int v, int factor) {
    nodes_[v] = {v, factor, -1, 0, order_.size()};
    order_.push_back(v);
  }
  bool is_known(int root) const { return nodes_[root].place < known_; }

  /// Whether a factor determines its variable number `end`, the other being known.
  bool determines(int f, int end) const {
    const FactorType& type = graph_.factor_type(f);
    const auto variables = graph_.factor_variables(f);
    const VariableType& placed = graph_.type(variables[end]);
    if (type.residual_size() != placed.tangent_size() ||
        graph_.information_rank(f) < type.residual_size())
      return false;
    std::vector<const double*> x;
    for (const int v : variables) x.push_back(graph_.state(v).data());
    std::vector<double> there(graph_.state(variables[end]).begin(),
                              graph_.state(variables[end]).end());
    return type.propagate(end, x.data(), graph_.measurement(f).data(), there.data());
  }

  void grow() {
    factors_ = FactorsByVariable(graph_);
    std::size_t next = 0;
    const auto spread = [&] {
      for (; next < order_.size(); ++next) reach_from(order_[next]);
    };
    spread();
    for (const bool poses : {true, false}) {
      for (int v = 0; v < graph_.variable_count(); ++v) {
        if (nodes_[v].root >= 0 || has_orientation(graph_.type(v)) != poses) continue;
        add_root(v, -1);
        spread();
      }
    }
  }
  void reach_from(int v) {
    for (const int f : factors_[v]) {
      const auto variables = graph_.factor_variables(f);
      if (variables.size() != 2) continue;
      const int end = variables[0] == v, w = variables[end];
      if (nodes_[w].root >= 0 || !determines(f, end)) continue;
      nodes_[w] = {nodes_[v].root, f, v, nodes_[v].depth + 1, order_.size()};
      order_.push_back(w);
    }
  }

  /// Factors between trees: each that joins two whose place is known, and sets of those that join
  /// such with one whose place is not, as many as determine that and one more.
  std::vector<std::vector<int>> closing_factors() const {
    std::vector<std::vector<int>> all;
    std::map<int, std::vector<int>> loose;  // by root
    for (const int v : order_) {
      const int root = nodes_[v].root;
      for (const int f : factors_[v]) {
        const auto variables = graph_.factor_variables(f);
        if (variables.size() != 2 || graph_.information_rank(f) == 0) continue;
        const int w = variables[0] == v ? variables[1] : variables[0], other = nodes_[w].root;
        if (root == other || !is_known(other)) continue;
        if (!is_known(root)) {
          loose[root].push_back(f);
        } else if (v < w) {
          all.push_back({f});
        }
      }
    }
    for (const auto& [root, factors] : loose) add_sets(root, factors, all);
    return all;
  }
  void add_sets(int root, const std::vector<int>& factors,
                std::vector<std::vector<int>>& all) const {
    constexpr std::size_t kNear = 200;  // how far along the tree the others are looked for
    const int unknowns = graph_.type(root).tangent_size();
    for (std::size_t k = 0; k < factors.size(); ++k) {
      const auto near = std::span(factors).subspan(k, std::min(kNear, factors.size() - k));
      std::vector<int> set;
      std::set<int> roots;
      int rank = 0;
      for (const bool others : {true, false}) {  // first one of each tree, then any
        for (const int f : near) {
          if (rank > unknowns) break;
          const int of = known({f}).front();
          if (std::ranges::find(set, f) != set.end() || (others && roots.contains(of))) continue;
          set.push_back(f);
          roots.insert(of);
          rank += graph_.information_rank(f);
        }
      }
      if (roots.size() > 1) all.push_back(std::move(set));
    }
  }

  /// The roots whose place is known of what these factors join, rising.
  std::vector<int> known(const std::vector<int>& closing) const {
    std::set<int> roots;
    for (const int f : closing) {
      for (const int v : graph_.factor_variables(f)) {
        if (is_known(nodes_[v].root)) roots.insert(nodes_[v].root);
      }
    }
    return {roots.begin(), roots.end()};
  }
  std::size_t length(const std::vector<int>& closing) const {
    std::size_t steps = 0;
    for (const int f : closing) {
      for (const int v : graph_.factor_variables(f)) steps += nodes_[v].depth + 1;
    }
    return steps;
  }

  std::vector<int> from_root(int v) const {
    std::vector<int> path;
    for (; v >= 0; v = nodes_[v].before) path.push_back(v);
    std::ranges::reverse(path);
    return path;
  }
  Traverse way(const std::vector<int>& closing) const {
    Traverse traverse{{}, closing, -1, known(closing)};
    std::vector<std::vector<int>> loose;
    std::set<int> placed;
    const auto place = [&](std::span<const int> path) {
      for (const int v : path) {
        if (placed.insert(v).second) traverse.steps.push_back({v, nodes_[v].factor});
      }
    };
    for (const int f : closing) {
      for (const int v : graph_.factor_variables(f)) {
        if (is_known(nodes_[v].root)) {
          place(from_root(v));
        } else {
          loose.push_back(from_root(v));
        }
      }
    }
    if (loose.empty()) return traverse;
    std::size_t common = loose.front().size();  // of where they begin
    for (const std::vector<int>& path : loose) {
      const auto end = std::ranges::mismatch(path, loose.front()).in1;
      common = std::min(common, static_cast<std::size_t>(end - path.begin()));
    }
    traverse.loose = loose.front()[common - 1];
    placed.insert(traverse.loose);
    traverse.steps.push_back({traverse.loose, -1});
    for (const std::vector<int>& path : loose) place(std::span(path).subspan(common));
    return traverse;
  }

  const Graph& graph_;
  std::vector<Node> nodes_;  ///< by variable
  std::vector<int> order_;   ///< of being reached
  std::size_t known_ = 0;    ///< how many of them are roots whose place is known
  FactorsByVariable factors_;
};

double by_freedom(const Way& way) {
  return way.misclosure.chi2 / static_cast<double>(way.misclosure.freedoms);
}

/// What contradicts that variable v is elsewhere, where the measurements of `wrong` want it: the
/// measurements of ways that agree with where it is and not with that.
std::set<int> confirming(int v, const Way& wrong, const std::vector<Way>& ways) {
  const auto others = [&](const auto& use) {
    for (const Way& way : ways) {
      if (way.misclosure.A.contains(v) && way.misclosure.is_plausible()) use(way);
    }
  };
  const Misclosure& error = wrong.misclosure;
  const auto n = error.A.at(v).cols();
  MatrixXd H = MatrixXd::Zero(n, n);
  VectorXd g = VectorXd::Zero(n);
  const auto add = [&](const Misclosure& of) {
    const MatrixXd PA = dense::product(of.P, of.A.at(v));
    H += dense::product_of_transpose(of.A.at(v), PA);
    g -= PA.transpose() * of.b;
  };
  add(error);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> of_wrong(H);
  VectorXd delta = VectorXd::Zero(n);
  std::vector<int> left;  // directions that `wrong` says nothing of
  for (int k = 0; k < n; ++k) {
    const VectorXd axis = of_wrong.eigenvectors().col(k);
    if (of_wrong.eigenvalues()[k] > 1e-9 * of_wrong.eigenvalues()[n - 1]) {
      delta += axis * (axis.dot(g) / of_wrong.eigenvalues()[k]);
    } else {
      left.push_back(k);
    }
  }
  if (!left.empty()) {
    MatrixXd Z(n, std::ssize(left));
    for (std::size_t k = 0; k < left.size(); ++k)
      Z.col(static_cast<Eigen::Index>(k)) = of_wrong.eigenvectors().col(left[k]);
    H.setZero();
    g.setZero();
    others([&](const Way& way) { add(way.misclosure); });
    MatrixXd reduced = dense::congruent_of_transpose(Z, H);
    reduced.diagonal().array() += 1e-12 * (1.0 + H.trace());
    const Eigen::LLT<MatrixXd> llt(reduced);
    delta += Z * VectorXd(llt.solve(VectorXd(Z.transpose() * (g - H * delta))));
  }
  std::set<int> factors;
  others([&](const Way& way) {
    Misclosure moved{way.misclosure.freedoms, way.misclosure.chi2_after(v, delta), {}, {}, {}, {}};
    if (moved.is_plausible()) return;
    for (const int f : way.traverse.factors()) factors.insert(f);
  });
  return factors;
}

/// Measurements of `wrong` that no other way confirms, where none of its variables can be what is
/// wrong. Empty: one of them can.
std::vector<int> not_confirmed(const Way& wrong, const std::vector<Way>& ways) {
  std::vector<int> suspects = wrong.traverse.factors();
  for (const int v : wrong.traverse.known) {
    const std::set<int> factors = confirming(v, wrong, ways);
    if (factors.empty()) return {};
    std::erase_if(suspects, [&](int f) { return factors.contains(f); });
  }
  return suspects;
}

/// What is to be said of a way that does not close.
class Words {
 public:
  Words(const Graph& graph, const Way& way) : graph_(graph), way_(way) {}

  std::string of_variables() const {
    const bool two = way_.traverse.known.size() == 2;
    return fmt::format("{}, and contradict each other: {}. {} {}, or bring {} into one frame",
                       variables(), gap(), any_prior() ? "Place" : "Fix",
                       two ? "one of them only" : "fewer of them", two ? "both" : "all");
  }
  std::string of_measurements(const std::vector<int>& suspects) const {
    const std::string first = graph_.describe_factor(suspects.front());
    return fmt::format(
        "{}: {}, though other measurements agree with {}. {} wrong; a robust loss such as cauchy "
        "limits it",
        variables(), gap(), way_.traverse.known.size() == 2 ? "both" : "all",
        suspects.size() == 1 ? first + " is"
                             : fmt::format("{} or another of {} is", first, suspects.size()));
  }

 private:
  static std::string listed(std::vector<std::string> names) {
    const std::string last = std::move(names.back());
    names.pop_back();
    return fmt::format("{} and {}", fmt::join(names, ", "), last);
  }
  int prior(int v) const {
    const auto step = std::ranges::find(way_.traverse.steps, v, &Traverse::Step::variable);
    return step->factor;
  }
  bool any_prior() const {
    return std::ranges::any_of(way_.traverse.known, [&](int v) { return prior(v) >= 0; });
  }
  std::string variables() const {
    std::vector<std::string> names, priors;
    for (const int v : way_.traverse.known) {
      names.push_back(graph_.describe_variable(v));
      priors.push_back(prior(v) < 0 ? "FIX" : graph_.describe_factor(prior(v)));
    }
    const std::string how = names.size() == 2 ? "both fixed" : "fixed";
    return fmt::format("{} are {}", listed(names),
                       any_prior() ? "placed by " + listed(priors) : how);
  }

  /// From where a closing factor has one of its variables to where that is.
  struct Gap {
    double metres = 0.0, radians = 0.0;
    bool turns = false;
  };
  /// Zero where the factor has neither.
  Gap gap_of(int f) const {
    if (graph_.information_rank(f) < graph_.factor_type(f).residual_size()) return {};
    const auto variables = graph_.factor_variables(f);
    std::vector<const double*> x;
    for (const int v : variables) x.push_back(way_.misclosure.states.at(v).data());
    for (int end = static_cast<int>(variables.size()); end-- > 0;) {
      const VariableType& type = graph_.type(variables[end]);
      std::vector<double> there = way_.misclosure.states.at(variables[end]);
      if (!has_position(type) || !graph_.factor_type(f).propagate(
                                     end, x.data(), graph_.measurement(f).data(), there.data()))
        continue;
      const Pose wanted = pose_of(type, there);
      const Pose is = pose_of(type, way_.misclosure.states.at(variables[end]));
      return {(wanted.t - is.t).norm(), rotation_angle(wanted.R.transpose() * is.R),
              has_orientation(type)};
    }
    return {};
  }
  std::string gap() const {
    Gap worst;
    for (const int f : way_.traverse.closing) {
      if (const Gap gap = gap_of(f); gap.metres + gap.radians > worst.metres + worst.radians)
        worst = gap;
    }
    const std::size_t count = way_.traverse.factors().size();
    const bool one = count == 1, loose = way_.traverse.loose >= 0;
    std::string text =
        one ? "1 measurement between them" : fmt::format("{} measurements between them", count);
    if (worst.metres + worst.radians == 0.0) {
      return fmt::format("{} {} not fit by {:.3g} standard deviations", text, one ? "does" : "do",
                         std::sqrt(way_.misclosure.chi2));
    }
    text += fmt::format("{} {} {:.3g} m", one ? " leaves" : " leave",
                        loose ? "gaps of up to" : "a gap of", worst.metres);
    if (worst.turns) text += fmt::format(" and {:.3g}°", kDegrees * worst.radians);
    return loose ? text + " at best" : text;
  }

  const Graph& graph_;
  const Way& way_;
};

}  // namespace

std::string contradicting_fixed_variables(const Graph& graph) {
  Trees trees(graph);
  if (!trees.have_several_known()) return {};
  std::vector<Way> ways;
  for (Traverse& traverse : trees.ways()) {
    try {
      Misclosure found = call_plugin([] { return std::string("a factor"); },
                                     [&] { return misclosure(graph, traverse); });
      if (found.freedoms > 0) ways.push_back({std::move(traverse), std::move(found)});
    } catch (const Error&) {  // beside the graph's states it may not be defined
    }
  }
  const auto worst = std::ranges::max_element(ways, {}, by_freedom);
  if (worst == ways.end() || worst->misclosure.is_plausible()) return {};
  const std::vector<int> suspects = not_confirmed(*worst, ways);
  const Words words(graph, *worst);
  return suspects.empty() ? words.of_variables() : words.of_measurements(suspects);
}

}  // namespace cairn
