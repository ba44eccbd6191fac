// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// The largest number of threads.
inline constexpr int kMostThreads = 1024;

/// Sets the number of threads of cairn's one arena (oneTBB), for this process; 0 means all cores.
/// Results never depend on it, to the last bit. Starts the threads, so that the first parallel work
/// need not. Not to be called while work runs. Throws `Error` (usage) beyond `kMostThreads`, and
/// for less than 0.
CAIRN_API void set_threads(int count);

/// The number of threads of the arena.
CAIRN_API int threads();

namespace detail {
CAIRN_API void run_chunks(std::size_t chunks, void (*run)(const void* body, std::size_t chunk),
                          const void* body);
}

/// Calls `body(chunk)` for chunk = 0 … chunks-1, in any order and in parallel; returns when all are
/// done. How the work is cut into chunks must not depend on the number of threads, so that results
/// don't either. The first exception is rethrown. With one chunk or one thread it is a plain loop.
/// Allocates nothing of its own.
template <class Body>
void for_each_chunk(std::size_t chunks, const Body& body) {
  detail::run_chunks(
      chunks,
      [](const void* erased, std::size_t chunk) { (*static_cast<const Body*>(erased))(chunk); },
      &body);
}

/// Cuts [0, size) into chunks of `grain` and calls `body(begin, end)` for each, in parallel.
template <class Body>
void for_each_range(std::size_t size, std::size_t grain, const Body& body) {
  for_each_chunk((size + grain - 1) / grain, [&](std::size_t chunk) {
    body(chunk * grain, std::min(size, (chunk + 1) * grain));
  });
}

}  // namespace cairn
