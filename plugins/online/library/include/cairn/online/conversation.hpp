// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "cairn/online/journal.hpp"
#include "cairn/online/line_session.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// A session with a journal beside it: what has been acknowledged is not lost.
///
///     conversation.restore();
///     while (read a line) {
///       const LineSession::Reply reply = conversation.take(line);
///       write reply.text; end if reply.quit;
///     }
///     conversation.finish();
class CAIRN_API Conversation {
 public:
  struct Counts {
    std::int64_t lines = 0;      ///< read, without those restored and questions of others
    std::int64_t questions = 0;  ///< `ask`
    std::int64_t taken = 0, refused = 0, solves = 0, restored = 0;
    double solve_seconds = 0.0, longest = 0.0;  ///< [s] of all solves, and of the longest
  };

  /// `journal` may be null. Both outlive this object.
  explicit Conversation(LineSession& session, Journal* journal = nullptr)
      : session_(session), journal_(journal) {}

  /// Takes in again what the journal has; numbers of lines go on from there. Returns the answer:
  /// "RESTORED …". Throws `Error` where a line is refused now, or has the largest of all numbers.
  std::string restore();
  /// Takes the next line, without its end. What changes anything is in the journal, and committed,
  /// before the reply is handed out.
  LineSession::Reply take(const std::string& line);
  /// The same for one of several clients, which has changed nothing yet: a line that changes
  /// nothing is no line of the stream, and the next has its number.
  LineSession::Reply take_if_it_changes(const std::string& line);
  /// Answers a question (`LineSession::ask`) of another client than that which sends the stream;
  /// `number` is of its own lines.
  LineSession::Reply ask(const std::string& line, std::int64_t number);
  /// No line follows: commits the journal and ends the session.
  void finish();

  /// Of lines in the answers: `LineSession::is_variable_type`.
  bool is_variable_type(std::string_view tag) const { return session_.is_variable_type(tag); }
  /// Of the latest line of the stream.
  std::int64_t line_number() const { return number_; }
  /// The number of the latest line and the size of the graph, after a word:
  /// "RESTORED 812 variables 411 factors 733".
  std::string standing(std::string_view word) const;
  const Counts& counts() const { return counts_; }

 private:
  LineSession& session_;
  Journal* journal_;
  std::int64_t number_ = 0;
  Counts counts_;
};

}  // namespace cairn
