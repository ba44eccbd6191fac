// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/runtime/plugin_call.hpp"
#include "cairn/types/factor_type.hpp"

namespace cairn {

/// Calls `work`, which evaluates factors of that type; an exception that escapes from the type's
/// plugin becomes an `Error` (plugin) that names the type.
template <class Work>
void call_factor(const FactorType& type, const Work& work) {
  call_plugin([&] { return "factor '" + std::string(type.tag()) + "'"; }, work);
}

}  // namespace cairn
