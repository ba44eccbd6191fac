// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/registration.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::test {

using Pair = std::pair<Id, Id>;

struct Extent {
  double length, angle;
};

/// Of a motion: its translation's length and its rotation's angle, by the chord 2√2 sin(θ/2) that
/// the Frobenius norm of R − 1 is.
Extent extent(const VariableType& type, std::span<const double> motion);

/// All pairs of poses, the lower id first.
std::vector<Pair> all_pairs(const Graph& graph);

/// Σ ‖r‖² of factors on poses at their true states.
std::vector<double> squared_errors(const Graph& truth, const std::vector<Factor>& factors);

/// Whether so many of so many trials are within five standard deviations of what is expected.
void expect_share(std::int64_t count, std::int64_t trials, double probability);

void expect_same(const Factor& a, const Factor& b);

bool was_false(Registration& registration, const Pair& pair);

/// What a call is refused with; fails the test where it is not, or with another code.
std::string message_of(const std::function<void()>& call, ErrorCode code);

/// A simulated world, and registrations of it.
class Registrations : public testing::Test {
 protected:
  void simulate(const std::string& spec);
  std::unique_ptr<Registration> make(const std::string& spec);
  /// The answers to all pairs of poses.
  std::map<Pair, std::vector<Factor>> match_all(Registration& registration);
  Extent truly_apart(const Pair& pair) const;

  Registry registry;
  Simulation world;
};

}  // namespace cairn::test
