// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#define CAIRN_VERSION "0.1.0"
/// Raised whenever a public class changes its layout or its virtual functions.
#define CAIRN_ABI_VERSION 4
