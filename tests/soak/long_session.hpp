// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <random>

#include "dialogue.hpp"
#include "faults/shared_record.hpp"
#include "mission.hpp"
#include "robot.hpp"

namespace cairn::soak {

/// One process that lives as long as the whole run, and must not grow: its map is bounded. It sees
/// wrong clocks and slow readers. At the end it is restored from its journal, and must come to the
/// same estimate.
class LongSession {
 public:
  /// More than that [kB] it must not grow after its first 1000 poses, 25 times what it keeps. That
  /// is what the buffers for input and answers come to, and a tenth of what the smallest leak that
  /// matters would be: 100 bytes for each of the 100,000 lines of half an hour.
  static constexpr long kMostGrowth = 1024;

  LongSession(const Place& place, std::uint64_t seed);

  /// Drives so many poses.
  void drive(int count);
  /// Whether it has lived long enough to say whether it grows.
  bool is_warm() const { return warm_ > 0; }
  /// Compares it with itself, restored. Throws `Violated`; also if it has grown.
  void end();
  long lines() const { return session_.ledger().confirmed_lines(); }
  /// Resident memory [kB] after the first poses, and most since.
  long warm() const { return warm_; }
  long most() const { return most_; }

 private:
  std::mt19937_64 random_;
  Robot robot_;
  std::filesystem::path folder_;
  faults::SharedRecord record_;
  Dialogue session_;
  long poses_ = 0, warm_ = 0, most_ = 0;
};

}  // namespace cairn::soak
