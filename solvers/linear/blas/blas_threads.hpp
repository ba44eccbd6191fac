// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <dlfcn.h>

#include "cairn/runtime/threads.hpp"

namespace cairn {

/// Threads inside BLAS make small dense blocks slower, and results depend on their number. OpenBLAS
/// is restricted to one thread, once; the reference BLAS has no threads, and others are left alone.
inline void keep_blas_to_one_thread() {
  using SetThreads = void (*)(int);
  if (auto set = reinterpret_cast<SetThreads>(dlsym(RTLD_DEFAULT, "openblas_set_num_threads")))
    set(1);
}

/// CHOLMOD asks OpenMP for four threads, whatever the machine has and `OMP_NUM_THREADS` says; where
/// they outnumber the processors they take up to four times as long as one. While this lives,
/// parallel regions that this thread begins have one thread if cairn has.
class AsManyThreads {
 public:
  AsManyThreads() {
    const auto get = reinterpret_cast<int (*)()>(dlsym(RTLD_DEFAULT, "omp_get_max_active_levels"));
    set_ = reinterpret_cast<void (*)(int)>(dlsym(RTLD_DEFAULT, "omp_set_max_active_levels"));
    if (threads() > 1 || !get) set_ = nullptr;
    if (!set_) return;
    before_ = get();
    set_(0);
  }
  AsManyThreads(const AsManyThreads&) = delete;
  AsManyThreads& operator=(const AsManyThreads&) = delete;
  ~AsManyThreads() {
    if (set_) set_(before_);
  }

 private:
  void (*set_)(int) = nullptr;
  int before_ = 0;
};

}  // namespace cairn
