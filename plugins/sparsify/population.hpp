// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/sparsification/sparsification.hpp"

namespace cairn::sparsify {
using cairn::Population;
}
