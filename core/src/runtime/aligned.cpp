// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/aligned.hpp"

#include "memory/aligned_memory.hpp"

namespace cairn {

void* allocate_aligned(std::size_t bytes) { return memory::allocate(bytes); }
void release_aligned(void* memory, std::size_t bytes) noexcept { memory::release(memory, bytes); }

}  // namespace cairn
