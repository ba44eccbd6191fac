// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#define CAIRN_VERSION "0.1.0"
