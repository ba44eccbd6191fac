// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/types/factor_type.hpp"

namespace cairn {

/// Calls `work`, which evaluates factors of that type; an exception that escapes from the type's
/// plugin becomes an `Error` (plugin) that names the type.
template <class Work>
decltype(auto) call_factor(const FactorType& type, const Work& work) {
  return call_plugin([&] { return "factor '" + std::string(type.tag()) + "'"; }, work);
}

/// The same for one factor, which is named at the end of the message of any `Error`: `which()`
/// returns its description, such as "EDGE_SE2 3 17", and is only called if something is thrown.
template <class Which, class Work>
decltype(auto) call_factor(const FactorType& type, const Which& which, const Work& work) {
  try {
    return call_factor(type, work);
  } catch (const Error& error) {
    throw Error(error.code(), std::string(error.what()) + " (" + which() + ")");
  }
}

}  // namespace cairn
