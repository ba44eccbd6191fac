// SPDX-License-Identifier: BSD-3-Clause
#include "block/places.hpp"

#include <algorithm>
#include <functional>
#include <iterator>
#include <utility>
#include <vector>

namespace cairn::block {
namespace {

class Lifetimes {
 public:
  Lifetimes(std::span<const std::int32_t> events, std::span<const std::int64_t> size,
            std::span<std::int64_t> place)
      : events_(events), size_(size), place_(place) {}

  std::int64_t place() {
    if (pairs() > kMostPairs) return by_time();
    find_neighbours();
    return by_size();
  }

 private:
  static constexpr std::int64_t kMostPairs = 1 << 20;

  /// How many pairs live at the same time.
  std::int64_t pairs() const {
    std::int64_t living = 0, result = 0;
    for (const std::int32_t event : events_) {
      if (event >= 0) result += living;
      living += event < 0 ? -1 : 1;
    }
    return result;
  }
  void find_neighbours() {
    std::vector<std::int32_t> living, at(size_.size(), 0);
    beside_.resize(size_.size());
    for (const std::int32_t event : events_) {
      if (event < 0) {
        at[living.back()] = at[~event];
        living[at[~event]] = living.back();
        living.pop_back();
        continue;
      }
      for (const std::int32_t other : living) {
        beside_[other].push_back(event);
        beside_[event].push_back(other);
      }
      at[event] = static_cast<std::int32_t>(living.size());
      living.push_back(event);
    }
  }
  std::int64_t by_size() {
    std::vector<std::int32_t> all;
    for (const std::int32_t event : events_) {
      if (event < 0) continue;
      all.push_back(event);
      place_[event] = -1;
    }
    std::ranges::stable_sort(all, std::greater{}, [&](std::int32_t s) { return size_[s]; });
    std::int64_t end = 0;
    std::vector<std::pair<std::int64_t, std::int64_t>> used;
    for (const std::int32_t s : all) {
      used.clear();
      for (const std::int32_t other : beside_[s]) {
        if (place_[other] >= 0) used.emplace_back(place_[other], place_[other] + size_[other]);
      }
      std::ranges::sort(used);
      std::int64_t at = 0;
      for (const auto& [first, last] : used) {
        if (first - at >= size_[s]) break;
        at = std::max(at, last);
      }
      place_[s] = at;
      end = std::max(end, at + size_[s]);
    }
    return end;
  }
  std::int64_t by_time() {
    Places places;
    for (const std::int32_t event : events_) {
      if (event < 0) {
        places.give_back(place_[~event], size_[~event]);
      } else {
        place_[event] = places.take(size_[event]);
      }
    }
    return places.end();
  }

  std::span<const std::int32_t> events_;
  std::span<const std::int64_t> size_;
  std::span<std::int64_t> place_;
  std::vector<std::vector<std::int32_t>> beside_;  // by matrix: those that live at the same time
};

}  // namespace

std::int64_t Places::take(std::int64_t size) {
  int tried = 0;
  for (auto it = free_.begin(); it != free_.end() && tried < kMostTried; ++it, ++tried) {
    if (it->second < size) continue;
    const std::int64_t begin = it->first, left = it->second - size;
    free_.erase(it);
    if (left > 0) free_.emplace(begin + size, left);
    return begin;
  }
  // A free stretch at the end may grow.
  std::int64_t begin = end_;
  if (!free_.empty()) {
    const auto last = std::prev(free_.end());
    if (last->first + last->second == end_) {
      begin = last->first;
      free_.erase(last);
    }
  }
  end_ = begin + size;
  return begin;
}

void Places::give_back(std::int64_t begin, std::int64_t size) {
  if (size == 0) return;
  auto [it, added] = free_.emplace(begin, size);
  const auto next = std::next(it);
  if (next != free_.end() && it->first + it->second == next->first) {
    it->second += next->second;
    free_.erase(next);
  }
  if (it != free_.begin()) {
    const auto before = std::prev(it);
    if (before->first + before->second == it->first) {
      before->second += it->second;
      free_.erase(it);
    }
  }
}

std::int64_t place_by_lifetimes(std::span<const std::int32_t> events,
                                std::span<const std::int64_t> size, std::span<std::int64_t> place) {
  return Lifetimes(events, size, place).place();
}

}  // namespace cairn::block
