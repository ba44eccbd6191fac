// SPDX-License-Identifier: BSD-3-Clause
#define CAIRN_KERNEL_SET avx2_single
#define CAIRN_KERNEL_SINGLE 1
#define CAIRN_KERNEL_WIDTH 8
#define CAIRN_KERNEL_TILE 1
#include "kernels_body.hpp"

#undef CAIRN_KERNEL_SET
#undef CAIRN_KERNEL_SINGLE
#undef CAIRN_KERNEL_WIDTH
#undef CAIRN_KERNEL_TILE
#define CAIRN_KERNEL_SET avx2
#define CAIRN_KERNEL_SINGLE_SET avx2_single
#define CAIRN_KERNEL_NAME "avx2"
#define CAIRN_KERNEL_SINGLE 0
#define CAIRN_KERNEL_WIDTH 4
#define CAIRN_KERNEL_TILE 3
#include "kernels_body.hpp"
