// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace cairn::app {

/// Functions of cairn's libraries that a plugin uses without being linked with the library: "the
/// library's file name: the function". Such a plugin works in programs that happen to have the
/// library, as this one has, and cannot be loaded by others, such as Python. Asks the dynamic
/// linker, which loads nothing for it; empty where that cannot be asked.
std::vector<std::string> unlinked_symbols(const std::filesystem::path& plugin);

}  // namespace cairn::app
