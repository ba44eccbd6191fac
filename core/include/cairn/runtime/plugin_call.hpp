// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Throws the exception being handled again: `Error`, `CallbackExit` and `std::bad_alloc` as they
/// are, everything else as `Error` (plugin) with the message "`component` failed: " and what the
/// exception says. To be called in a handler.
[[noreturn]] CAIRN_API void rethrow_as_plugin_error(const std::string& component);

/// Returns `work()`, which runs code of a plugin, and names the plugin's component in what escapes
/// from it (`rethrow_as_plugin_error`). `component()` returns the name, such as "factor
/// 'EDGE_SE2'"; it is only called if something is thrown, so that the call costs nothing otherwise.
template <class Component, class Work>
decltype(auto) call_plugin(const Component& component, const Work& work) {
  try {
    return work();
  } catch (...) {
    rethrow_as_plugin_error(component());
  }
}

}  // namespace cairn
