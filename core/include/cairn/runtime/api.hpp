// SPDX-License-Identifier: BSD-3-Clause
#pragma once

/// Marks what libcairn exports. Everything else is hidden, so that two libraries in one process
/// cannot see each other's symbols.
#define CAIRN_API __attribute__((visibility("default")))
