// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/aligned.hpp"

#include <sys/mman.h>

#include <cstdint>

namespace cairn {
namespace {

constexpr std::size_t kCacheLine = 64;
constexpr std::size_t kHugePage = std::size_t{1} << 21;
// Smaller arrays have no whole huge page in them.
constexpr std::size_t kLarge = kHugePage;
// Below, the C library's own alignment takes several times as long as what a cache line costs.
#if defined(CAIRN_SANITIZED)
constexpr std::size_t kSmall = 0;  // every byte beyond an array is noticed
#else
constexpr std::size_t kSmall = 4096;
#endif

std::align_val_t alignment(std::size_t bytes) {
  return std::align_val_t{bytes < kLarge ? kCacheLine : kHugePage};
}

}  // namespace

void* allocate_aligned(std::size_t bytes) {
  if (bytes < kSmall) {  // the byte before the array says where the memory began
    auto* const begin = static_cast<unsigned char*>(::operator new(bytes + kCacheLine));
    const auto offset = kCacheLine - reinterpret_cast<std::uintptr_t>(begin) % kCacheLine;
    begin[offset - 1] = static_cast<unsigned char>(offset);
    return begin + offset;
  }
  void* memory = ::operator new(bytes, alignment(bytes));
  // Only whole huge pages: the end of the array is not worth one. Advice, so a refusal is no error.
  if (bytes >= kLarge) ::madvise(memory, bytes / kHugePage * kHugePage, MADV_HUGEPAGE);
  return memory;
}

void release_aligned(void* memory, std::size_t bytes) noexcept {
  if (bytes < kSmall) {
    auto* const array = static_cast<unsigned char*>(memory);
    return ::operator delete(array - array[-1]);
  }
  ::operator delete(memory, alignment(bytes));
}

}  // namespace cairn
