// SPDX-License-Identifier: BSD-3-Clause
#include "results.hpp"

#include "cairn/runtime/error.hpp"

namespace cairn::app {

void Results::add(const std::function<void()>& write) {
  try {
    write();
  } catch (const Error& error) {
    if (first_) session_.note(error.what());
    if (!first_) first_ = std::current_exception();
  } catch (...) {  // of memory above all: the others may need less
    if (!first_) first_ = std::current_exception();
  }
}

void Results::write(const std::string& file, const std::function<void()>& write) {
  if (!file.empty()) add(write);
}

void Results::finish() const {
  if (first_) std::rethrow_exception(first_);
}

}  // namespace cairn::app
