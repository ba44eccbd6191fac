// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <type_traits>
// NOLINTBEGIN(bugprone-macro-parentheses): NAME is a name.
/// Defines `cairn::detail::Names_NAME<T>`: whether a struct has a member of that name, whatever its
/// signature: a template, overloaded, or not to be called at all. A function that is optional, but
/// there and not as it would be called, can then be an error of the compiler instead of being
/// ignored. How: beside a base that has the name, the name of another one is ambiguous.
#define CAIRN_MEMBER_NAME(NAME)                        \
  namespace cairn::detail {                            \
  struct Has_##NAME {                                  \
    int NAME;                                          \
  };                                                   \
  template <class T>                                   \
  struct Beside_##NAME : T, Has_##NAME {};             \
  template <class T, bool kFinal = std::is_final_v<T>> \
  constexpr bool kNames_##NAME = !requires {           \
    &Beside_##NAME<T>::NAME;                           \
  };                                                   \
  template <class T>                                   \
  constexpr bool kNames_##NAME<T, true> = requires {   \
    &T::NAME;                                          \
  };                                                   \
  template <class T>                                   \
  concept Names_##NAME = kNames_##NAME<T>;             \
  }
// NOLINTEND(bugprone-macro-parentheses)
CAIRN_MEMBER_NAME(evaluate)
CAIRN_MEMBER_NAME(normalize)
CAIRN_MEMBER_NAME(propagate)
CAIRN_MEMBER_NAME(retract_jacobian)

#undef CAIRN_MEMBER_NAME
