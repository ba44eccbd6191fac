// SPDX-License-Identifier: BSD-3-Clause
extern "C" __attribute__((visibility("default"))) int something_else() { return 1; }
