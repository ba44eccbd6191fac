// SPDX-License-Identifier: BSD-3-Clause
#include "system.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

namespace cairn::incremental {

std::int32_t System::add_variable(std::int32_t size) {
  sizes_.push_back(size);
  offsets_.push_back(scalars_);
  scalars_ += size;
  diagonals_.push_back(take(size * size));
  links_.emplace_back();
  g_.resize(scalars_, 0.0);
  pending_.resize(scalars_, 0.0);
  gradient_.resize(scalars_, 0.0);
  counts_all_.push_back(0);
  change_.resize(scalars_, 0.0);
  aside_.resize(scalars_, 0.0);
  return variables() - 1;
}

std::int32_t System::connect(std::int32_t a, std::int32_t b) {
  const bool fewer = links_[b].size() < links_[a].size();
  for (const Link& link : links_[fewer ? b : a]) {
    if (link.other != (fewer ? a : b)) continue;
    ++entries_[link.entry].factors;
    return link.entry;
  }
  std::int32_t entry;
  if (free_entries_.empty()) {
    entry = static_cast<std::int32_t>(entries_.size());
    entries_.emplace_back();
  } else {
    entry = free_entries_.back();
    free_entries_.pop_back();
  }
  const std::int32_t doubles = sizes_[a] * sizes_[b];
  entries_[entry] = {.value = take(doubles), .doubles = doubles, .factors = 1};
  links_[a].push_back({b, entry});
  links_[b].push_back({a, entry});
  return entry;
}

void System::disconnect(std::int32_t a, std::int32_t b) {
  const std::int32_t entry = find(a, b);
  if (--entries_[entry].factors > 0) return;
  std::erase_if(links_[a], [&](const Link& link) { return link.other == b; });
  std::erase_if(links_[b], [&](const Link& link) { return link.other == a; });
  free_values_[entries_[entry].doubles].push_back(entries_[entry].value);
  free_entries_.push_back(entry);
}

std::int32_t System::find(std::int32_t a, std::int32_t b) const {
  if (links_[b].size() < links_[a].size()) std::swap(a, b);
  const auto link = std::ranges::find(links_[a], b, &Link::other);
  assert(link != links_[a].end());
  return link->entry;
}

void System::count_all(std::int32_t v) {
  if (counts_all_[v] != 0) return;
  counts_all_[v] = 1;
  for (std::int64_t k = offsets_[v]; k < offsets_[v] + sizes_[v]; ++k)
    change_[k] -= std::exchange(aside_[k], 0.0);
}

void System::mark_solved(std::int32_t v) {
  counts_all_[v] = 0;
  for (std::int64_t k = offsets_[v]; k < offsets_[v] + sizes_[v]; ++k) {
    change_[k] += g_[k];
    pending_[k] = 0.0;
  }
}

void System::set_aside(std::int32_t v) {
  mark_solved(v);
  for (std::int64_t k = offsets_[v]; k < offsets_[v] + sizes_[v]; ++k)
    aside_[k] += std::exchange(g_[k], 0.0);
}

void System::clear_gradient(std::int32_t v) {
  for (std::vector<double>* vector : {&gradient_, &change_, &pending_, &aside_})
    std::fill_n(vector->begin() + offsets_[v], sizes_[v], 0.0);
  counts_all_[v] = 1;
}

bool System::has_set_aside(std::int32_t v) const {
  const auto begin = aside_.begin() + offsets_[v];
  return std::any_of(begin, begin + sizes_[v], [](double value) { return value != 0.0; });
}

void System::clear_values() {
  values_.fill_with_zeros();
  for (std::vector<double>* vector : {&g_, &pending_, &gradient_, &change_, &aside_})
    std::ranges::fill(*vector, 0.0);
  std::ranges::fill(counts_all_, 0);
}

/// Room for so many doubles, set to zero.
std::int64_t System::take(std::int32_t doubles) {
  if (static_cast<std::size_t>(doubles) < free_values_.size() && !free_values_[doubles].empty()) {
    const std::int64_t place = free_values_[doubles].back();
    free_values_[doubles].pop_back();
    std::fill_n(values_.at(place), doubles, 0.0);
    return place;
  }
  if (free_values_.size() <= static_cast<std::size_t>(doubles)) free_values_.resize(doubles + 1);
  return values_.take(static_cast<std::size_t>(doubles));
}

}  // namespace cairn::incremental
