// SPDX-License-Identifier: BSD-3-Clause
// How long linearising and chi2 take per factor of each type, one factor at a time and with each
// width of packs that this machine has: the table "Several factors at a time" of
// docs/performance.md. One thread; widths take turns, figures are medians over the rounds.
//
//   cairn_linearize_rates [FACTORS] [ROUNDS]
#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "bundle/camera.hpp"
#include "bundle/reprojection.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/runtime/threads.hpp"
#include "slam2d/bearing_range.hpp"
#include "slam2d/landmark.hpp"
#include "slam2d/relative_pose.hpp"
#include "slam3d/landmark.hpp"
#include "slam3d/relative_pose.hpp"

namespace {

using namespace cairn;
using Clock = std::chrono::steady_clock;

/// The factor of docs/plugins.md.
struct Range {
  static constexpr std::string_view kTag = "EDGE_RANGE_SE2_XY";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<Se2, PointXY>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 3>& pose, const Vector<S, 2>& beacon,
                               const Measured<S, 1>& measured) {
    using std::sqrt;
    const S dx = beacon[0] - pose[0], dy = beacon[1] - pose[1];
    return Vector<S, 1>(sqrt(dx * dx + dy * dy) - measured[0]);
  }
};

std::mt19937_64 engine(7);
double uniform(double low, double high) {
  return low + (high - low) * (static_cast<double>(engine() >> 11) * 0x1p-53);
}

/// Within 10 m of the origin, turned by anything.
template <class V>
Vector<double, V::kAmbient> random_state(double range, double turn) {
  Vector<double, V::kTangent> delta;
  constexpr int kTurns = V::kOriented ? (V::kDimension == 2 ? 1 : 3) : 0;
  for (int k = 0; k < V::kTangent; ++k)
    delta[k] = uniform(-1.0, 1.0) * (k < V::kTangent - kTurns ? range : turn);
  Vector<double, V::kAmbient> x = V::template retract<double>(V::identity(), delta);
  if constexpr (std::is_same_v<V, bundle::Camera>) x.template head<3>() << 500.0, 1e-3, 1e-4;
  V::normalize(x);
  return x;
}

double median(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + std::ssize(v) / 2, v.end());
  return v[v.size() / 2];
}

/// Adds up the time that is spent in `linearize` itself, without what the linearizer does around.
class Timed final : public FactorType {
 public:
  explicit Timed(std::shared_ptr<const FactorType> type) : type_(std::move(type)) {}
  mutable double seconds = 0.0;

  void linearize(const FactorView& pool, std::size_t begin, std::size_t end, const double* weights,
                 const LinearizeSink& sink, double* norms) const override {
    const Clock::time_point start = Clock::now();
    type_->linearize(pool, begin, end, weights, sink, norms);
    seconds += std::chrono::duration<double>(Clock::now() - start).count();
  }
  void squared_norms(const FactorView& pool, std::size_t begin, std::size_t end,
                     double* out) const override {
    type_->squared_norms(pool, begin, end, out);
  }
  std::string_view tag() const override { return type_->tag(); }
  int arity() const override { return type_->arity(); }
  std::span<const std::string_view> variable_tags() const override {
    return type_->variable_tags();
  }
  int residual_size() const override { return type_->residual_size(); }
  int measurement_size() const override { return type_->measurement_size(); }
  int tangent_size(int variable) const override { return type_->tangent_size(variable); }
  int ambient_size(int variable) const override { return type_->ambient_size(variable); }
  std::string normalize(double* z) const override { return type_->normalize(z); }
  void evaluate(const double* const* x, const double* z, const double* u, double* r,
                double* const* J) const override {
    type_->evaluate(x, z, u, r, J);
  }
  bool propagate(int target, const double* const* x, const double* z, double* out) const override {
    return type_->propagate(target, x, z, out);
  }
  bool is_relative() const override { return type_->is_relative(); }

 private:
  std::shared_ptr<const FactorType> type_;
};

template <class F>
void measure(const char* label, std::size_t factors, int rounds) {
  using A = std::tuple_element_t<0, typename F::Variables>;
  using B = std::tuple_element_t<1, typename F::Variables>;
  const auto type = std::make_shared<Timed>(define_factor<F>());
  const std::shared_ptr<const VariableType> a = define_variable<A>(),
                                            b = std::is_same_v<A, B> ? a : define_variable<B>();
  const int each = static_cast<int>(factors) / 4;
  Graph graph;
  for (int k = 0; k < 2 * each; ++k) {
    if (k < each) {
      const auto x = random_state<A>(10.0, 1.7);
      graph.add_variable(a, k, {x.data(), x.data() + x.size()});
    } else {
      const auto x = random_state<B>(10.0, 1.7);
      graph.add_variable(b, k, {x.data(), x.data() + x.size()});
    }
  }
  std::vector<double> information;
  for (int row = 0; row < F::kResidual; ++row) {
    information.push_back(2.0);
    information.insert(information.end(), F::kResidual - row - 1, 0.1);
  }
  for (int f = 0; f < static_cast<int>(factors); ++f) {
    const std::array pair{f % each, each + (f + 1 + f / each * 17) % each};
    Vector<double, F::kMeasurement> z = Vector<double, F::kMeasurement>::Ones();
    const auto x = graph.state(pair[0]), y = graph.state(pair[1]);
    if constexpr (std::is_same_v<A, B>) {  // nearly what it would measure
      z = A::template compose<double>(
          A::template between<double>(Eigen::Map<const Vector<double, A::kAmbient>>(x.data()),
                                      Eigen::Map<const Vector<double, A::kAmbient>>(y.data())),
          random_state<A>(0.1, 0.05));
      A::normalize(z);
    }
    graph.add_factor(type, pair, {z.data(), z.data() + z.size()}, information);
  }

  Linearizer linearizer(graph, std::vector<bool>(graph.variable_count(), false));
  BlockMatrix H(linearizer.structure());
  std::vector<double> g(linearizer.structure().size());
  std::vector<int> widths{1};
#if CAIRN_PACKS
  const int widest = lanes::width();
  for (const int width : {4, 8}) {
    if (width <= widest) widths.push_back(width);
  }
#endif
  std::vector<std::vector<double>> inside(widths.size()), whole(widths.size()),
      norms(widths.size());
  const double per_factor = 1e9 / static_cast<double>(factors);  // [ns]
  for (int round = -3; round < rounds; ++round) {
    for (std::size_t w = 0; w < widths.size(); ++w) {
#if CAIRN_PACKS
      lanes::width() = widths[w];
#endif
      type->seconds = 0.0;
      const Clock::time_point start = Clock::now();
      linearizer.linearize(graph.values(), H, g);
      const Clock::time_point middle = Clock::now();
      linearizer.chi2(graph.values());
      const Clock::time_point end = Clock::now();
      if (round < 0) continue;  // to warm up
      inside[w].push_back(type->seconds * per_factor);
      whole[w].push_back(std::chrono::duration<double>(middle - start).count() * per_factor);
      norms[w].push_back(std::chrono::duration<double>(end - middle).count() * per_factor);
    }
  }
#if CAIRN_PACKS
  lanes::width() = widest;
#endif
  for (std::size_t w = 0; w < widths.size(); ++w) {
    const auto ratio = [&](const std::vector<std::vector<double>>& times) {
      std::vector<double> ratios;
      for (int k = 0; k < rounds; ++k) ratios.push_back(times[0][k] / times[w][k]);
      return median(ratios);
    };
    fmt::print("| {} | {} | {:.1f} | {:.2f} × | {:.1f} | {:.2f} × | {:.1f} | {:.2f} × |\n", label,
               widths[w], median(inside[w]), ratio(inside), median(whole[w]), ratio(whole),
               median(norms[w]), ratio(norms));
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::size_t factors = argc > 1 ? std::strtoul(argv[1], nullptr, 10) : 10000;
  const int rounds = argc > 2 ? std::atoi(argv[2]) : 51;
  set_threads(1);
  fmt::print(
      "| factor | at a time | its `linearize` [ns] | faster | `Linearizer::linearize` [ns] | "
      "faster "
      "| chi2 [ns] | faster |\n| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n");
  measure<slam2d::RelativePose>("`EDGE_SE2`", factors, rounds);
  measure<slam2d::Landmark>("`EDGE_SE2_XY`", factors, rounds);
  measure<slam2d::BearingRange>("`EDGE_BEARING_RANGE_SE2_XY`", factors, rounds);
  measure<slam3d::RelativePose<slam3d::Logarithm>>("`EDGE_SE3:QUAT`", factors, rounds);
  measure<slam3d::RelativePose<slam3d::QuaternionVector>>("`EDGE_SE3:QUAT`, `metric=g2o`", factors,
                                                          rounds);
  measure<slam3d::Landmark>("`EDGE_SE3_TRACKXYZ`", factors, rounds);
  measure<bundle::Reprojection>("`EDGE_PROJECT_BAL`", factors, rounds);
  measure<Range>("range, automatic", factors, rounds);
}
