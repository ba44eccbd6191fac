// SPDX-License-Identifier: BSD-3-Clause
#include <queue>
#include <tuple>

#include <Eigen/Core>

#include "cairn/graph/gauge.hpp"
#include "cairn/update/placement.hpp"
#include "dense/cholesky.hpp"
#include "guesses.hpp"
#include "placing.hpp"
#include "relative_poses.hpp"

namespace cairn::initial {
namespace {

/// tr Ω⁻¹, the sum of the variances of a measurement: what it costs to go along a factor.
double variance(const Graph& graph, int factor) {
  const Eigen::MatrixXd information = information_matrix(graph, factor);
  const Eigen::Index n = information.rows();
  return information.llt().solve(Eigen::MatrixXd::Identity(n, n)).trace();
}

/// A tree over the factors, from the held variables (or those with a prior) outwards: as few
/// factors as possible between a variable and its root, or as little variance.
class SpanningTree final : public InitialGuess {
 public:
  explicit SpanningTree(bool by_information) : by_information_(by_information) {}

  std::vector<std::string> compute(Graph& graph) override {
    Placing placing(graph);
    const std::vector<int> roots = placing.place_roots(resolve_gauge(graph));
    if (by_information_) {
      spread_by_variance(graph, placing, roots);
    } else {
      placing.spread(roots);
    }
    std::vector<std::string> notes;
    placing.finish(notes);
    return notes;
  }

 private:
  /// Dijkstra's shortest paths with the variance as length; the order of the factors breaks ties.
  static void spread_by_variance(const Graph& graph, Placing& placing,
                                 const std::vector<int>& roots) {
    using Step = std::tuple<double, int, int>;  // variance so far, factor, variable to place
    std::priority_queue<Step, std::vector<Step>, std::greater<>> steps;
    const auto look_around = [&](int variable, double so_far) {
      for (int f : placing.factors()[variable]) {
        if (!measures_all(graph.factor_type(f), graph.sqrt_information(f))) continue;
        for (int v : graph.factor_variables(f)) {
          if (!placing.placed(v)) steps.emplace(so_far + variance(graph, f), f, v);
        }
      }
    };
    for (int root : roots) look_around(root, 0.0);
    while (!steps.empty()) {
      const auto [so_far, factor, variable] = steps.top();
      steps.pop();
      if (!placing.placed(variable) && placing.place(variable, factor))
        look_around(variable, so_far);
    }
  }

  bool by_information_;
};

}  // namespace

std::unique_ptr<InitialGuess> make_spanning_tree(const SpanningTreeOptions& options) {
  return std::make_unique<SpanningTree>(options.weight == TreeWeight::information);
}

}  // namespace cairn::initial
