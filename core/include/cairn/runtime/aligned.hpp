// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <new>
#include <utility>
#include <vector>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Memory on a 64-byte boundary (a cache line, the widest vector register); large arrays are asked
/// of the system in huge pages, which a solver walks through with far fewer page faults and address
/// translations. Throws std::bad_alloc.
CAIRN_API void* allocate_aligned(std::size_t bytes);
/// `bytes` as they were asked for.
CAIRN_API void release_aligned(void* memory, std::size_t bytes) noexcept;

/// Allocates by `allocate_aligned`, whatever the instruction set that the caller was compiled for:
/// arrays may then be shared between code compiled with different flags.
template <class T>
struct AlignedAllocator {
  using value_type = T;

  AlignedAllocator() = default;
  template <class U>
  AlignedAllocator(const AlignedAllocator<U>&) noexcept {}

  T* allocate(std::size_t n) { return static_cast<T*>(allocate_aligned(n * sizeof(T))); }
  void deallocate(T* memory, std::size_t n) noexcept { release_aligned(memory, n * sizeof(T)); }
  friend bool operator==(const AlignedAllocator&, const AlignedAllocator&) { return true; }
};

/// Leaves new elements as the memory is, unless they are given a value: for arrays that are written
/// before they are read, by whichever thread comes first.
template <class T>
struct UninitializedAllocator : AlignedAllocator<T> {
  UninitializedAllocator() = default;
  template <class U>
  UninitializedAllocator(const UninitializedAllocator<U>&) noexcept {}

  template <class U>
  void construct(U* element) noexcept {
    ::new (static_cast<void*>(element)) U;
  }
  template <class U, class... Arguments>
  void construct(U* element, Arguments&&... arguments) {
    ::new (static_cast<void*>(element)) U(std::forward<Arguments>(arguments)...);
  }
  template <class U>
  struct rebind {
    using other = UninitializedAllocator<U>;
  };
};

/// A vector of doubles that starts on a cache line.
using AlignedVector = std::vector<double, AlignedAllocator<double>>;
/// The same; `UninitializedVector(n)` has n values that are not defined.
using UninitializedVector = std::vector<double, UninitializedAllocator<double>>;

}  // namespace cairn
