// SPDX-License-Identifier: BSD-3-Clause
// Updates of `IncrementalCholesky` that fail: what is recorded of each, to go back to where it
// began.
#include <memory>
#include <utility>

#include "cairn/types/never_throws.hpp"
#include "incremental_cholesky.hpp"
#include "record.hpp"

namespace cairn::incremental {

void IncrementalCholesky::become(IncrementalCholesky&& other) {
  engine_ = std::move(other.engine_);
  variables_ = other.variables_;
  factors_ = other.factors_;
  losses_ = std::move(other.losses_);
  since_solved_ = other.since_solved_;
  since_full_ = other.since_full_;
  kept_ = other.kept_;
  told_ = std::move(other.told_);
  has_removed_ = other.has_removed_;
  watch_ = other.watch_;
  watched_load_ = other.watched_load_;
  forget_what_was_read();
}

/// Whether something in the update, if it is evaluated, may throw.
bool IncrementalCholesky::may_throw(const GraphUpdate& update) {
  for (const Factor& factor : update.factors) {
    if (factor.loss && !dynamic_cast<const NeverThrows*>(factor.loss.get())) return true;
    if (!factor.type || factor.type == harmless_) continue;
    if (!dynamic_cast<const NeverThrows*>(factor.type.get())) return true;
    harmless_ = factor.type;
  }
  return false;
}

/// The update that follows is recorded as the next step, with what others answer meanwhile.
void IncrementalCholesky::begin_step(const UpdateOptions& options) {
  if (!record_ || record_->is_long()) {
    record_.reset();
    record_ = std::make_unique<Record>(*this);
  }
  record_->begin = record_->answers.end();
  record_->pace = engine_->pace();
  record_->steps.emplace_back(
      [options](IncrementalCholesky& also) { also.carry_out({}, options); });
  keep_answers(&record_->answers);
}

/// Takes back the step that was begun last.
void IncrementalCholesky::forget_step() {
  keep_answers(nullptr);
  if (!record_) return;
  record_->steps.pop_back();
  record_->answers.cut(record_->begin);
}

/// Undoes the update that has failed: to the last bit, or else nothing can be done with the
/// estimator any more. A journal does not have what was refused.
void IncrementalCholesky::go_back() {
  lost_ = true;
  try {
    if (before_) {
      become(std::move(*before_));
    } else if (record_) {
      Record& record = *record_;
      record.answers.repeat(true);
      auto again = std::make_unique<IncrementalCholesky>(*record.before);
      again->keep_answers(&record.answers);
      for (const auto& step : record.steps) step(*again);
      again->keep_answers(nullptr);
      again->engine_->set_pace(record.pace);
      become(std::move(*again));
      record_.reset();  // the next one begins here
    } else {
      return;
    }
    lost_ = false;
  } catch (...) {  // the first failure is the one to be reported
    record_.reset();
  }
}

}  // namespace cairn::incremental
