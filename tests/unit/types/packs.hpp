// SPDX-License-Identifier: BSD-3-Clause
// Several factors at a time against one at a time: the same to the last bit.
#pragma once

#include "cairn/types/define_factor.hpp"

namespace cairn::test {

/// Linearises pools of factors of every size up to a few packs, in which states of all regimes,
/// huge numbers and NaN stand side by side, with all widths of packs that this machine has. The
/// variables are those of the factor type, in order.
void expect_equal_bits(const FactorType& type, const std::vector<const VariableType*>& variables);

template <class F>
void expect_equal_bits() {
  const auto type = define_factor<F>();
  [&]<class... V>(std::type_identity<std::tuple<V...>>) {
    const std::vector<std::shared_ptr<const VariableType>> owners{define_variable<V>()...};
    std::vector<const VariableType*> variables;
    for (const auto& owner : owners) variables.push_back(owner.get());
    expect_equal_bits(*type, variables);
  }(std::type_identity<typename F::Variables>{});
}

}  // namespace cairn::test
