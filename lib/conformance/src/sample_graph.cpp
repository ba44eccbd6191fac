// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/conformance/sample_graph.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <string_view>
#include <tuple>
#include <utility>

#include <fmt/core.h>

#include "cairn/conformance/samples.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/io/random_numbers.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/types/define_factor.hpp"
#include "cairn/types/define_variable.hpp"
#include "cairn/types/loss.hpp"
#include "dense/cholesky.hpp"

namespace cairn::conformance {
namespace {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Pose = Vector<double, 3>;

/// r = log(z⁻¹ · a⁻¹ · b), with Jacobians by automatic differentiation.
struct RelativePose {
  static constexpr std::string_view kTag = "CONFORMANCE_RELATIVE_POSE";
  static constexpr int kResidual = 3, kMeasurement = 3;
  static constexpr bool kRelative = true;
  using Variables = std::tuple<Se2, Se2>;
  template <class S>
  static Vector<S, 3> residual(const Vector<S, 3>& a, const Vector<S, 3>& b,
                               const Vector<double, 3>& z) {
    const Vector<S, 3> measured = z.cast<S>();
    return Se2::log<S>(Se2::between<S>(measured, Se2::between<S>(a, b)));
  }
  static bool propagate(int target, const double* const* x, const double* z, double* out) {
    const Pose measured = Map<const Pose>(z);
    Map<Pose>{out} =
        target == 1 ? Se2::compose<double>(Map<const Pose>(x[0]), measured)
                    : Se2::compose<double>(Map<const Pose>(x[1]), Se2::inverse<double>(measured));
    return true;
  }
};

class Logarithm final : public Loss {
 public:
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    for (std::size_t k = 0; k < rho.size(); ++k) rho[k] = std::log1p(s[k]);
    for (std::size_t k = 0; k < weight.size(); ++k) weight[k] = 1.0 / (1.0 + s[k]);
  }
  double second_derivative(double s) const override { return -1.0 / ((1.0 + s) * (1.0 + s)); }
};

std::span<const double> numbers(const Pose& pose) { return {pose.data(), 3}; }

/// H and g of a graph with its gauge fixed.
struct System {
  explicit System(const Graph& graph)
      : linearizer(graph, resolve_gauge(graph).held),
        H(linearizer.structure()),
        g(static_cast<std::size_t>(linearizer.structure().size())) {}

  MatrixXd dense() const {
    const BlockStructure& s = linearizer.structure();
    MatrixXd whole = MatrixXd::Zero(s.size(), s.size());
    for (int column = 0; column < s.blocks(); ++column) {
      const auto c = static_cast<std::size_t>(column);
      for (auto e = s.column_begin()[c]; e < s.column_begin()[c + 1]; ++e) {
        const auto r = static_cast<std::size_t>(s.rows()[static_cast<std::size_t>(e)]);
        const Map<const MatrixXd> block(H.block(e), s.sizes()[r], s.sizes()[c]);
        whole.block(s.offsets()[r], s.offsets()[c], block.rows(), block.cols()) = block;
        whole.block(s.offsets()[c], s.offsets()[r], block.cols(), block.rows()) = block.transpose();
      }
    }
    return whole;
  }

  Linearizer linearizer;
  BlockMatrix H;
  std::vector<double> g;
};

}  // namespace

PlanarTypes own_planar_types() { return {define_variable<Se2>(), define_factor<RelativePose>()}; }

Graph two_laps(int poses, std::uint64_t seed, const PlanarTypes& types) {
  RandomNumbers random(RandomNumbers::mixed(seed + 53));
  const std::array<double, 3> sigma{0.02, 0.02, 0.01};
  const std::vector<double> information{2500.0, 0.0, 0.0, 2500.0, 0.0, 10000.0};
  const int lap = poses / 2;
  const auto truth = [&](int k) {
    const double angle = 2.0 * std::numbers::pi * k / lap;
    return Pose(5.0 * std::cos(angle), 5.0 * std::sin(angle),
                wrap_angle(angle + std::numbers::pi / 2));
  };
  const auto measured = [&](int a, int b) {
    Pose noise;
    for (int k = 0; k < 3; ++k) noise[k] = sigma[static_cast<std::size_t>(k)] * random.gaussian();
    return Pose(Se2::retract<double>(Se2::between<double>(truth(a), truth(b)), noise));
  };
  Graph graph;
  Pose estimate = truth(0);
  for (int k = 0; k < poses; ++k) {
    const Pose odometry = k > 0 ? measured(k - 1, k) : Pose();
    if (k > 0) estimate = Se2::compose<double>(estimate, odometry);
    graph.add_variable(types.pose, k, numbers(estimate));
    if (k > 0) {
      graph.add_factor(types.relative_pose, std::vector{k - 1, k}, numbers(odometry), information);
    }
    if (k >= lap) {
      graph.add_factor(types.relative_pose, std::vector{k - lap, k}, numbers(measured(k - lap, k)),
                       information);
    }
  }
  return graph;
}

std::shared_ptr<const Loss> own_loss() { return std::make_shared<const Logarithm>(); }

std::string described(const Graph& graph) {
  return fmt::format("{} poses on two laps, {} relative poses", graph.variable_count(),
                     graph.factor_count());
}

std::vector<double> states_of(const Graph& graph) {
  std::vector<double> all;
  for (int v = 0; v < graph.variable_count(); ++v)
    all.insert(all.end(), graph.state(v).begin(), graph.state(v).end());
  return all;
}

bool all_finite(const Graph& graph) {
  return std::ranges::all_of(states_of(graph), [](double x) { return std::isfinite(x); });
}

double largest_distance(const Graph& some, const Graph& all) {
  double largest = 0.0;
  for (int v = 0; v < some.variable_count(); ++v) {
    const std::optional<int> other = all.find(some.id(v));
    if (!other) continue;
    State delta(3);
    some.type(v).local(1, some.state(v).data(), all.state(*other).data(), delta.data());
    const double distance = norm(delta);
    if (!(distance <= largest)) largest = distance;
  }
  return largest;
}

double minimize_densely(Graph& graph) {
  System system(graph);
  for (int k = 0; k < 50; ++k) {
    system.linearizer.linearize(graph.values(), system.H, system.g);
    const VectorXd g = Map<const VectorXd>(system.g.data(), std::ssize(system.g));
    const VectorXd step = Eigen::LDLT<MatrixXd>(system.dense()).solve(g);
    Values values;
    system.linearizer.retract(graph.values(), {step.data(), static_cast<std::size_t>(step.size())},
                              values);
    graph.set_values(std::move(values));
    if (step.norm() < 1e-11) break;
  }
  return chi2(graph);
}

DenseCovariance dense_covariance(const Graph& graph) {
  System system(graph);
  system.linearizer.linearize(graph.values(), system.H, system.g);
  const MatrixXd H = system.dense();
  DenseCovariance result;
  result.Sigma = Eigen::LDLT<MatrixXd>(H).solve(MatrixXd(MatrixXd::Identity(H.rows(), H.rows())));
  for (int v = 0; v < graph.variable_count(); ++v) {
    const int block = system.linearizer.block_of(v);
    const auto offsets = system.linearizer.structure().offsets();
    result.first.push_back(block < 0 ? -1 : offsets[static_cast<std::size_t>(block)]);
  }
  return result;
}

}  // namespace cairn::conformance
