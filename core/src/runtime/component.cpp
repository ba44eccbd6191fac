// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/component.hpp"

#include "cairn/runtime/error.hpp"

namespace cairn {

// Destructors of interfaces are out of line: each class then has its type information in this
// library alone, and all shared objects agree on it.
Component::~Component() = default;
Error::~Error() = default;
void* Component::ability(std::string_view) { return nullptr; }

}  // namespace cairn
