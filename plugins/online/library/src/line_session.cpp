// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/line_session.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/text/spelling.hpp"
#include "escaped_bytes.hpp"

namespace cairn {
namespace {

/// What can be asked without an effect.
const std::array<std::string, 4> kQuestions{"CHI2", "COVARIANCE", "ESTIMATE", "HELP"};

constexpr std::string_view kBlanks = " \t\r";
constexpr std::size_t kLongestMessage = 4000;  // [bytes] a line may have 16 MB

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> words;
  for (std::size_t at = 0; (at = line.find_first_not_of(kBlanks, at)) != std::string_view::npos;) {
    if (line[at] == '#') break;
    const std::size_t end = std::min(line.find_first_of(kBlanks, at), line.size());
    words.push_back(line.substr(at, end - at));
    at = end;
  }
  return words;
}

/// "ERROR line N: …" on one line. The format's messages begin with the place themselves.
std::string error_line(std::int64_t number, std::string message, std::string_view stream) {
  const std::string place = fmt::format("{}:{}: ", stream, number);
  if (message.starts_with(place)) message.erase(0, place.size());
  std::ranges::replace(message, '\n', ' ');
  if (message.size() > kLongestMessage) message = message.substr(0, kLongestMessage) + "...";
  return fmt::format("ERROR line {}: {}\n", number, escaped_bytes(message));
}

/// Also of sockets, which std::filesystem::equivalent leaves open. False where one is not there.
bool is_same_file(const std::string& a, const std::filesystem::path& b) {
  struct stat of_a {};
  struct stat of_b {};
  return ::stat(a.c_str(), &of_a) == 0 && ::stat(b.c_str(), &of_b) == 0 &&
         of_a.st_dev == of_b.st_dev && of_a.st_ino == of_b.st_ino;
}

/// True as long as this object lives.
class SetWhile {
 public:
  explicit SetWhile(bool& flag) : flag_(flag) { flag = true; }
  SetWhile(const SetWhile&) = delete;
  SetWhile& operator=(const SetWhile&) = delete;
  ~SetWhile() { flag_ = false; }

 private:
  bool& flag_;
};

template <class Number>
std::optional<Number> number_of(std::string_view word) {
  Number number{};
  const auto [end, problem] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (problem != std::errc{} || end != word.data() + word.size()) return std::nullopt;
  return number;
}

}  // namespace

Graph LineSession::trajectory() {
  throw Error(ErrorCode::usage, "every pose that comes is in the graph: SAVE writes it");
}

LineSession::~LineSession() = default;
void LineSession::finish() {}
std::string LineSession::waiting() const { return {}; }

LineSession::Reply LineSession::take(std::string_view line, std::int64_t number) {
  line_ = number;
  Reply reply;
  const Words words = split(line);
  if (words.empty()) return reply;
  try {
    perform(line, words, reply);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::plugin && !undoes_failures() && !is_question(words[0])) throw;
    reply.text = error_line(number, error.what(), kStreamName);
    reply.refused = true;
  }
  return reply;
}

LineSession::Reply LineSession::ask(std::string_view line, std::int64_t number) {
  if (const std::string_view word = first_word(line); !word.empty() && !is_question(word)) {
    Reply reply;
    reply.refused = true;
    reply.text = error_line(
        number, fmt::format("{} is not a question{}", word, what_is_on_offer(word, kQuestions)),
        kStreamName);
    return reply;
  }
  const SetWhile asking(asking_);
  return take(line, number);
}

std::string_view LineSession::first_word(std::string_view line) {
  const std::size_t begin = line.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos || line[begin] == '#') return {};
  return line.substr(begin, line.find_first_of(kBlanks, begin) - begin);
}

bool LineSession::is_question(std::string_view word) {
  return std::ranges::find(kQuestions, word) != kQuestions.end();
}

void LineSession::restore(std::string_view line, std::int64_t number) {
  line_ = number;
  Reply reply;
  const Words words = split(line);
  if (words.empty()) return;
  const SetWhile silence(silent_);
  try {
    perform(line, words, reply);
  } catch (const Error&) {
    if (!reply.changes) throw;  // or it was answered by an error before, too, after what it changed
  }
}

void LineSession::put_notes(const std::vector<std::string>& notes, Reply& reply) const {
  if (silent()) return;
  std::string text;
  for (const std::string& note : notes) text += fmt::format("NOTE {}\n", note);
  reply.text = text + reply.text;
}

void LineSession::acknowledge(Reply& reply, int owed, std::string_view word) const {
  if (silent_) return;
  reply.text += fmt::format("{} {} variables {} factors {} owed {}\n", word, line_,
                            variable_count(), factor_count(), owed);
}

Error LineSession::bad_line(const std::string& message) { return {ErrorCode::input, message}; }

std::int64_t LineSession::parse_whole(std::string_view word, std::string_view what) {
  const std::optional<std::int64_t> number = number_of<std::int64_t>(word);
  if (!number) throw bad_line(fmt::format("'{}' is not a valid {}", word, what));
  return *number;
}

double LineSession::parse_real(std::string_view word, std::string_view what) {
  const std::optional<double> number = number_of<double>(word);
  if (!number) throw bad_line(fmt::format("'{}' is not a valid {}", word, what));
  return *number;
}

std::vector<std::int64_t> LineSession::parse_ids(std::span<const std::string_view> words,
                                                 std::string_view what) {
  if (words.empty()) throw bad_line(fmt::format("expected one {} or more", what));
  std::vector<std::int64_t> ids;
  for (const std::string_view word : words) ids.push_back(parse_whole(word, what));
  return ids;
}

void LineSession::expect_words(const Words& words, std::size_t count, std::string_view form) {
  if (words.size() == count) return;
  throw bad_line(
      fmt::format("{} with {} words after it; expected '{}'", words[0], words.size() - 1, form));
}

std::string LineSession::file_to_save(const Words& words) const {
  expect_words(words, 2, "SAVE file");
  std::string file(words[1]);
  if (file == "-") throw bad_line("SAVE writes to a file, not to standard output");
  for (const auto& [other, what] : protected_) {
    if (is_same_file(file, other))
      throw bad_line(fmt::format("SAVE would replace {}, {}; name another file", what, file));
  }
  return file;
}

}  // namespace cairn
