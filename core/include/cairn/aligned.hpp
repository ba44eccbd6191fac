// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace cairn {

/// Allocates on 64-byte boundaries (a cache line, the widest vector register), whatever the
/// instruction set that the caller was compiled for: arrays may then be shared between code
/// compiled with different flags.
template <class T>
struct AlignedAllocator {
  using value_type = T;
  static constexpr std::align_val_t kAlignment{64};

  AlignedAllocator() = default;
  template <class U>
  AlignedAllocator(const AlignedAllocator<U>&) noexcept {}

  T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), kAlignment)); }
  void deallocate(T* p, std::size_t) noexcept { ::operator delete(p, kAlignment); }
  friend bool operator==(const AlignedAllocator&, const AlignedAllocator&) { return true; }
};

/// A vector of doubles that starts on a cache line.
using AlignedVector = std::vector<double, AlignedAllocator<double>>;

}  // namespace cairn
