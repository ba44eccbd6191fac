// SPDX-License-Identifier: BSD-3-Clause
#define CAIRN_KERNEL_SET avx512
#define CAIRN_KERNEL_WIDTH 8
#include "marginal_kernels_body.hpp"
