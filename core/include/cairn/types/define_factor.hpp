// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <memory>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>

#include <Eigen/Core>

#include "cairn/pack/products.hpp"
#include "cairn/types/autodiff.hpp"
#include "cairn/types/define_variable.hpp"
#include "cairn/types/factor_type.hpp"
#include "cairn/types/member_names.hpp"
#include "cairn/types/never_throws.hpp"

namespace cairn {

/// A factor is a struct with static sizes and one function (all functions static):
///
///     struct Range {
///       static constexpr std::string_view kTag = "EDGE_RANGE_XY";
///       static constexpr int kResidual = 1, kMeasurement = 1;
///       using Variables = std::tuple<PointXY, PointXY>;
///       template <class S>
///       static Vector<S, 1> residual(const Vector<S, 2>& a, const Vector<S, 2>& b,
///                                    const Measured<S, 1>& measured);
///     };
///
/// `residual` returns the error in the metric's units, not whitened; it is called with double and
/// with dual numbers (automatic differentiation), and both with packs of several factors instead of
/// doubles (`cairn/pack/pack.hpp`). One that takes its measurement as `Vector<double, 1>` is called
/// for one factor at a time: right as well, but slower. The struct may also have
///  - `static Vector<S, kResidual> evaluate(x…, z, J…)`: the same error and its analytic
///    Jacobians with respect to the tangent vectors, a matrix of kResidual × V::kTangent by
///    reference for each variable. A template over the scalar S, or for S = double alone. Tests
///    compare them with the automatic ones.
///  - `static std::string normalize(Vector<double, kMeasurement>& z)`: makes it canonical, or says
///    what is wrong;
///  - `static bool propagate(int target, const double* const* x, const double* z, double* out)`;
///  - `static constexpr bool kRelative = true`: z is a group element with x_1 ≈ x_0 z;
///  - `static constexpr int kAbsolute`: `FactorType::absolute_size`, of a factor between variables
///    that a rigid motion of all of them changes all the same;
///  - `static constexpr std::string_view kMetric`: the name of the error metric.
/// An optional function that is there with another signature is an error of the compiler.
///
/// Where `residual`, and `evaluate` if there is one, are `noexcept`, the type `NeverThrows`: an
/// estimator then takes in its factors without keeping what it would go back to.
///
/// `Variables` names the structs that describe the variables: those of `cairn/lie/` or your own.
template <class F>
concept FactorTraits = requires {
  { F::kTag } -> std::convertible_to<std::string_view>;
  { F::kResidual } -> std::convertible_to<int>;
  { F::kMeasurement } -> std::convertible_to<int>;
  std::tuple_size<typename F::Variables>::value;
};

namespace detail {

template <class F,
          class Indices = std::make_index_sequence<std::tuple_size_v<typename F::Variables>>>
class DefinedFactor;

/// Whether a struct has an `evaluate` with analytic Jacobians as it is called.
template <class F, class... V>
constexpr bool has_evaluate(const std::tuple<V...>*) {
  return requires(const Vector<double, V::kAmbient>&... x, const Vector<double, F::kMeasurement>& z,
                  Eigen::Matrix<double, F::kResidual, V::kTangent>&... J) {
    { F::evaluate(x..., z, J...) } -> std::convertible_to<Vector<double, F::kResidual>>;
  };
}
template <class F>
concept HasEvaluate = has_evaluate<F>(static_cast<typename F::Variables*>(nullptr));
template <class F>
concept NormalizesMeasurement = requires(Vector<double, F::kMeasurement>& z) {
  { F::normalize(z) } -> std::convertible_to<std::string>;
};
template <class F>
concept HasPropagate = requires(const double* const* x, const double* z, double* out) {
  { F::propagate(0, x, z, out) } -> std::convertible_to<bool>;
};

/// Whether a struct's functions are `noexcept`.
template <class F, class... V>
constexpr bool never_throws(const std::tuple<V...>*) {
  using Z = Vector<double, F::kMeasurement>;
  constexpr bool error = noexcept(F::template residual<double>(
      std::declval<const Vector<double, V::kAmbient>&>()..., std::declval<const Z&>()));
  if constexpr (HasEvaluate<F>) {
    constexpr bool analytic = noexcept(
        F::evaluate(std::declval<const Vector<double, V::kAmbient>&>()..., std::declval<const Z&>(),
                    std::declval<Eigen::Matrix<double, F::kResidual, V::kTangent>&>()...));
    return error && analytic;
  } else {
    return error;
  }
}
struct MayThrow {};

template <class F, std::size_t... I>
class DefinedFactor<F, std::index_sequence<I...>> final
    : public FactorType,
      public std::conditional_t<never_throws<F>(static_cast<typename F::Variables*>(nullptr)),
                                NeverThrows, MayThrow> {
  static constexpr int kArity = sizeof...(I);
  static constexpr int kR = F::kResidual, kZ = F::kMeasurement;
  static constexpr int kU = kR * (kR + 1) / 2;
  static constexpr int kPairs = kArity * (kArity + 1) / 2;
  static_assert(
      !Names_evaluate<F> || HasEvaluate<F>,
      "this factor has an `evaluate` that would be ignored, since it is not called like "
      "this: static Vector<S, kResidual> evaluate(const Vector<S, V::kAmbient>& x..., "
      "const Vector<S, kMeasurement>& z, Eigen::Matrix<S, kResidual, V::kTangent>& J...), "
      "with a state x and a Jacobian J by reference for each variable V, for S = double "
      "at least");
  static_assert(!Names_normalize<F> || NormalizesMeasurement<F>,
                "this factor has a `normalize` that would be ignored, since it is not called like "
                "this: static std::string normalize(Vector<double, kMeasurement>& z)");
  static_assert(!Names_propagate<F> || HasPropagate<F>,
                "this factor has a `propagate` that would be ignored, since it is not called like "
                "this: static bool propagate(int target, const double* const* x, const double* z, "
                "double* out)");
  template <std::size_t K>
  using V = std::tuple_element_t<K, typename F::Variables>;
  // S is double, or a pack with one lane for each of several factors.
  template <class S, std::size_t K>
  using X = Vector<S, V<K>::kAmbient>;
  template <class S, std::size_t K>
  using J = Eigen::Matrix<S, kR, V<K>::kTangent>;
  template <class S>
  using States = std::tuple<X<S, I>...>;
  template <class S>
  using Jacobians = std::tuple<J<S, I>...>;
  using Places = lanes::Contribution<V<I>::kTangent...>;
  using R = Vector<double, kR>;
  using Z = Vector<double, kZ>;

  template <class S>
  static constexpr bool kAnalytic = requires(const X<S, I>&... x, const Vector<S, kZ>& z,
                                             J<S, I>&... jacobians) {
    F::evaluate(x..., z, jacobians...);
  };
  template <class S, class D = S>
  static constexpr bool kComputes = requires(const X<D, I>&... x,
                                             const lanes::Only<Vector<S, kZ>>& z) {
    F::template residual<D>(x..., z);
  };
  /// What a group holds lies on the stack: wide factors are taken one at a time.
  static constexpr bool kNarrow = Places::kNumbers + kR * (V<I>::kTangent + ...) <= 4096;
  template <class S>
  static constexpr bool kDifferentiates =
      HasEvaluate<F> ? kAnalytic<S> : kComputes<S, Dual<(V<I>::kTangent + ...), S>>;

  template <class S>
  static Vector<S, kR> error(const States<S>& x, const Vector<S, kZ>& z) {
    return F::template residual<S>(std::get<I>(x)..., z);
  }
  template <class S>
  static Vector<S, kR> error_and_jacobians(const States<S>& x, const Vector<S, kZ>& z,
                                           Jacobians<S>& jacobians) {
    if constexpr (HasEvaluate<F>)
      return F::evaluate(std::get<I>(x)..., z, std::get<I>(jacobians)...);
    else
      return autodiff::evaluate<F>(x, z, jacobians);
  }

  /// Factors of a pool, one for each lane: their errors, whitened, and if asked for their
  /// Jacobians. The last factor stands in where there are too few.
  template <class S, bool kWithJacobians>
  struct Group {
    static constexpr int kWidth = lanes::kWidth<S>;
    Vector<S, kR> r;
    Jacobians<S> jacobians;

    Group(const FactorView& pool, std::size_t first, std::size_t end) {
      std::size_t factors[kWidth];
      for (int l = 0; l < kWidth; ++l) factors[l] = std::min(first + l, end - 1);
      if constexpr (kWidth == 1) {
        r = evaluate(pool, factors, jacobians);
      } else {
        // All lanes at once; where a branch divides them, then each by itself, in all lanes.
        for (int lane = -1; lane < kWidth; ++lane) {
          std::size_t chosen[kWidth];
          for (int l = 0; l < kWidth; ++l) chosen[l] = factors[lane < 0 ? l : lane];
          S::diverged = false;
          Jacobians<S> J_now;
          const Vector<S, kR> r_now = evaluate(pool, chosen, J_now);
          if (lane < 0) {
            r = r_now;
            if constexpr (kWithJacobians) jacobians = J_now;
            if (!S::diverged) [[likely]]
              break;
          } else {
            lanes::merge_lane(lane, r_now, r);
            if constexpr (kWithJacobians)
              (lanes::merge_lane(lane, std::get<I>(J_now), std::get<I>(jacobians)), ...);
          }
        }
      }
      for (std::size_t& f : factors) f = pool.noise(f);
      const Vector<S, kU> u =
          lanes::load_entries_often_equal<S, kU>(pool.sqrt_information, factors);
      lanes::whiten(u.data(), r);
      if constexpr (kWithJacobians) (lanes::whiten(u.data(), std::get<I>(jacobians)), ...);
    }

   private:
    static Vector<S, kR> evaluate(const FactorView& pool, const std::size_t* factors,
                                  Jacobians<S>& j) {
      std::int32_t slots[kArity][kWidth];
      for (int k = 0; k < kArity; ++k) {
        for (int l = 0; l < kWidth; ++l) slots[k][l] = pool.slots[factors[l] * kArity + k];
      }
      const States<S> x{lanes::load_entries<S, V<I>::kAmbient>(pool.states[I], slots[I])...};
      const Vector<S, kZ> z = lanes::load_entries<S, kZ>(pool.measurements, factors);
      if constexpr (kWithJacobians)
        return error_and_jacobians<S>(x, z, j);
      else
        return error<S>(x, z);
    }
  };

  /// `transposed`: how the block of the group's first lane lies, and with it those of all.
  template <class S, std::size_t A, std::size_t B>
  static void put_block(const double* values, bool transposed, const LinearizeSink& sink,
                        std::size_t f) {
    constexpr int kPair = Places::pair(A, B), kTa = V<A>::kTangent, kTb = V<B>::kTangent;
    const LinearizeTarget target = sink.blocks[f * kPairs + kPair];
    if (target.is_none()) return;
    double* to = sink.at(target);
    if (A == B || target.transposed() == transposed) [[likely]]
      lanes::put_part<S, Places, kPair>(values, target.adds(), to);
    else if (transposed)
      lanes::put_turned<S, Places, kPair, kTb, kTa>(values, target.adds(), to);
    else
      lanes::put_turned<S, Places, kPair, kTa, kTb>(values, target.adds(), to);
  }
  template <class S, std::size_t A>
  static void put_gradient(const double* values, const LinearizeSink& sink, std::size_t f) {
    const LinearizeTarget target = sink.gradients[f * kArity + A];
    if (target.is_none()) return;
    lanes::put_part<S, Places, kPairs + A>(values, target.adds(), sink.at(target));
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
    if constexpr (NormalizesMeasurement<F>) {
      Z z = load<kZ>(measurement);
      std::string problem = F::normalize(z);
      store<kZ>(z, measurement);
      return problem;
    }
    return {};
  }

  void squared_norms(const FactorView& pool, std::size_t begin, std::size_t end,
                     double* out) const override {
    lanes::for_machine<kComputes<lanes::Widest>>([&]<class S>() {
      for (std::size_t f = begin; f < end; f += lanes::kWidth<S>) {
        lanes::store(lanes::squared_norm(Group<S, false>(pool, f, end).r), end - f,
                     out + (f - begin));
      }
    });
  }

  void linearize(const FactorView& pool, std::size_t begin, std::size_t end, const double* weights,
                 const LinearizeSink& sink, double* out_squared_norms) const override {
    lanes::for_machine<kNarrow && kDifferentiates<lanes::Widest>>([&]<class S>() {
      for (std::size_t f = begin; f < end; f += lanes::kWidth<S>) {
        const std::size_t count = std::min<std::size_t>(end - f, lanes::kWidth<S>);
        linearize_group<S>(pool, f, count, weights ? weights + (f - begin) : nullptr, sink,
                           out_squared_norms ? out_squared_norms + (f - begin) : nullptr);
      }
    });
  }

 private:
  template <class S>
  static void linearize_group(const FactorView& pool, std::size_t first, std::size_t count,
                              const double* weights, const LinearizeSink& sink,
                              double* out_squared_norms) {
    constexpr int kWidth = lanes::kWidth<S>,
                  kPadded = (Places::kNumbers + kWidth - 1) / kWidth * kWidth;
    const Group<S, true> group(pool, first, first + count);
    S weight = 1.0;
    if (weights) weight = lanes::load<S>(weights, count);
    const LinearizeTarget* targets = sink.blocks + first * kPairs;  // of the first lane

    S numbers[kPadded];
    lanes::for_pairs<kArity>([&]<std::size_t A, std::size_t B>() {
      constexpr int kPair = Places::pair(A, B);
      const auto out = [&](int k) -> S& { return numbers[Places::place(kPair, k)]; };
      const auto& J_a = std::get<A>(group.jacobians);
      const auto& J_b = std::get<B>(group.jacobians);
      if (A != B && targets[kPair].transposed())
        lanes::multiply<A == B, A != B>(J_a, J_b, weight, out);
      else
        lanes::multiply<A == B, false>(J_a, J_b, weight, out);
    });
    (lanes::multiply_gradient(std::get<I>(group.jacobians), group.r, weight,
                              [&](int k) -> S& { return numbers[Places::place(kPairs + I, k)]; }),
     ...);
    constexpr int kNorm = Places::place(kPairs + kArity, 0);
    numbers[kNorm] = lanes::squared_norm(group.r);
    for (int k = Places::kNumbers; k < kPadded; ++k) numbers[k] = 0.0;

    const lanes::Separate<S, kPadded> separate(numbers);
    for (std::size_t l = 0; l < count; ++l) {
      const double* values = separate.lane(l);
      lanes::for_pairs<kArity>([&]<std::size_t A, std::size_t B>() {
        put_block<S, A, B>(values, targets[Places::pair(A, B)].transposed(), sink, first + l);
      });
      (put_gradient<S, I>(values, sink, first + l), ...);
      if (out_squared_norms) out_squared_norms[l] = values[kNorm];
    }
  }

 public:
  void evaluate(const double* const* x, const double* measurement, const double* sqrt_information,
                double* residual, double* const* jacobians) const override {
    const States<double> states{load<V<I>::kAmbient>(x[I])...};
    R r;
    if (jacobians) {
      Jacobians<double> j;
      r = error_and_jacobians<double>(states, load<kZ>(measurement), j);
      const auto write = [&]<std::size_t K>(std::integral_constant<std::size_t, K>) {
        if (!jacobians[K]) return;
        lanes::whiten(sqrt_information, std::get<K>(j));
        Eigen::Map<J<double, K>>{jacobians[K]} = std::get<K>(j);
      };
      (write(std::integral_constant<std::size_t, I>{}), ...);
    } else {
      r = error<double>(states, load<kZ>(measurement));
    }
    lanes::whiten(sqrt_information, r);
    store<kR>(r, residual);
  }

  bool propagate(int target, const double* const* x, const double* z, double* out) const override {
    if constexpr (HasPropagate<F>) return F::propagate(target, x, z, out);
    return false;
  }
  bool is_relative() const override {
    if constexpr (requires { F::kRelative; }) return F::kRelative;
    return false;
  }
  int absolute_size() const override {
    if constexpr (requires { F::kAbsolute; }) return F::kAbsolute;
    return FactorType::absolute_size();
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
