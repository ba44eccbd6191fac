// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <exception>
#include <utility>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Thrown by what a call of cairn calls back, to end that call: Ctrl-C in a function written in
/// Python. It is no `Error`, which may be dealt with on the way, and no component is to blame for
/// it: `call_plugin` lets it pass as it is.
class CAIRN_API CallbackExit : public std::exception {
 public:
  /// `cause`: what the caller is to get.
  explicit CallbackExit(std::exception_ptr cause)
      : cause_(std::move(cause)) {}  // NOLINT(bugprone-throw-keyword-missing): it is kept
  const std::exception_ptr& cause() const { return cause_; }
  const char* what() const noexcept override { return "interrupted by a function that was called"; }

 private:
  std::exception_ptr cause_;
};

}  // namespace cairn
