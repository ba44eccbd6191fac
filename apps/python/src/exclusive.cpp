// SPDX-License-Identifier: BSD-3-Clause
#include "exclusive.hpp"

#include "cairn/runtime/error.hpp"

namespace cairn::python {

void Exclusive::refuse_if_used() const {
  if (used_) throw Error(ErrorCode::usage, message_);
}

}  // namespace cairn::python
