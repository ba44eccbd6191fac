// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/aligned.hpp"
#include "cairn/runtime/growing_array.hpp"

#include "memory/aligned_memory.hpp"

namespace cairn {

void* allocate_aligned(std::size_t bytes) { return memory::allocate(bytes); }
void release_aligned(void* memory, std::size_t bytes) noexcept { memory::release(memory, bytes); }

void* allocate_growing(std::size_t bytes) { return memory::allocate_growing(bytes); }
void* grow_aligned(void* memory, std::size_t used, std::size_t bytes, std::size_t more) {
  return memory::grow(memory, used, bytes, more);
}
void release_growing(void* memory, std::size_t bytes) noexcept {
  memory::release_growing(memory, bytes);
}

}  // namespace cairn
