// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Base of everything that a plugin makes by name. An interface derived from it has
/// `static constexpr std::string_view kKind`, the kind under which the registry files it.
class CAIRN_API Component {
 public:
  Component() = default;
  Component(const Component&) = delete;
  Component& operator=(const Component&) = delete;
  virtual ~Component();

  /// A second, smaller interface that this object also has (its address), or null. Ask with
  /// `query`.
  virtual void* ability(std::string_view name);
};

/// The ability `A` of a component (`A::kAbility` is its name), or null if it does not have it.
///
///     if (auto* marginals = query<Marginals>(*solver)) …
template <class A>
A* query(Component& component) {
  return static_cast<A*>(component.ability(A::kAbility));
}

}  // namespace cairn
