// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz/targets/sessions.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>

namespace cairn::fuzz {

SessionSettings session_settings(std::uint8_t choice) {
  static constexpr std::array kEstimators = {"incremental_cholesky",
                                             "incremental_cholesky:accuracy=0,full_every=5",
                                             "batch", "periodic_batch:every=4"};
  static constexpr std::array kOutputs = {"none", "last", "changed", "all"};
  static constexpr std::array kMarginals = {"none", "last", "diagonal", "none"};
  return {.estimator = kEstimators[choice & 3],
          .online = {.read = {},
                     .automatic = (choice & 64) == 0,
                     .output = kOutputs[choice >> 2 & 3],
                     .marginals = kMarginals[choice >> 4 & 3]}};
}

namespace {

OnlineSettings with_remover(OnlineSettings settings, PoseRemover& remover) {
  settings.remover = &remover;
  return settings;
}

}  // namespace

OwnedSession::OwnedSession(const SessionSettings& settings)
    : remover_(registry()),
      format_(registry().make<StreamFormat>("g2o")),
      estimator_(registry().make<Estimator>(settings.estimator)),
      lines_(std::make_unique<OnlineSession>(*estimator_, *format_, registry(),
                                             with_remover(settings.online, remover_))) {
  if (settings.online.marginals == "last") estimator_->keep_marginals(KeptMarginals::last);
  if (settings.online.marginals == "diagonal") estimator_->keep_marginals(KeptMarginals::diagonal);
}

namespace {

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
    if (end.starts_with("NOTE ") && end.size() + 1 == reply.text.size())
      return;  // on a measurement
    expect(begins_with_one_of(end, {"OK ", "SINGULAR ", "UNCONVERGED "}),
           [&] { return "an answer without its last line: " + reply.text; });
  }
}

}  // namespace

void Stream::take_all(std::string_view text, int most) {
  for (int lines = 0; !text.empty() && lines < most; ++lines) {
    const std::size_t end = text.find('\n');
    const std::string line(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (writes_a_file(line)) continue;
    if (!take(line)) break;
  }
  conversation_.finish();
}

/// False if this was the last line.
bool Stream::take(const std::string& line) {
  const std::int64_t variables = session_.variable_count(), factors = session_.factor_count();
  const LineSession::Reply reply = conversation_.take(line);
  expect_well_formed(reply, ++number_);
  if (reply.changes) taken_.push_back({number_, line});
  answers_ += reply.text;
  expect(reply.changes || reply.quit ||
             (session_.variable_count() == variables && session_.factor_count() == factors),
         [&] { return fmt::format("'{}' is not in a journal, and changes the graph", line); });
  if (asks_ && !reply.quit) ask();
  return !reply.quit;
}

void Stream::ask() {
  for (const char* question : {"ESTIMATE ALL", "ESTIMATE 1", "COVARIANCE 0 1", "CHI2", "QUIT"}) {
    const std::int64_t variables = session_.variable_count(), factors = session_.factor_count();
    const LineSession::Reply reply = conversation_.ask(question, number_);
    expect_well_formed(reply, number_);
    expect(!reply.changes && !reply.quit && session_.variable_count() == variables &&
               session_.factor_count() == factors,
           [&] { return fmt::format("the question {} changes the session", question); });
  }
}

void restore(const std::vector<TakenLine>& lines, LineSession& session) {
  for (const TakenLine& line : lines) {
    try {
      session.restore(line.text, line.number);
    } catch (const Error& error) {
      throw Finding(fmt::format("line {}, '{}', was taken, and is refused when it is restored: {}",
                                line.number, line.text, error.what()));
    }
  }
}

std::string first_difference(std::string_view a, std::string_view b) {
  const auto at = static_cast<std::size_t>(std::ranges::mismatch(a, b).in1 - a.begin());
  const std::size_t begin = at == 0 ? 0 : a.rfind('\n', at - 1) + 1;
  const auto line = [&](std::string_view text) {
    return text.substr(begin, text.find('\n', begin) - begin);
  };
  return fmt::format("'{}' and '{}'", line(a), line(b));
}

std::string difference(Estimator& a, Estimator& b) {
  if (a.variables() != b.variables()) return "the variables";
  if (a.factors() != b.factors()) return "the factors";
  for (const Id id : a.variables()) {
    const std::span<const double> x = a.state(id);
    const std::vector<double> copy(x.begin(), x.end());
    const std::span<const double> y = b.state(id);
    const auto same = [](double p, double q) { return p == q || (p != p && q != q); };
    if (!std::ranges::equal(copy, y, same)) {
      return fmt::format("the estimate of {}: {} and {}", id, fmt::join(copy, " "),
                         fmt::join(y, " "));
    }
  }
  return {};
}

std::string_view first_word(std::string_view line) {
  constexpr std::string_view kBlanks = " \t\r";
  const std::size_t begin = line.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  line.remove_prefix(begin);
  return line.substr(0, line.find_first_of(kBlanks));
}

bool writes_a_file(std::string_view line) { return first_word(line) == "SAVE"; }

std::vector<Needed> session_needs(std::initializer_list<Needed> more) {
  std::vector<Needed> all = {{"types", "slam2d"},
                             {"types", "slam3d"},
                             {"stream_format", "g2o"},
                             {"optimizer", "levenberg_marquardt"},
                             {"linear_solver", "block_cholesky"},
                             {"estimator", "incremental_cholesky"}};
  all.insert(all.end(), more);
  return all;
}

std::vector<std::string> conversations() {
  return {R"(VERTEX_SE2 0 0 0 0
FIX 0
NEW VERTEX_SE2 1
EDGE_SE2 0 1 1 0 0.1 100 0 0 100 0 100
ESTIMATE ALL
COVARIANCE 0 1
CHI2
QUIT
)",
          R"(VERTEX_SE2 0 0 0 0
NEW VERTEX_SE2 1
EDGE_SE2 0 1 1 0 0.1 9 0 0 9 0 9
NEW VERTEX_SE2 2
EDGE_SE2 1 2 1 0 0.1 9 0 0 9 0 9
EDGE_SE2 0 2 2 0.1 0.2 9 0 0 9 0 9
CHANGE 1 1 0.1 0.1 5 0 0 5 0 5
MARGINALIZE 0
REMOVE FACTOR 2
SOLVE
FULL
)",
          R"(VERTEX_SE2 0 0 0 0
NEW VERTEX_SE2 1
EDGE_SE2 0 1 1 0 0.1 9 0 0 9 0 9
NEW VERTEX_SE2 2
EDGE_SE2 1 2 1 0 0.1 9 0 0 9 0 9
NEW VERTEX_SE2 3
EDGE_SE2 2 3 1 0 0.1 9 0 0 9 0 9
EDGE_SE2 0 2 2 0.1 0.2 9 0 0 9 0 9
SPARSIFY 1
SPARSIFY KEEP 3
NEW VERTEX_SE2 4
EDGE_SE2 3 4 1 0 0.1 9 0 0 9 0 9
SPARSIFY 0 2
FULL
SPARSIFY KEEP ALL
)",
          R"(VERTEX_SE2 0 0 0 0
VERTEX_XY 3 1 1
EDGE_SE2_XY 0 3 1 1 4 0 4
EDGE_PRIOR_SE2 0 0 0 0 1 0 0 1 0 1
REMOVE VARIABLE 3
ESTIMATE 0
COVARIANCE 0 0
)",
          R"(VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1
NEW VERTEX_SE3:QUAT 1
EDGE_SE3:QUAT 0 1 1 0 0 0 0 0.1 1 9 0 0 0 0 0 9 0 0 0 0 9 0 0 0 9 0 0 9 0 9
PARAMS_SE3OFFSET 0 0 0 0.1 0 0 0 1
VERTEX_TRACKXYZ 2 1 1 1
EDGE_SE3_TRACKXYZ 1 2 0 0.1 1 1 5 0 0 5 0 5
ESTIMATE ALL
COVARIANCE 0 2
FULL
MARGINALIZE 1
CHI2
)",
          R"(VERTEX_SE2 0 1e200 0 0
FIX 0
VERTEX_SE2 1 -1e200 0 0
EDGE_SE2 0 1 1 0 0 1e-30 0 0 1e30 0 1
SOLVE
CHI2
COVARIANCE 1 1
)",
          R"(# a comment

NONSENSE
EDGE_SE2 7 8 1 0 0 1 0 0 1 0 1
CHANGE 0 1
REMOVE VARIABLE 9
MARGINALIZE
NEW VERTEX_SE9 1
FIX 3
)"};
}

std::vector<std::string> protocol_words() {
  std::vector<std::string> all = {"NEW ",
                                  "REMOVE FACTOR ",
                                  "REMOVE VARIABLE ",
                                  "CHANGE ",
                                  "MARGINALIZE ",
                                  "SPARSIFY ",
                                  "SPARSIFY KEEP ",
                                  "SOLVE\n",
                                  "FULL\n",
                                  "COVARIANCE ",
                                  "ESTIMATE ",
                                  "ESTIMATE ALL\n",
                                  "CHI2\n",
                                  "QUIT\n",
                                  "FIX ",
                                  "\n",
                                  "1e308",
                                  "-1",
                                  " 1 0 0 1 0 1\n"};
  for (const char* kind : {"variable", "factor"}) {
    for (const std::string& tag : registry().names(kind)) all.push_back(tag + " ");
  }
  return all;
}

}  // namespace cairn::fuzz
