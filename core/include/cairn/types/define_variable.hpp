// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>
#include <memory>
#include <string>

#include <Eigen/Core>

#include "cairn/pack/dual.hpp"
#include "cairn/pack/products.hpp"
#include "cairn/types/member_names.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn {

template <class S, int N>
using Vector = Eigen::Matrix<S, N, 1>;

/// The measurement of a factor whose residual is computed with scalars S: plain numbers, or packs.
template <class S, int N>
using Measured = Vector<ValueOf<S>, N>;

/// What a struct must have to describe a variable (all functions static):
///
///     struct PointXY {
///       static constexpr std::string_view kTag = "VERTEX_XY";
///       static constexpr int kAmbient = 2;  // doubles stored
///       static constexpr int kTangent = 2;  // degrees of freedom
///       static Vector<double, 2> identity();
///       template <class S>
///       static Vector<S, 2> retract(const Vector<S, 2>& x, const Vector<S, 2>& delta);
///       template <class S>
///       static Vector<S, 2> local(const Vector<S, 2>& x, const Vector<S, 2>& y);
///     };
///
/// It may also have
///  - `static std::string normalize(Vector<double, kAmbient>& x)`: makes it canonical, or says what
///    is wrong;
///  - the group operations `compose(a, b)`, `inverse(a)`, `adjoint(a)` (tangent × tangent),
///    `exp(delta)`, `log(a)`: then the type has the ability `LieGroup`;
///  - `retract_jacobian(x, delta)` (tangent × tangent, see `VariableType`): else it is found by
///    differentiating `retract` and `local`;
///  - `static constexpr int kDimension`, `kOriented` and `rotation(x)` (kOriented only),
///    `position(x)`, `from_placement(R, t)` (R ignored by points): then it has the ability
///    `Placement`;
///  - `static constexpr bool kPacks = true`: `retract` takes packs as well (`cairn/pack/pack.hpp`),
///    and is called for several states at a time.
/// A `normalize` or `retract_jacobian` with another signature is an error of the compiler.
template <class V>
concept VariableTraits = requires(const Vector<double, V::kAmbient>& x,
                                  const Vector<double, V::kTangent>& delta) {
  { V::kTag } -> std::convertible_to<std::string_view>;
  { V::identity() } -> std::convertible_to<Vector<double, V::kAmbient>>;
  { V::template retract<double>(x, delta) } -> std::convertible_to<Vector<double, V::kAmbient>>;
  { V::template local<double>(x, x) } -> std::convertible_to<Vector<double, V::kTangent>>;
};

namespace detail {

template <int N>
Vector<double, N> load(const double* p) {
  return Eigen::Map<const Vector<double, N>>(p);
}
template <int N>
void store(const Vector<double, N>& v, double* p) {
  Eigen::Map<Vector<double, N>>{p} = v;
}

template <class V>
concept HasNormalize = requires(Vector<double, V::kAmbient>& x) {
  { V::normalize(x) } -> std::convertible_to<std::string>;
};
template <class V>
concept HasRetractJacobian = requires(const Vector<double, V::kAmbient>& x,
                                      const Vector<double, V::kTangent>& delta) {
  {
    V::retract_jacobian(x, delta)
    } -> std::convertible_to<Eigen::Matrix<double, V::kTangent, V::kTangent>>;
};
template <class V>
concept HasGroup = requires(const Vector<double, V::kAmbient>& a) {
  V::template compose<double>(a, a);
  V::template inverse<double>(a);
  V::adjoint(a);
};
template <class V>
concept HasPlacement = requires {
  V::kDimension;
  V::kOriented;
};

template <class V>
class GroupOf final : public LieGroup {
  static constexpr int kA = V::kAmbient, kT = V::kTangent;

 public:
  void compose(const double* a, const double* b, double* ab) const override {
    store<kA>(V::template compose<double>(load<kA>(a), load<kA>(b)), ab);
  }
  void inverse(const double* a, double* out) const override {
    store<kA>(V::template inverse<double>(load<kA>(a)), out);
  }
  void adjoint(const double* a, double* Ad) const override {
    Eigen::Map<Eigen::Matrix<double, kT, kT>>{Ad} = V::adjoint(load<kA>(a));
  }
  void adjoint_between(const double* a, const double* b, double* Ad) const override {
    const Vector<double, kA> x = load<kA>(a), y = load<kA>(b);
    Eigen::Map<Eigen::Matrix<double, kT, kT>> out{Ad};
    if constexpr (requires { V::template between<double>(x, y); })
      out = V::adjoint(V::template between<double>(x, y));
    else
      out = V::adjoint(V::template compose<double>(V::template inverse<double>(x), y));
  }
  void exp(const double* delta, double* a) const override {
    store<kA>(V::template exp<double>(load<kT>(delta)), a);
  }
  void log(const double* a, double* delta) const override {
    store<kT>(V::template log<double>(load<kA>(a)), delta);
  }
};

template <class V>
class PlacementOf final : public Placement {
  static constexpr int kA = V::kAmbient, kD = V::kDimension;

 public:
  int dimension() const override { return kD; }
  bool has_orientation() const override { return V::kOriented; }
  void split(const double* x, double* R, double* t) const override {
    if constexpr (V::kOriented) {
      Eigen::Map<Eigen::Matrix<double, kD, kD>>{R} = V::rotation(load<kA>(x));
    }
    store<kD>(V::position(load<kA>(x)), t);
  }
  void join(const double* R, const double* t, double* x) const override {
    Eigen::Matrix<double, kD, kD> rotation = Eigen::Matrix<double, kD, kD>::Identity();
    if constexpr (V::kOriented) rotation = Eigen::Map<const Eigen::Matrix<double, kD, kD>>(R);
    store<kA>(V::from_placement(rotation, load<kD>(t)), x);
  }
};

template <VariableTraits V>
class DefinedVariable final : public VariableType {
  static constexpr int kA = V::kAmbient, kT = V::kTangent;
  static_assert(!Names_normalize<V> || HasNormalize<V>,
                "this variable has a `normalize` that would be ignored, since it is not called "
                "like this: static std::string normalize(Vector<double, kAmbient>& x)");
  static_assert(!Names_retract_jacobian<V> || HasRetractJacobian<V>,
                "this variable has a `retract_jacobian` that would be ignored, since it is not "
                "called like this: static Eigen::Matrix<double, kTangent, kTangent> "
                "retract_jacobian(const Vector<double, kAmbient>& x, "
                "const Vector<double, kTangent>& delta)");
  static constexpr bool kInPacks = [] {
    if constexpr (requires { V::kPacks; }) return V::kPacks;
    return false;
  }();

 public:
  std::string_view tag() const override { return V::kTag; }
  int ambient_size() const override { return kA; }
  int tangent_size() const override { return kT; }
  void identity(double* x) const override { store<kA>(V::identity(), x); }
  std::string normalize(double* x) const override {
    if constexpr (HasNormalize<V>) {
      Vector<double, kA> state = load<kA>(x);
      std::string problem = V::normalize(state);
      store<kA>(state, x);
      return problem;
    }
    return {};
  }
  void retract(std::size_t count, const double* x, const std::int64_t* delta_offsets,
               const double* delta, double* out) const override {
    lanes::move_states<kInPacks, kA, kT>(
        count, x, delta_offsets, delta, out,
        []<class S>(const Vector<S, kA>& state, const Vector<S, kT>& step) {
          return V::template retract<S>(state, step);
        });
  }
  void local(std::size_t count, const double* x, const double* y, double* delta) const override {
    for (std::size_t s = 0; s < count; ++s) {
      store<kT>(V::template local<double>(load<kA>(x + s * kA), load<kA>(y + s * kA)),
                delta + s * kT);
    }
  }
  void retract_jacobian(const double* x, const double* delta, double* D) const override {
    const Vector<double, kA> from = load<kA>(x);
    const Vector<double, kT> step = load<kT>(delta);
    Eigen::Map<Eigen::Matrix<double, kT, kT>> out{D};
    if constexpr (HasRetractJacobian<V>) {
      out = V::retract_jacobian(from, step);
    } else {
      const Vector<double, kA> there = V::template retract<double>(from, step);
      Vector<Dual<kT>, kT> lifted;
      for (int k = 0; k < kT; ++k) lifted[k] = Dual<kT>::variable(step[k], k);
      const Vector<Dual<kT>, kT> near = V::template local<Dual<kT>>(
          there.template cast<Dual<kT>>(),
          V::template retract<Dual<kT>>(from.template cast<Dual<kT>>(), lifted));
      for (int row = 0; row < kT; ++row) {
        for (int k = 0; k < kT; ++k) out(row, k) = near[row].gradient[k];
      }
    }
  }
  const LieGroup* lie_group() const override {
    if constexpr (HasGroup<V>) {
      static const GroupOf<V> group;
      return &group;
    }
    return nullptr;
  }
  const Placement* placement() const override {
    if constexpr (HasPlacement<V>) {
      static const PlacementOf<V> placement;
      return &placement;
    }
    return nullptr;
  }
};

}  // namespace detail

/// The variable type that a struct describes.
template <VariableTraits V>
std::shared_ptr<const VariableType> define_variable() {
  return std::make_shared<detail::DefinedVariable<V>>();
}

}  // namespace cairn
