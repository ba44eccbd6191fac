// SPDX-License-Identifier: BSD-3-Clause
#define CAIRN_KERNEL_SET portable
#define CAIRN_KERNEL_WIDTH 1
#include "ray_kernels_body.hpp"
