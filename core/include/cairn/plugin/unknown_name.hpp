// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/runtime/api.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {

/// An `Error` (plugin) of a name that no plugin offers, of a component or type.
class CAIRN_API UnknownName : public Error {
 public:
  explicit UnknownName(const std::string& message) : Error(ErrorCode::plugin, message) {}
};

}  // namespace cairn
