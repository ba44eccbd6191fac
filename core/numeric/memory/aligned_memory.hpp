// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

/// Memory for arrays of numbers, on cache lines and, where they are large enough, in huge pages.
///
/// The first touch of a page of 4 KB takes about a microsecond, whether one asks for pages one by
/// one or for many at once; a huge page of 2 MB takes as long as thirty of them. So it is not only
/// arrays of megabytes that are worth one: the arrays of a graph of a thousand poses share one, and
/// the first of its iterations takes half of the time.
namespace cairn::memory {

/// Memory on a 64-byte boundary, in no new huge page while there are `SmallPages`. Several threads
/// may call this at once. Throws std::bad_alloc.
void* allocate(std::size_t bytes);
/// Gives it back; `bytes` as they were asked for.
void release(void* memory, std::size_t bytes) noexcept;

}  // namespace cairn::memory
