// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace cairn::faults {

/// Calls of one process that can be made to fail.
enum class Call : std::uint32_t { open, write, sync, rename, close, truncate };

/// One call on an output, in order.
struct OutputCall {
  Call call{};
  std::uint32_t failed = 0;      ///< 1: this is the one that was made to fail
  std::array<char, 248> path{};  ///< of the file, cut where it is longer
};

/// What the injected library counted: a file of this size, mapped by it and by the driver, so that
/// nothing is lost when the process dies. Counting begins with main().
struct FaultRecord {
  static constexpr std::size_t kMostCalls = 4000;
  std::atomic<std::uint64_t> started{0};      ///< 1 from the beginning of main() on
  std::atomic<std::uint64_t> allocations{0};  ///< malloc and its like
  std::atomic<std::uint64_t> threads{0};      ///< threads that were to be started
  std::atomic<std::uint64_t> outputs{0};  ///< calls on outputs; those beyond kMostCalls unlisted
  std::atomic<std::uint64_t> failed{0};   ///< calls that were made to fail
  std::array<OutputCall, kMostCalls> calls{};
  // What the driver sets while the process runs:
  /// 1: the disk is full, until this is 0 again; 2: after half of the next write.
  std::atomic<std::uint32_t> disk_full{0};
  std::atomic<std::int64_t> clock_offset{0};  ///< [s] by which a running clock is wrong
};

/// The environment variables that the injected library reads. Numbers count from 1; absent or 0:
/// nothing fails, and calls are only counted.
inline constexpr const char* kRecordVariable = "CAIRN_FAULT_RECORD";          ///< file, FaultRecord
inline constexpr const char* kAllocationVariable = "CAIRN_FAULT_ALLOCATION";  ///< N fails
inline constexpr const char* kMemoryVariable = "CAIRN_FAULT_MEMORY";  ///< N and all after it fail
inline constexpr const char* kThreadVariable = "CAIRN_FAULT_THREAD";  ///< N and all after it fail
inline constexpr const char* kOutputVariable = "CAIRN_FAULT_OUTPUT";  ///< N fails, by KIND
/// ENOSPC, EIO, EINTR: once. SHORT: half of the bytes are written. FULL: a disk that is full from
/// there on, after half of the bytes. KILL: the process is killed there, by SIGKILL, in a write
/// after half of the bytes.
inline constexpr const char* kKindVariable = "CAIRN_FAULT_KIND";
/// If it is set, the clock runs, and is wrong by `FaultRecord::clock_offset`; else it stands still.
inline constexpr const char* kClockVariable = "CAIRN_FAULT_CLOCK";

}  // namespace cairn::faults
