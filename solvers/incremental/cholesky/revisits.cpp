// SPDX-License-Identifier: BSD-3-Clause
#include "revisits.hpp"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <numeric>
#include <utility>

namespace cairn::incremental {
namespace {

/// Shorter runs may be chance.
constexpr std::int32_t kShortest = 4;

}  // namespace

std::int32_t Revisits::Run::expected() const {
  return length < kShortest ? 0 : std::min(kFarthest, length / 2);
}

std::span<Revisits::Run> Revisits::at(std::int64_t time) {
  std::ranges::sort(noted_);
  noted_.erase(std::unique(noted_.begin(), noted_.end()), noted_.end());
  std::erase_if(runs_, [&](const Run& run) { return time - run.time > kPause; });
  by_variable_.resize(runs_.size());
  std::iota(by_variable_.begin(), by_variable_.end(), std::size_t{0});
  const auto variable_of = [&](std::size_t place) { return runs_[place].variable; };
  std::ranges::sort(by_variable_, {}, variable_of);
  std::vector<Run> now;
  std::vector<std::uint8_t> goes_on(runs_.size(), 0);
  for (const std::int32_t v : noted_) {
    Run longest{.variable = v, .time = time};
    auto near = std::ranges::lower_bound(by_variable_, v - kStep, {}, variable_of);
    for (; near != by_variable_.end() && runs_[*near].variable <= v + kStep; ++near) {
      const Run& run = runs_[*near];
      if (run.time == time || run.variable == v) continue;
      goes_on[*near] = 1;
      Run next{.variable = v, .direction = v > run.variable ? 1 : -1, .length = 1, .time = time};
      if (next.direction == run.direction) {
        next = run;
        next.variable = v;
        next.time = time;
        ++next.length;
      }
      if (next.length > longest.length) longest = next;
    }
    now.push_back(longest);
  }
  noted_.clear();
  for (std::size_t k = 0; k < runs_.size(); ++k) {
    if (!goes_on[k]) now.push_back(runs_[k]);
  }
  std::ranges::stable_sort(now, std::greater{}, &Run::length);
  const auto older = std::stable_partition(now.begin(), now.end(),
                                           [&](const Run& run) { return run.time == time; });
  const auto count = std::min<std::ptrdiff_t>(older - now.begin(), kMostRuns);
  runs_ = std::move(now);
  return {runs_.begin(), runs_.begin() + count};
}

}  // namespace cairn::incremental
