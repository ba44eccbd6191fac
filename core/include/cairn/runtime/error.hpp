// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdexcept>
#include <string>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// What kind of thing went wrong; the program's exit code is the value.
enum class ErrorCode {
  usage = 2,      ///< a bad call: unknown name, option or argument
  input = 3,      ///< a bad file or bad data
  numerical = 4,  ///< only where a number was asked for that does not exist (elsewhere a status)
  plugin = 5,     ///< a plugin that is missing, broken or does not fit
};

/// The one exception that cairn throws. Its message says what is wrong, where (file and line, or
/// vertex and factor, or option), and what would work. How an optimisation ended is never an
/// exception: that is `Summary::status`.
class CAIRN_API Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  ~Error() override;  // out of line: one type information for all shared objects

  ErrorCode code() const noexcept { return code_; }

 private:
  ErrorCode code_;
};

}  // namespace cairn
