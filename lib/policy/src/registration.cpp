// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/registration.hpp"

namespace cairn {

Registration::~Registration() = default;
FalseMatches::~FalseMatches() = default;

}  // namespace cairn
