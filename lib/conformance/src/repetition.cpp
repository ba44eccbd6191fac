// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/conformance/repetition.hpp"

#include <algorithm>
#include <barrier>
#include <bit>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#if defined(__GLIBC__)
#include <malloc.h>
#endif

#include <fmt/core.h>

#include "cairn/runtime/threads.hpp"
#include "cairn/runtime/timed.hpp"

/// Of the address and the thread sanitizer, whose allocators `mallinfo2` does not know; null
/// without them.
extern "C" std::size_t __sanitizer_get_current_allocated_bytes() __attribute__((weak));

namespace cairn::conformance {
namespace {

// Memory ------------------------------------------------------------------------------------------

/// The least growth that counts, in bytes per use: an array that gets a number with each use grows
/// by eight, and allocators give no less than 24 or 32 at a time.
constexpr double kLeastGrowth = 4.0;
/// Likewise of open files and threads.
constexpr double kLeastCount = 0.5;
/// Rounds of uses, and how many there are at most where memory seems to grow.
constexpr int kRounds = 4, kMostRounds = 9;

#if defined(__GLIBC__) && __GLIBC_PREREQ(2, 33)
constexpr bool kMeasured = true;
double bytes_in_use() {
  if (&__sanitizer_get_current_allocated_bytes != nullptr)
    return static_cast<double>(__sanitizer_get_current_allocated_bytes());
  const struct mallinfo2 all = ::mallinfo2();
  return static_cast<double>(all.uordblks) + static_cast<double>(all.hblkhd);
}
#else
constexpr bool kMeasured = false;
double bytes_in_use() { return 0.0; }
#endif

/// Seconds that the repetitions may take, roughly.
constexpr double kRepeatingSeconds = 10.0;

/// How many entries a folder of /proc has; 0 where there is none.
int entries(const char* folder) {
  std::error_code error;
  int count = 0;
  for (std::filesystem::directory_iterator at(folder, error), end; !error && at != end;
       at.increment(error))
    ++count;
  return count;
}

/// One thread, so that what others allocate for themselves is not counted.
class OneThread {
 public:
  OneThread() : before_(threads()) { set_threads(1); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;
  ~OneThread() { set_threads(before_); }

 private:
  int before_;
};

struct Resources {
  double bytes = 0.0;
  int files = 0, threads = 0;

  static Resources now() {
    return {bytes_in_use(), entries("/proc/self/fd"), entries("/proc/self/task")};
  }
};

/// On a thread of its own, whose end gives back what the C library keeps for it of the memory that
/// was freed.
void on_new_thread(const std::function<void()>& work) {
  std::exception_ptr thrown;
  std::thread([&] {
    try {
      work();
    } catch (...) {
      thrown = std::current_exception();
    }
  }).join();
  if (thrown) std::rethrow_exception(thrown);
}

/// Uses it `calls` times, so many again, twice and four times as many, and expects that one of the
/// last three rounds left nothing behind: caches that fill up, and tables that double their size,
/// are no leak. Where memory grew in all, rounds of twice as many follow: what the allocator keeps
/// back in a few of them is no leak either, and a leak goes on.
void expect_no_growth(const Repetition& repetition, std::string_view law, Checker& check,
                      const std::function<void()>& use) {
  const auto begin = std::chrono::steady_clock::now();
  check.call(repetition.callback, use);
  // What takes its time is repeated less often.
  const int first = std::clamp(static_cast<int>(kRepeatingSeconds / 8.0 / seconds_since(begin)), 1,
                               repetition.calls);
  constexpr double kMost = std::numeric_limits<double>::infinity();
  double bytes = kMost, files = kMost, tasks = kMost;  // the least growth of a round, per use
  Resources before;
  for (int round = 0; round < kMostRounds; ++round) {
    // Files and threads are few enough to be counted, and would run out.
    const bool leaks = files >= kLeastCount || tasks >= kLeastCount;
    const bool again = bytes >= kLeastGrowth && !leaks;
    if (round >= kRounds && (!again || seconds_since(begin) > kRepeatingSeconds / 2.0)) break;
    const int calls = first << std::max(0, round - 1);
    check.call(repetition.callback, [&] {
      on_new_thread([&] {
        for (int k = 0; k < calls; ++k) use();
      });
    });
    const Resources now = Resources::now();
    if (round > 0) {
      bytes = std::min(bytes, (now.bytes - before.bytes) / calls);
      files = std::min(files, static_cast<double>(now.files - before.files) / calls);
      tasks = std::min(tasks, static_cast<double>(now.threads - before.threads) / calls);
    }
    before = now;
  }
  check.expect(bytes < kLeastGrowth, law,
               [&] { return fmt::format("at least {:.3g} bytes more with each", bytes); });
  check.expect(files < kLeastCount, "open files are closed",
               [&] { return fmt::format("at least {:.2g} more with each", files); });
  check.expect(tasks < kLeastCount, "threads are ended",
               [&] { return fmt::format("at least {:.2g} more with each", tasks); });
}

// Threads -----------------------------------------------------------------------------------------

constexpr int kThreads = 3;
constexpr double kSeconds = 0.2;  // for which the threads go on, once each has done its uses

bool same_bits(const State& a, const State& b) {
  return std::ranges::equal(a, b, [](double x, double y) {
    return std::bit_cast<std::uint64_t>(x) == std::bit_cast<std::uint64_t>(y);
  });
}

std::string difference_of(const State& found, const State& expected) {
  if (found.size() != expected.size())
    return fmt::format("{} numbers instead of {}", found.size(), expected.size());
  for (std::size_t k = 0; k < found.size(); ++k) {
    if (std::bit_cast<std::uint64_t>(found[k]) != std::bit_cast<std::uint64_t>(expected[k]))
      return fmt::format("number {} of {} is {} instead of {}", k, found.size(), found[k],
                         expected[k]);
  }
  return "none";
}

/// One thread: its result alone, and the first other one that it got beside the others.
struct Beside {
  Use use;
  State alone;
  std::optional<State> other;
  std::exception_ptr thrown;

  void run(int calls, std::barrier<>& start) {
    start.arrive_and_wait();
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(kSeconds);
    try {
      for (int k = 0; !other && (k < calls || std::chrono::steady_clock::now() < end); ++k) {
        State now = use();
        if (!same_bits(now, alone)) other = std::move(now);
      }
    } catch (...) {
      thrown = std::current_exception();
    }
  }
};

}  // namespace

void check_memory(const Repetition& repetition, Checker& check) {
  if (repetition.callback.empty()) return check.note("nothing of it can be repeated here");
  if (!kMeasured) return check.note("memory is not measured with this C library");
  check.sample("the same input many times", [&] {
    const OneThread one;
    {
      const Use use = repetition.make(0);
      expect_no_growth(repetition, "memory does not grow with the calls of one object", check,
                       [&] { static_cast<void>(use()); });
    }
    expect_no_growth(repetition, "memory does not grow with new objects", check,
                     [&] { static_cast<void>(repetition.make(0)()); });
  });
}

void check_threads(const Repetition& repetition, Checker& check) {
  if (repetition.callback.empty()) return check.note("nothing of it can be repeated here");
  check.sample(fmt::format("{} threads, each with an input of its own", kThreads), [&] {
    std::vector<Beside> beside;
    bool repeats = true;
    for (std::uint64_t k = 0; k < kThreads; ++k) {
      const Use use = repetition.make(k);
      const State alone = check.call(repetition.callback, use);
      const State again = check.call(repetition.callback, use);
      repeats = check.expect(same_bits(again, alone),
                             "the same input gives the same bits when it is repeated",
                             [&] { return difference_of(again, alone); }) &&
                repeats;
      beside.push_back({use, alone, {}, {}});
    }
    check.call(repetition.callback, [&] {
      std::barrier start(kThreads);
      {
        std::vector<std::jthread> all;
        for (Beside& one : beside) all.emplace_back([&] { one.run(repetition.calls, start); });
      }
      for (const Beside& one : beside) {
        if (one.thrown) std::rethrow_exception(one.thrown);
      }
    });
    if (!repeats) return;
    for (const Beside& one : beside) {
      check.expect(!one.other, "uses at the same time on several threads give the same bits",
                   [&] { return difference_of(*one.other, one.alone); });
    }
  });
}

}  // namespace cairn::conformance
