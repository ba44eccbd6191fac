// SPDX-License-Identifier: BSD-3-Clause
#include "long_session.hpp"

#include <algorithm>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

namespace cairn::soak {
namespace {

namespace fs = std::filesystem;

constexpr long kWarmUp = 1000;  // poses

fs::path made_anew(fs::path folder) {
  fs::remove_all(folder);
  fs::create_directories(folder);
  return folder;
}

}  // namespace

LongSession::LongSession(const Place& place, std::uint64_t seed)
    : random_(seed),
      robot_(Forgetting::marginalize, seed),
      folder_(made_anew(place.folder / "long")),
      record_(folder_ / "record"),
      session_(online(place, folder_, folder_ / "record",
                      {"--journal", "run.journal", "--marginals", "last"}),
               folder_ / "session.err", {}) {
  session_.restore();
}

void LongSession::drive(int count) {
  std::vector<std::string> lines;
  for (int k = 0; k < count; ++k) std::ranges::move(robot_.next_pose(), std::back_inserter(lines));
  record_->clock_offset = static_cast<std::int64_t>(random_() % 1'000'000) - 500'000;
  if (random_() % 4 == 0) {
    session_.send_unheard(lines);
  } else if (!session_.send(lines)) {
    throw Violated("the long session ends by itself");
  }
  session_.ask("CHI2");
  poses_ += count;
  const long memory = session_.process().memory();
  if (poses_ >= kWarmUp && warm_ == 0) warm_ = memory;
  most_ = std::max(most_, memory);
}

void LongSession::end() {
  if (most_ > warm_ + kMostGrowth) {
    throw Violated("the long session's memory grew from " + std::to_string(warm_) + " to " +
                   std::to_string(most_) + " kB");
  }
  const std::string before = session_.ask("ESTIMATE ALL") + session_.ask("CHI2");
  session_.finish();
  if (!session_.restore().empty()) throw Violated("the long session lacks lines when restored");
  if (session_.ask("ESTIMATE ALL") + session_.ask("CHI2") != before)
    throw Violated("the long session comes to another estimate when restored");
}

}  // namespace cairn::soak
