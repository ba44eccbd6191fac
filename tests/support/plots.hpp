// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdlib>
#include <string_view>

#include "cairn/plugin/registry.hpp"
#include "cairn/report/scene.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::test {

/// Whether plots can be drawn: CMake says in $CAIRN_TEST_PLOTS whether the package and matplotlib
/// are there, so that a plugin that does not find them is not taken for a build without them.
inline bool draws_plots() {
  Registry registry;
  if (!registry.has(Picture::kKind, "svg")) return false;
  if (const char* told = std::getenv("CAIRN_TEST_PLOTS")) return std::string_view(told) == "ON";
  try {
    registry.make<Picture>("svg");
  } catch (const Error&) {
    return false;
  }
  return true;
}

}  // namespace cairn::test
