// SPDX-License-Identifier: BSD-3-Clause
// Lines of `cairn online`: the first byte chooses estimator and settings, the rest is the stream.
// Every line is answered as docs/online.md states, a line that is refused changes nothing, and the
// lines that count give the same estimate again, to the last bit, as a journal needs it.
#include <string>

#include "fuzz/targets/sessions.hpp"
#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {
namespace {

constexpr int kMostLines = 48;

void run(Bytes bytes) {
  Source source(bytes);
  const SessionSettings settings = session_settings(source.byte());
  OwnedSession session(settings), again(settings);
  Stream stream(session.lines());
  stream.take_all(text_of(source.rest()), kMostLines);
  restore(stream.taken(), again.lines());
  const std::string where = difference(session.estimator(), again.estimator());
  expect(where.empty(), [&] { return "restored, these differ: " + where; });
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
          session_needs({{"estimator", "batch"}, {"estimator", "periodic_batch"}}),
          1024};
}

}  // namespace cairn::fuzz
