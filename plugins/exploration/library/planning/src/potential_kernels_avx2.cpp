// SPDX-License-Identifier: BSD-3-Clause
#define CAIRN_KERNEL_SET avx2
#define CAIRN_KERNEL_WIDTH 4
#include "potential_kernels_body.hpp"
