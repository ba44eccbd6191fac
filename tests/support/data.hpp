// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

namespace cairn::test {

/// The folder of the published data sets, from the environment variable CAIRN_DATA; empty without
/// it.
inline std::filesystem::path data_folder() {
  const char* folder = std::getenv("CAIRN_DATA");
  return folder ? std::filesystem::path(folder) : std::filesystem::path();
}

}  // namespace cairn::test

/// Skips the test, visibly, where the data sets are not at hand.
#define CAIRN_NEEDS_DATA()                                                     \
  if (::cairn::test::data_folder().empty()) {                                  \
    GTEST_SKIP() << "set CAIRN_DATA to the folder of the published data sets"; \
  }                                                                            \
  static_assert(true)
