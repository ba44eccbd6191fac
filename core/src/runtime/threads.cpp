// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/threads.hpp"

#include <algorithm>
#include <memory>
#include <mutex>
#include <thread>

#include <fmt/core.h>
#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "cairn/runtime/error.hpp"

// The thread sanitizer does not see into oneTBB, which is not built with it. These two calls tell
// it what the fork and the join of a parallel loop order.
#if defined(__SANITIZE_THREAD__)
extern "C" void __tsan_acquire(void*);
extern "C" void __tsan_release(void*);
#define CAIRN_TSAN_ACQUIRE(address) __tsan_acquire(address)
#define CAIRN_TSAN_RELEASE(address) __tsan_release(address)
#else
#define CAIRN_TSAN_ACQUIRE(address) (void)(address)
#define CAIRN_TSAN_RELEASE(address) (void)(address)
#endif

namespace cairn {
namespace {

/// The process's one arena. A mutable singleton, because threads are a resource of the process: two
/// arenas would run twice the threads on the same cores.
struct Arena {
  std::mutex mutex;
  int count = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  std::unique_ptr<tbb::global_control> control;
  std::unique_ptr<tbb::task_arena> arena;

  tbb::task_arena& get() {
    const std::lock_guard lock(mutex);
    return start();
  }
  /// The mutex being held.
  tbb::task_arena& start() {
    if (!arena) {
      // More threads than cores are allowed: the control lifts oneTBB's own limit.
      control = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                      static_cast<std::size_t>(count));
      arena = std::make_unique<tbb::task_arena>(count);
      // Workers start with the first task, and take a while: sooner is better than in the midst.
      if (count > 1) arena->enqueue([] {});
    }
    return *arena;
  }
};

Arena& arena() {
  static Arena instance;
  return instance;
}

}  // namespace

void set_threads(int count) {
  if (count < 0 || count > kMostThreads) {
    throw Error(ErrorCode::usage,
                fmt::format("{} threads: expected 0 (all cores) to {}", count, kMostThreads));
  }
  Arena& a = arena();
  const std::lock_guard lock(a.mutex);
  const int wanted =
      count > 0 ? count : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  if (wanted != a.count) {
    a.count = wanted;
    a.arena.reset();
    a.control.reset();
  }
  if (wanted > 1) a.start();
}

int threads() {
  Arena& a = arena();
  const std::lock_guard lock(a.mutex);
  return a.count;
}

void detail::run_chunks(std::size_t chunks, void (*run)(const void* body, std::size_t chunk),
                        const void* body) {
  if (chunks <= 1 || threads() == 1) {
    for (std::size_t chunk = 0; chunk < chunks; ++chunk) run(body, chunk);
    return;
  }
  char fork = 0, join = 0;
  CAIRN_TSAN_RELEASE(&fork);
  arena().get().execute([&] {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, chunks, 1),
                      [&](const tbb::blocked_range<std::size_t>& range) {
                        CAIRN_TSAN_ACQUIRE(&fork);
                        for (std::size_t chunk = range.begin(); chunk != range.end(); ++chunk)
                          run(body, chunk);
                        CAIRN_TSAN_RELEASE(&join);
                      });
  });
  CAIRN_TSAN_ACQUIRE(&join);
}

}  // namespace cairn
