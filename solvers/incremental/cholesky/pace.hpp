// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <functional>
#include <optional>
#include <utility>

#include "answers.hpp"

namespace cairn::incremental {

/// Kinds of work, of which each piece has an amount, in a unit of its own.
enum class Work {
  order,       ///< variables that are ordered
  factorize,   ///< nanoseconds by `block::CostModel`
  substitute,  ///< doubles of L that are read
  move,        ///< variables or factors that a step moves
  evaluate,    ///< factors
  linearize,   ///< factors
  count
};

/// Whether the update at hand has time for one more piece of work: for one that is expected to end
/// within the limit. How long work of a kind takes is measured on the way.
///
/// The first piece of an update is always allowed, so that work which is continued update by update
/// ends, whatever the limit. Without a limit every piece is allowed and no clock is read.
class Pace {
 public:
  /// Seconds since some point of time.
  using Clock = std::function<double()>;

  /// An update begins that may take so many seconds; 0: any.
  void begin(double max_seconds) {
    limit_ = max_seconds;
    first_ = true;
    piece_.reset();
    largest_ = 0.0;
    if (limited()) end_ = now() + limit_;
  }
  bool limited() const { return limit_ > 0.0; }
  double limit() const { return limit_; }

  /// Whether a piece may begin; if so its time is measured until this is asked again. Pieces of one
  /// kind that are expected to take little are allowed several at a time.
  bool allows(Work kind, double amount) {
    if (!limited()) return true;
    if (!answers_) return measure(kind, amount);
    return answers_->number([&] { return measure(kind, amount) ? 1.0 : 0.0; }) != 0.0;
  }
  /// What is allowed is recorded there, or taken from there (see `Answers`).
  void keep_answers(Answers* answers) { answers_.in(answers); }
  /// So many seconds at the end of the update are for something else.
  void keep_free(double seconds) { reserved_ = seconds; }
  /// The largest amount of work that began as one piece in this update; for tests, with a clock of
  /// their own.
  double largest() const { return largest_; }
  /// So that tests do not depend on time. It is read for each piece.
  void set_clock(Clock clock) {
    clock_ = std::move(clock);
    short_ = 0.0;
  }

 private:
  struct Piece {
    Work kind;
    double amount, expected, begin;
  };
  static constexpr double kShort = 30e-6;  ///< seconds between two looks at the clock
  static constexpr double kLearn = 0.1;    ///< weight of the last piece in what is expected

  bool measure(Work kind, double amount) {
    const double expected = rate(kind) * amount;
    if (piece_ && piece_->kind == kind && piece_->expected + expected < short_) {
      piece_->expected += expected;
      piece_->amount += amount;
      return true;
    }
    const double time = now();
    learn(time);
    piece_.reset();
    if (!std::exchange(first_, false) && time + expected > end_ - reserved_) return false;
    piece_ = {kind, amount, expected, time};
    largest_ = std::max(largest_, amount);
    return true;
  }
  double& rate(Work kind) { return rates_[static_cast<std::size_t>(kind)]; }
  double now() const {
    if (clock_) return clock_();
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }
  /// A piece that was interrupted by another process counts as twice as long as expected at most.
  void learn(double time) {
    if (!piece_ || !(piece_->amount > 0.0)) return;
    double& known = rate(piece_->kind);
    known += kLearn * (std::min((time - piece_->begin) / piece_->amount, 2.0 * known) - known);
  }

  AnswersKept answers_;
  Clock clock_;
  double short_ = kShort;
  double limit_ = 0.0, end_ = 0.0, reserved_ = 0.0, largest_ = 0.0;
  bool first_ = true;
  std::optional<Piece> piece_;
  /// Seconds for each unit, on an ordinary machine at first.
  std::array<double, static_cast<std::size_t>(Work::count)> rates_{1e-6,   1.5e-9, 1e-9,
                                                                   0.2e-6, 0.6e-6, 1.5e-6};
};

}  // namespace cairn::incremental
