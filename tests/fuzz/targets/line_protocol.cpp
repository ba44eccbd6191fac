// SPDX-License-Identifier: BSD-3-Clause
// Lines of `cairn online`: the first byte chooses estimator and settings, the rest is the stream.
// Every line is answered as docs/online.md states, a line that is refused changes nothing, and the
// lines that count give the same estimate again, to the last bit, as a journal needs it.
#include <string>
#include <utility>

#include <fmt/format.h>

#include "cairn/online/conversation.hpp"
#include "cairn/runtime/error.hpp"
#include "fuzz/targets/sessions.hpp"
#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {
namespace {

constexpr int kMostLines = 48;

/// The last line of a text that ends in a line break.
std::string_view last_line(std::string_view text) {
  text.remove_suffix(1);
  const std::size_t before = text.rfind('\n');
  return before == std::string_view::npos ? text : text.substr(before + 1);
}

bool begins_with_one_of(std::string_view line, std::initializer_list<std::string_view> words) {
  for (const std::string_view word : words) {
    if (line.starts_with(word)) return true;
  }
  return false;
}

void expect_well_formed(const LineSession::Reply& reply, std::int64_t number) {
  if (reply.text.empty()) return;
  expect(reply.text.back() == '\n', [&] { return "no end of line: " + reply.text; });
  const std::string_view end = last_line(reply.text);
  if (reply.refused) {
    const std::string begin = fmt::format("ERROR line {}: ", number);
    expect(end.starts_with(begin) && end.size() + 1 == reply.text.size(),
           [&] { return "a refusal that is not one line: " + reply.text; });
  } else {
    expect(begins_with_one_of(end, {"OK ", "SINGULAR ", "UNCONVERGED "}),
           [&] { return "an answer without its last line: " + reply.text; });
  }
}

/// A line that changed something.
struct Kept {
  std::int64_t number;
  std::string line;
};

/// Takes a stream, and remembers what a journal would have.
class Stream {
 public:
  explicit Stream(const SessionSettings& settings) : session_(settings), talk_(session_.lines()) {}

  /// False if this was the last line.
  bool take(const std::string& line) {
    const std::int64_t variables = session_.lines().variable_count(),
                       factors = session_.lines().factor_count();
    const LineSession::Reply reply = talk_.take(line);
    expect_well_formed(reply, ++number_);
    if (reply.changes) kept_.push_back({number_, line});
    expect(reply.changes || (session_.lines().variable_count() == variables &&
                             session_.lines().factor_count() == factors),
           [&] { return fmt::format("'{}' is not in a journal, and changes the graph", line); });
    return !reply.quit;
  }

  void expect_the_same_again(const SessionSettings& settings) {
    talk_.finish();
    OwnedSession again(settings);
    for (const Kept& kept : kept_) {
      try {
        again.lines().restore(kept.line, kept.number);
      } catch (const Error& error) {
        throw Finding(
            fmt::format("line {}, '{}', was taken, and is refused when it is restored: {}",
                        kept.number, kept.line, error.what()));
      }
    }
    const std::string where = difference(session_.estimator(), again.estimator());
    expect(where.empty(), [&] { return "restored, these differ: " + where; });
  }

 private:
  OwnedSession session_;
  Conversation talk_;
  std::int64_t number_ = 0;
  std::vector<Kept> kept_;
};

void run(Bytes bytes) {
  Source source(bytes);
  const SessionSettings settings = session_settings(source.byte());
  std::string_view text = text_of(source.rest());
  Stream stream(settings);
  for (int lines = 0; !text.empty() && lines < kMostLines; ++lines) {
    const std::size_t end = text.find('\n');
    const std::string line(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (writes_a_file(line)) continue;
    if (!stream.take(line)) break;
  }
  stream.expect_the_same_again(settings);
}

std::vector<std::string> seeds() {
  std::vector<std::string> all;
  int k = 0;
  for (const std::string& lines : conversations()) {
    for (const int estimator : {0, 1, 2, 3}) {
      // Every value of the other settings, in turn.
      all.push_back(static_cast<char>(estimator | (k++ * 4 & 0x7c)) + lines);
    }
  }
  return all;
}

}  // namespace

Target line_protocol() {
  return {"line_protocol",
          &run,
          &seeds,
          &protocol_words,
          {{"types", "slam2d"},
           {"types", "slam3d"},
           {"stream_format", "g2o"},
           {"optimizer", "levenberg_marquardt"},
           {"linear_solver", "block_cholesky"},
           {"estimator", "incremental_cholesky"},
           {"estimator", "batch"},
           {"estimator", "periodic_batch"}},
          1024};
}

}  // namespace cairn::fuzz
