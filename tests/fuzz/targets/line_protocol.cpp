// SPDX-License-Identifier: BSD-3-Clause
// Lines of `cairn online`: the first byte chooses estimator and settings, the rest is the stream.
// Every line is answered as docs/online.md states, a line that is refused changes nothing, and the
// lines that count give the same estimate again, to the last bit, as a journal needs it. Questions
// of other clients, if the first bit is set, change neither answers nor estimate.
#include <string>

#include "fuzz/targets/sessions.hpp"
#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {
namespace {

constexpr int kMostLines = 48;
constexpr unsigned kQuestions = 0x80;

void run(Bytes bytes) {
  Source source(bytes);
  const std::uint8_t choice = source.byte();
  const SessionSettings settings = session_settings(choice);
  OwnedSession session(settings), again(settings);
  Stream stream(session.lines());
  const std::string text(text_of(source.rest()));
  stream.take_all(text, kMostLines);
  restore(stream.taken(), again.lines());
  const std::string where = difference(session.estimator(), again.estimator());
  expect(where.empty(), [&] { return "restored, these differ: " + where; });
  if ((choice & kQuestions) == 0) return;
  OwnedSession asked(settings);
  Stream with_questions(asked.lines());
  with_questions.ask_between();
  with_questions.take_all(text, kMostLines);
  const std::string after = difference(session.estimator(), asked.estimator());
  expect(after.empty(), [&] { return "with questions of others, these differ: " + after; });
  expect(with_questions.answers() == stream.answers(), [&] {
    return "with questions of others the answers differ: " +
           first_difference(stream.answers(), with_questions.answers());
  });
}

std::vector<std::string> seeds() {
  std::vector<std::string> all;
  int k = 0;
  for (const std::string& lines : conversations()) {
    for (const int estimator : {0, 1, 2, 3}) {
      // Every value of the other settings, in turn.
      const unsigned questions = k % 2 == 0 ? kQuestions : 0;
      all.push_back(static_cast<char>(estimator | (k++ * 4 & 0x7c) | questions) + lines);
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
          session_needs({{"estimator", "batch"}, {"estimator", "periodic_batch"}}),
          1024};
}

}  // namespace cairn::fuzz
