// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tuple>
#include <utility>

#include <Eigen/Core>

#include "cairn/pack/dual.hpp"

/// Jacobians of a factor without writing them: forward differentiation with dual numbers.
namespace cairn::autodiff {

namespace detail {

/// retract(x, δ) at δ = 0 with the derivatives of all N tangent coordinates, δ's own starting at
/// `first`.
template <class V, class D, class X>
Eigen::Matrix<D, V::kAmbient, 1> lift(const X& x, int first) {
  Eigen::Matrix<D, V::kAmbient, 1> state;
  for (int k = 0; k < V::kAmbient; ++k) state[k] = x[k];
  Eigen::Matrix<D, V::kTangent, 1> delta;
  for (int k = 0; k < V::kTangent; ++k) delta[k] = D::variable(0.0, first + k);
  return V::template retract<D>(state, delta);
}

template <class F, class States, class Z, class Jacobians, std::size_t... I>
auto evaluate(const States& x, const Z& z, Jacobians& jacobians, std::index_sequence<I...>) {
  using Variables = typename F::Variables;
  constexpr int kTangents[] = {std::tuple_element_t<I, Variables>::kTangent...};
  constexpr int N = (std::tuple_element_t<I, Variables>::kTangent + ...);
  constexpr auto first = [](std::size_t variable, const auto& tangents) {
    int sum = 0;
    for (std::size_t k = 0; k < variable; ++k) sum += tangents[k];
    return sum;
  };
  using T = typename Z::Scalar;
  using D = Dual<N, T>;
  const Eigen::Matrix<D, F::kResidual, 1> r = F::template residual<D>(
      lift<std::tuple_element_t<I, Variables>, D>(std::get<I>(x), first(I, kTangents))..., z);
  Eigen::Matrix<T, F::kResidual, 1> value;
  for (int row = 0; row < F::kResidual; ++row) {
    value[row] = r[row].value;
    const Eigen::Map<const Eigen::Matrix<T, 1, N>> gradient(r[row].gradient.data());
    (..., (std::get<I>(jacobians).row(row) =
               gradient.template segment<kTangents[I]>(first(I, kTangents))));
  }
  return value;
}

}  // namespace detail

/// The error F::residual(x…, z) and, into `jacobians` (a tuple of kResidual × kTangent matrices),
/// its derivatives with respect to the tangent vector of each variable: J_k = d/dδ F::residual(…,
/// retract(x_k, δ), …, z) at δ = 0. One pass for all variables together. All of doubles, or of
/// packs.
template <class F, class States, class Z, class Jacobians>
auto evaluate(const States& x, const Z& z, Jacobians& jacobians) {
  return detail::evaluate<F>(x, z, jacobians,
                             std::make_index_sequence<std::tuple_size_v<typename F::Variables>>{});
}

}  // namespace cairn::autodiff
