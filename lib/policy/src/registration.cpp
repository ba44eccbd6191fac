// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/registration.hpp"

namespace cairn {

Registration::~Registration() = default;
void Registration::pose_ended(Id, bool) {}
FalseMatches::~FalseMatches() = default;

}  // namespace cairn
