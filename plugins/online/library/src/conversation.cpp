// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/conversation.hpp"

#include <algorithm>
#include <limits>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn {

std::string Conversation::restore() {
  if (!journal_) return {};
  for (const Journal::Record& record : journal_->take_records()) {
    try {
      session_.restore(record.text, record.number);
    } catch (const Error& error) {
      throw Error(error.code(),
                  fmt::format("the journal's line {} was taken before and is now refused: {}",
                              record.number, error.what()));
    }
    number_ = record.number;
    ++counts_.restored;
  }
  if (number_ == std::numeric_limits<std::int64_t>::max()) {
    throw Error(
        ErrorCode::input,
        fmt::format("the journal's last line has the number {}: no line can follow it", number_));
  }
  return standing("RESTORED");
}

std::string Conversation::standing(std::string_view word) const {
  return fmt::format("{} {} variables {} factors {}\n", word, number_, session_.variable_count(),
                     session_.factor_count());
}

LineSession::Reply Conversation::take(const std::string& line) {
  ++counts_.lines;
  LineSession::Reply reply = session_.take(line, ++number_);
  counts_.refused += reply.refused;
  counts_.taken += reply.changes && !reply.refused;
  if (reply.solved) {
    ++counts_.solves;
    counts_.solve_seconds += reply.seconds;
    counts_.longest = std::max(counts_.longest, reply.seconds);
  }
  if (journal_ && reply.changes) journal_->append(number_, line);
  if (journal_ && !reply.text.empty()) journal_->commit();  // what is acknowledged is not lost
  return reply;
}

LineSession::Reply Conversation::take_if_it_changes(const std::string& line) {
  LineSession::Reply reply = take(line);
  if (reply.changes) return reply;
  --counts_.lines;
  --number_;
  return reply;
}

LineSession::Reply Conversation::ask(const std::string& line, std::int64_t number) {
  ++counts_.questions;
  return session_.ask(line, number);
}

void Conversation::finish() {
  if (journal_) journal_->commit();
  session_.finish();
}

}  // namespace cairn
