// SPDX-License-Identifier: BSD-3-Clause
// Deprecated: the header has moved, and this one goes in 0.2.
#pragma once

#include "cairn/online/run_server.hpp"
