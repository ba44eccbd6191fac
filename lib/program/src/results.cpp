// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/results.hpp"

#include <algorithm>
#include <cstdio>

#include <fmt/core.h>

#include "cairn/program/option_words.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::app {
namespace {

/// With --quiet too: an output that cannot be written is an error, though not the first.
void name(const Error& error) {
  fmt::print(stderr, "note: {}\n", printable(in_command_line_words(error.what()), true));
}

}  // namespace

bool Results::add(const std::function<void()>& write) {
  try {
    write();
    return true;
  } catch (const Error& error) {
    if (first_) name(error);
    if (!first_) first_ = std::current_exception();
  } catch (...) {  // of memory above all: the others may need less
    if (!first_) first_ = std::current_exception();
  }
  return false;
}

void Results::write(const std::string& file, const std::function<void()>& write) {
  if (!file.empty() && add(write)) written_.push_back(file);
}

std::vector<std::string> Results::written(std::initializer_list<std::string> files) const {
  std::vector<std::string> found;
  for (const std::string& file : files) {
    if (file != "-" && std::ranges::count(written_, file) > 0) found.push_back(file);
  }
  return found;
}

void Results::finish() const {
  if (first_) std::rethrow_exception(first_);
}

}  // namespace cairn::app
