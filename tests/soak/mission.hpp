// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include "dialogue.hpp"
#include "faults/shared_record.hpp"
#include "robot.hpp"

namespace cairn::soak {

/// What happens to a session.
enum class Disturbance { kill, terminate, full_disk, slow_reader, gone_reader, half_line, clock };
inline constexpr int kDisturbances = 7;
const char* name_of(Disturbance what);

/// What has happened, over all sessions.
struct Tally {
  std::array<long, kDisturbances> times{};
  long missions = 0, lines = 0, restorations = 0, comparisons = 0;
  long longest = 0;  ///< lines of a journal that was restored
  long sent_again = 0;
  long parts = 0, cuts = 0;  ///< files that killed processes left
};

/// Where things are.
struct Place {
  std::filesystem::path program, library, folder;
};

/// The environment and command of `cairn online`, in a folder of its own. `record`: the file of the
/// injected library, or empty to go without it.
faults::Launch online(const Place& place, const std::filesystem::path& folder,
                      const std::filesystem::path& record, std::vector<std::string> arguments);

/// A robot that talks to `cairn online`, which is disturbed and goes on from its journal; and an
/// undisturbed session without a journal that gets the lines which are acknowledged or restored.
/// Both must have the same estimate and chi2 whenever they are compared, to the last digit.
class Mission {
 public:
  /// All is drawn from the seed.
  Mission(const Place& place, std::uint64_t seed, Tally& tally);

  /// Drives, disturbs and compares, once.
  void round();
  /// The last comparison, and the end of both sessions.
  void end();
  std::string what_it_did() const { return did_; }

 private:
  std::uint64_t below(std::uint64_t limit) { return random_() % limit; }
  std::vector<std::string> poses(std::uint64_t count);
  void drive(std::uint64_t count);
  void disturb(Disturbance what);
  void kill();
  void terminate();
  void fill_disk();
  void lose_reader();
  void end_in_half_a_line();
  void go_on(bool has_map);
  void compare();
  void compare_map();
  void expect_code(int status, int code) const;

  std::mt19937_64 random_;
  Tally& tally_;
  std::filesystem::path folder_;
  bool keeps_map_;
  Robot robot_;
  faults::SharedRecord record_;
  Dialogue reference_, session_;
  std::string did_;
};

}  // namespace cairn::soak
