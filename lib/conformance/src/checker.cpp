// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/conformance/checker.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>

namespace cairn::conformance {
namespace {

constexpr std::size_t kGuard = 64;  // doubles on each side
constexpr std::size_t kShown = 24;  // numbers of a vector

// NaN, so that what is read outside of an array shows in the results; with payloads of their own,
// so that what is written there is recognised.
const double kGuardValue = std::bit_cast<double>(std::uint64_t{0x7ff8'6a75'6172'6421});
const double kUnsetValue = std::bit_cast<double>(std::uint64_t{0x7ff8'756e'7365'7421});

bool same_bits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

}  // namespace

std::string text_of(std::span<const double> numbers) {
  std::string text = "(";
  for (std::size_t k = 0; k < std::min(numbers.size(), kShown); ++k)
    text += fmt::format("{}{}", k == 0 ? "" : ", ", numbers[k]);
  if (numbers.size() > kShown) text += fmt::format(", … {} in all", numbers.size());
  return text + ")";
}

Guarded::Guarded(std::string name, std::span<const double> values)
    : Guarded(std::move(name), values.size()) {
  original_.assign(values.begin(), values.end());
  std::ranges::copy(values, data());
}

Guarded::Guarded(std::string name, std::size_t size)
    : name_(std::move(name)), size_(size), memory_(size + 2 * kGuard + 1, kGuardValue) {
  const bool aligned = reinterpret_cast<std::uintptr_t>(memory_.data() + kGuard) % 16 == 0;
  begin_ = kGuard + (aligned ? 1 : 0);
  std::fill_n(data(), size, kUnsetValue);
}

Guarded Guarded::sum(std::string name, std::size_t size) {
  Guarded made(std::move(name), size);
  std::fill_n(made.data(), size, 0.0);
  return made;
}

Guarded Guarded::in_place(std::string name, std::span<const double> values) {
  Guarded made(std::move(name), values);
  made.original_.clear();
  return made;
}

double* Guarded::data() { return memory_.data() + begin_; }

std::vector<double> Guarded::values() const {
  const auto first = memory_.begin() + static_cast<std::ptrdiff_t>(begin_);
  return {first, first + static_cast<std::ptrdiff_t>(size_)};
}

std::string Guarded::damage() const {
  for (std::size_t k = begin_; k-- > 0;) {
    if (!same_bits(memory_[k], kGuardValue))
      return fmt::format("wrote {} before the first of the {} numbers of '{}'", begin_ - k, size_,
                         name_);
  }
  for (std::size_t k = begin_ + size_; k < memory_.size(); ++k) {
    if (!same_bits(memory_[k], kGuardValue))
      return fmt::format("wrote beyond the end of '{}', which has {} numbers: to number {}", name_,
                         size_, k - begin_ + 1);
  }
  for (std::size_t k = 0; k < original_.size(); ++k) {
    if (!same_bits(memory_[begin_ + k], original_[k]))
      return fmt::format("changed '{}', which it may only read", name_);
  }
  return {};
}

void Checker::fail(std::string_view law, std::string problem) {
  for (ConformanceFinding& finding : result_.findings) {
    if (finding.law != law) continue;
    ++finding.times;
    return;
  }
  result_.findings.push_back({std::string(law), std::move(problem), input(), 1});
}

std::string Checker::input() const {
  if (component_.empty() || input_.empty()) return component_ + input_;
  return component_ + ", " + input_;
}

void Checker::examine_array(std::string_view callback, const Guarded& array) {
  const std::string damage = array.damage();
  expect(damage.empty(), fmt::format("{} writes to its output alone", callback),
         [&] { return damage; });
}

void Checker::threw(std::string_view callback, std::string_view what) {
  ++result_.checks;
  fail(fmt::format("{} throws nothing", callback), fmt::format("it threw: {}", what));
  throw Abandoned{};
}

}  // namespace cairn::conformance
