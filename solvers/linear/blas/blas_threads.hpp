// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <dlfcn.h>

namespace cairn {

/// Threads inside BLAS make small dense blocks slower, and results depend on their number. OpenBLAS
/// is restricted to one thread, once; the reference BLAS has no threads, and others are left alone.
inline void keep_blas_to_one_thread() {
  using SetThreads = void (*)(int);
  if (auto set = reinterpret_cast<SetThreads>(dlsym(RTLD_DEFAULT, "openblas_set_num_threads")))
    set(1);
}

}  // namespace cairn
