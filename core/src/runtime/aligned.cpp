// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/aligned.hpp"

#include <sys/mman.h>

namespace cairn {
namespace {

constexpr std::size_t kCacheLine = 64;
constexpr std::size_t kHugePage = std::size_t{1} << 21;
// Smaller arrays have no whole huge page in them.
constexpr std::size_t kLarge = kHugePage;

std::align_val_t alignment(std::size_t bytes) {
  return std::align_val_t{bytes < kLarge ? kCacheLine : kHugePage};
}

}  // namespace

void* allocate_aligned(std::size_t bytes) {
  void* memory = ::operator new(bytes, alignment(bytes));
  // Only whole huge pages: the end of the array is not worth one. Advice, so a refusal is no error.
  if (bytes >= kLarge) ::madvise(memory, bytes / kHugePage * kHugePage, MADV_HUGEPAGE);
  return memory;
}

void release_aligned(void* memory, std::size_t bytes) noexcept {
  ::operator delete(memory, alignment(bytes));
}

}  // namespace cairn
