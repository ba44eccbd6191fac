// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "answers.hpp"
#include "incremental_cholesky.hpp"
#include "pace.hpp"

namespace cairn::incremental {

/// Updates from one copy on, so that the state after all of them can be had again: the copy, what
/// was done since, and what others have answered meanwhile.
struct IncrementalCholesky::Record {
  /// Of less it is no use to make another copy.
  static constexpr std::size_t kBytes = std::size_t{1} << 20;
  static constexpr std::size_t kSteps = 256;

  explicit Record(const IncrementalCholesky& of)
      : before(std::make_unique<IncrementalCholesky>(of)) {}

  /// Whether to begin anew from a copy costs no more than what was recorded.
  bool is_long() const {
    const auto bytes = static_cast<std::size_t>(8 * before->engine_->problem().doubles());
    const auto variables = static_cast<std::size_t>(before->variables_);
    return answers.bytes() > std::max(kBytes, bytes) ||
           steps.size() > std::max(kSteps, variables / 4);
  }

  std::unique_ptr<IncrementalCholesky> before;
  std::vector<std::function<void(IncrementalCholesky&)>> steps;
  Answers answers;
  // Of the update at hand:
  Answers::Place begin;
  Pace pace;
};

}  // namespace cairn::incremental
