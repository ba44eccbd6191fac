// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/error.hpp"

namespace cairn {

Error::~Error() = default;

}  // namespace cairn
