// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <string>
#include <tuple>
#include <utility>

#include <Eigen/Core>

#include "cairn/types/autodiff.hpp"
#include "cairn/types/define_variable.hpp"
#include "cairn/types/factor_type.hpp"

namespace cairn {

/// A factor is a struct with static sizes and one function (all functions static):
///
///     struct Range {
///       static constexpr std::string_view kTag = "EDGE_RANGE_XY";
///       static constexpr int kResidual = 1, kMeasurement = 1;
///       using Variables = std::tuple<PointXY, PointXY>;
///       template <class S>
///       static Vector<S, 1> residual(const Vector<S, 2>& a, const Vector<S, 2>& b,
///                                    const Vector<double, 1>& measured);
///     };
///
/// `residual` returns the error in the metric's units, not whitened; it is called with double and
/// with dual numbers (automatic differentiation). The struct may also have
///  - `static Vector<double, kResidual> evaluate(x…, z, J…)`: the same error and its analytic
///    Jacobians with respect to the tangent vectors, a matrix of kResidual × V::kTangent by
///    reference for each variable. Tests compare them with the automatic ones.
///  - `static std::string normalize(Vector<double, kMeasurement>& z)`: makes it canonical, or says
///    what is wrong;
///  - `static bool propagate(int target, const double* const* x, const double* z, double* out)`;
///  - `static constexpr bool kRelative = true`: z is a group element with x_1 ≈ x_0 z;
///  - `static constexpr std::string_view kMetric`: the name of the error metric.
///
/// `Variables` names the structs that describe the variables: those of `cairn/lie/` or your own.
template <class F>
concept FactorTraits = requires {
  { F::kTag } -> std::convertible_to<std::string_view>;
  { F::kResidual } -> std::convertible_to<int>;
  { F::kMeasurement } -> std::convertible_to<int>;
  std::tuple_size<typename F::Variables>::value;
};

// The loop over a pool is compiled twice where that pays: for the machine that everything is
// compiled for, and for one with AVX2, which is asked for when the program runs. Without fused
// multiplication and addition: the two then agree to the last bit.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__AVX2__)
#define CAIRN_WIDE __attribute__((target("avx2"), flatten))
#endif

namespace detail {

#if defined(CAIRN_WIDE)
inline bool has_wide() {
  static const bool has = __builtin_cpu_supports("avx2");
  return has;
}
#endif

template <class F,
          class Indices = std::make_index_sequence<std::tuple_size_v<typename F::Variables>>>
class DefinedFactor;

template <class F, std::size_t... I>
class DefinedFactor<F, std::index_sequence<I...>> final : public FactorType {
  static constexpr int kArity = sizeof...(I);
  static constexpr int kR = F::kResidual, kZ = F::kMeasurement;
  static constexpr int kU = kR * (kR + 1) / 2;
  static constexpr int kPairs = kArity * (kArity + 1) / 2;
  template <std::size_t K>
  using V = std::tuple_element_t<K, typename F::Variables>;
  using R = Vector<double, kR>;
  using Z = Vector<double, kZ>;
  template <std::size_t K>
  using X = Vector<double, V<K>::kAmbient>;
  template <std::size_t K>
  using J = Eigen::Matrix<double, kR, V<K>::kTangent>;
  using States = std::tuple<X<I>...>;
  using Jacobians = std::tuple<J<I>...>;

  static constexpr bool kAnalytic = requires(const X<I>&... x, const Z& z, J<I>&... jacobians) {
    F::evaluate(x..., z, jacobians...);
  };

  static R error(const States& x, const Z& z) {
    return F::template residual<double>(std::get<I>(x)..., z);
  }
  static R error_and_jacobians(const States& x, const Z& z, Jacobians& jacobians) {
    if constexpr (kAnalytic)
      return F::evaluate(std::get<I>(x)..., z, std::get<I>(jacobians)...);
    else
      return autodiff::evaluate<F>(x, z, jacobians);
  }

  /// U M with U upper triangular, packed row by row.
  template <class M>
  [[gnu::always_inline]] static void whiten(const double* u, M& m) {
    for (int row = 0; row < kR; ++row) {
      m.row(row) *= u[0];
      for (int k = row + 1; k < kR; ++k) m.row(row) += u[k - row] * m.row(k);
      u += kR - row;
    }
  }
  static States load_states(const FactorView& pool, std::size_t f) {
    const std::int32_t* slots = pool.slots + f * kArity;
    return {load<V<I>::kAmbient>(pool.states[I] +
                                 static_cast<std::size_t>(slots[I]) * V<I>::kAmbient)...};
  }

  template <std::size_t A, std::size_t B>
  static void write_block(const Jacobians& j, double weight, const LinearizeSink& sink,
                          std::size_t pair_begin) {
    constexpr std::size_t kPair = A * kArity - A * (A - 1) / 2 + (B - A);
    const std::int64_t offset = sink.blocks[pair_begin + kPair];
    if (offset == LinearizeSink::kNone) return;
    const J<A>& a = std::get<A>(j);
    const J<B>& b = std::get<B>(j);
    constexpr int kTa = V<A>::kTangent, kTb = V<B>::kTangent;
    if (A != B && sink.transposed[pair_begin + kPair]) {
      const Eigen::Matrix<double, kTb, kTa> block = (weight * b.transpose()).lazyProduct(a);
      sink.put(offset, block);
    } else {
      const Eigen::Matrix<double, kTa, kTb> block = (weight * a.transpose()).lazyProduct(b);
      sink.put(offset, block);
    }
  }
  template <std::size_t A, std::size_t... B>
  static void write_row(const Jacobians& j, double weight, const LinearizeSink& sink,
                        std::size_t pair_begin, std::index_sequence<B...>) {
    (write_block<A, A + B>(j, weight, sink, pair_begin), ...);
  }
  template <std::size_t A>
  static void write_gradient(const Jacobians& j, const R& r, double weight,
                             const LinearizeSink& sink, std::size_t f) {
    const std::int64_t offset = sink.gradients[f * kArity + A];
    if (offset == LinearizeSink::kNone) return;
    Eigen::Map<Vector<double, V<A>::kTangent>>{sink.scratch + offset}.noalias() +=
        (-weight * std::get<A>(j).transpose()).lazyProduct(r);
  }

 public:
  std::string_view tag() const override { return F::kTag; }
  int arity() const override { return kArity; }
  std::span<const std::string_view> variable_tags() const override {
    static constexpr std::array<std::string_view, kArity> kTags{V<I>::kTag...};
    return kTags;
  }
  int residual_size() const override { return kR; }
  int measurement_size() const override { return kZ; }
  int tangent_size(int variable) const override {
    static constexpr std::array<int, kArity> kSizes{V<I>::kTangent...};
    return kSizes[variable];
  }
  int ambient_size(int variable) const override {
    static constexpr std::array<int, kArity> kSizes{V<I>::kAmbient...};
    return kSizes[variable];
  }
  std::string normalize(double* measurement) const override {
    if constexpr (requires(Z & z) { F::normalize(z); }) {
      Z z = load<kZ>(measurement);
      std::string problem = F::normalize(z);
      store<kZ>(z, measurement);
      return problem;
    }
    return {};
  }

  void squared_norms(const FactorView& pool, std::size_t begin, std::size_t end,
                     double* out) const override {
    run([&] {
      for (std::size_t f = begin; f < end; ++f) {
        R r = error(load_states(pool, f), load<kZ>(pool.measurements + f * kZ));
        whiten(pool.sqrt_information + f * kU, r);
        out[f - begin] = r.squaredNorm();
      }
    });
  }

  void linearize(const FactorView& pool, std::size_t begin, std::size_t end, const double* weights,
                 const LinearizeSink& sink, double* out_squared_norms) const override {
    run([&] { linearize_range(pool, begin, end, weights, sink, out_squared_norms); });
  }

 private:
  template <class Loop>
  static void run(const Loop& loop) {
#if defined(CAIRN_WIDE)
    if (detail::has_wide()) return run_wide(loop);
#endif
    loop();
  }
#if defined(CAIRN_WIDE)
  template <class Loop>
  CAIRN_WIDE static void run_wide(const Loop& loop) {
    loop();
  }
#endif
  static void linearize_range(const FactorView& pool, std::size_t begin, std::size_t end,
                              const double* weights, const LinearizeSink& sink,
                              double* out_squared_norms) {
    Jacobians jacobians;
    for (std::size_t f = begin; f < end; ++f) {
      R r = error_and_jacobians(load_states(pool, f), load<kZ>(pool.measurements + f * kZ),
                                jacobians);
      const double* u = pool.sqrt_information + f * kU;
      whiten(u, r);
      (whiten(u, std::get<I>(jacobians)), ...);
      if (out_squared_norms) out_squared_norms[f - begin] = r.squaredNorm();
      const double weight = weights ? weights[f - begin] : 1.0;
      (write_row<I>(jacobians, weight, sink, f * kPairs, std::make_index_sequence<kArity - I>{}),
       ...);
      (write_gradient<I>(jacobians, r, weight, sink, f), ...);
    }
  }

 public:
  void evaluate(const double* const* x, const double* measurement, const double* sqrt_information,
                double* residual, double* const* jacobians) const override {
    const States states{load<V<I>::kAmbient>(x[I])...};
    R r;
    if (jacobians) {
      Jacobians j;
      r = error_and_jacobians(states, load<kZ>(measurement), j);
      const auto write = [&]<std::size_t K>(std::integral_constant<std::size_t, K>) {
        if (!jacobians[K]) return;
        whiten(sqrt_information, std::get<K>(j));
        Eigen::Map<J<K>>{jacobians[K]} = std::get<K>(j);
      };
      (write(std::integral_constant<std::size_t, I>{}), ...);
    } else {
      r = error(states, load<kZ>(measurement));
    }
    whiten(sqrt_information, r);
    store<kR>(r, residual);
  }

  bool propagate(int target, const double* const* x, const double* z, double* out) const override {
    if constexpr (requires { F::propagate(target, x, z, out); })
      return F::propagate(target, x, z, out);
    return false;
  }
  bool is_relative() const override {
    if constexpr (requires { F::kRelative; }) return F::kRelative;
    return false;
  }
  std::string_view metric() const override {
    if constexpr (requires { F::kMetric; }) return F::kMetric;
    return {};
  }
};

}  // namespace detail

/// The factor type that a struct describes.
template <FactorTraits F>
std::shared_ptr<const FactorType> define_factor() {
  return std::make_shared<detail::DefinedFactor<F>>();
}

}  // namespace cairn
