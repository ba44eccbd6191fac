// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/io/generator.hpp"

namespace cairn {

Generator::~Generator() = default;

}  // namespace cairn
