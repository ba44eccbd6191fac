// SPDX-License-Identifier: BSD-3-Clause
// Analytic Jacobians against automatic ones: two derivations of one number, to the last digits.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <tuple>
#include <utility>

#include <Eigen/Core>

#include "cairn/types/autodiff.hpp"
#include "cairn/types/define_factor.hpp"
#include "support/sampling.hpp"

namespace cairn::test {

template <class V>
Vector<double, V::kAmbient> sample(Sampler& sampler, const Regime& regime) {
  const auto state = sampler.state(*define_variable<V>(), regime);
  return Eigen::Map<const Vector<double, V::kAmbient>>(state.data());
}

/// Both ways at one point; the deviation is relative to the largest entry.
template <class F, class... X>
void expect_agreement(const Vector<double, F::kMeasurement>& z, const X&... x) {
  using Variables = typename F::Variables;
  [&]<std::size_t... I>(std::index_sequence<I...>) {
    using Jacobians = std::tuple<
        Eigen::Matrix<double, F::kResidual, std::tuple_element_t<I, Variables>::kTangent>...>;
    Jacobians analytic, automatic;
    const auto r = F::evaluate(x..., z, std::get<I>(analytic)...);
    const auto r_automatic = autodiff::evaluate<F>(std::tuple<X...>(x...), z, automatic);
    EXPECT_LT((r - r_automatic).norm(), 1e-14 * (10.0 + r.norm()));
    EXPECT_LT((r - F::template residual<double>(x..., z)).norm(), 1e-14 * (10.0 + r.norm()));
    const auto expect = [](const auto& a, const auto& b) {
      const double scale = 1.0 + a.cwiseAbs().maxCoeff();
      EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 2e-12 * scale) << "analytic\n"
                                                              << a << "\nautomatic\n"
                                                              << b;
    };
    (expect(std::get<I>(analytic), std::get<I>(automatic)), ...);
  }
  (std::index_sequence_for<X...>{});
}

inline const Regime kAny{"any", -1.0};

/// Relative poses and priors: the error pose E is in the regime, the rest anywhere.
template <class F, class V>
void check_relative() {
  Sampler sampler(31);
  for (const Regime& regime : regimes()) {
    SCOPED_TRACE(regime.name);
    for (int k = 0; k < 20; ++k) {
      const auto a = sample<V>(sampler, kAny), z = sample<V>(sampler, kAny),
                 E = sample<V>(sampler, regime);
      const auto b = V::template compose<double>(V::template compose<double>(a, z), E);
      expect_agreement<F>(z, a, b);
      // and the poses themselves in it
      expect_agreement<F>(z, sample<V>(sampler, regime), sample<V>(sampler, regime));
    }
  }
}
template <class F, class V>
void check_prior() {
  Sampler sampler(37);
  for (const Regime& regime : regimes()) {
    SCOPED_TRACE(regime.name);
    for (int k = 0; k < 20; ++k) {
      const auto z = sample<V>(sampler, kAny);
      expect_agreement<F>(z, V::template compose<double>(z, sample<V>(sampler, regime)));
    }
  }
}
template <class F, class V, class L>
void check_landmark() {
  Sampler sampler(41);
  for (const Regime& regime : regimes()) {
    SCOPED_TRACE(regime.name);
    for (int k = 0; k < 20; ++k) {
      const auto z = sample<L>(sampler, kAny);
      expect_agreement<F>(z, sample<V>(sampler, regime), sample<L>(sampler, kAny));
    }
  }
}

}  // namespace cairn::test
