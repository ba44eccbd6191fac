// SPDX-License-Identifier: BSD-3-Clause
// Lines of `cairn online --policy`: the first byte chooses the policy's options, the second the
// settings and whether there is a map, the rest is the stream. Every line is answered as
// docs/online.md states, one that is refused changes nothing, and at its end the compact graph is
// that of the lines which a journal has, and that of these without the questions among them, to the
// last bit. Questions of other clients, if the second byte asks for them, change neither answers
// nor graph.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <sstream>
#include <string>

#include <fmt/format.h>

#include "cairn/policy/policy_session.hpp"
#include "cairn/runtime/error.hpp"
#include "fuzz/targets/sessions.hpp"
#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {
namespace {

constexpr int kMostLines = 64;
constexpr unsigned kQuestions = 0x80;

struct Choice {
  std::string policy;
  PolicySettings settings;
  bool map = false;
};

Choice choice_of(std::uint8_t options, std::uint8_t settings) {
  static constexpr std::array kThresholds = {"", ",loop_gain=0.2,pose_gain=0.2",
                                             ",loop_gain=0,pose_gain=0", ",strategy=apfl"};
  static constexpr std::array kLinks = {",reuse=true", ",reuse=true,gate=0.99",
                                        ",reuse=true,gate=0.9,trust=0", ""};
  static constexpr std::array kOutputs = {"none", "last", "changed", "all"};
  static constexpr std::array kMarginals = {"none", "last", "diagonal", "none"};
  return {.policy = fmt::format("compact_pose:range=3,angle=1{}{}{},estimator={}",
                                kThresholds[options & 3], kLinks[options >> 2 & 3],
                                (options & 16) != 0 ? ",matches=1" : "",
                                (options & 32) != 0 ? "batch" : "incremental_cholesky"),
          .settings = {.read = {},
                       .output = kOutputs[settings & 3],
                       .marginals = kMarginals[settings >> 2 & 3],
                       .trajectory = (settings & 16) != 0},
          .map = (settings & 32) != 0};
}

/// What an earlier session has left: three poses in the plane, 100 to 102.
const Graph& map() {
  static const Graph graph = [] {
    Graph made;
    const auto pose = registry().variable_type("VERTEX_SE2");
    const auto edge = registry().factor_type("EDGE_SE2");
    for (int k = 0; k < 3; ++k) made.add(Variable{pose, 100 + k, {1.0 * k, 0.5, 0.1 * k}, k == 0});
    for (Id k = 100; k < 102; ++k) {
      made.add(Factor{edge, {k, k + 1}, {1.0, 0.0, 0.1}, {9, 0, 0, 9, 0, 9}});
    }
    return made;
  }();
  return graph;
}

/// A policy and its session.
class OwnedPolicy {
 public:
  explicit OwnedPolicy(const Choice& choice)
      : policy_(registry().make<PosePolicy>(choice.policy)),
        format_(registry().make<StreamFormat>("g2o")),
        lines_(*policy_, *format_, registry(), choice.settings) {
    if (choice.map) lines_.load(map());
  }
  PolicySession& lines() { return lines_; }
  PosePolicy& policy() { return *policy_; }

 private:
  std::unique_ptr<PosePolicy> policy_;
  std::unique_ptr<StreamFormat> format_;
  PolicySession lines_;
};

bool is_question(const TakenLine& line) {
  const std::string_view word = first_word(line.text);
  return word == "ESTIMATE" || word == "COVARIANCE" || word == "CHI2";
}

std::string where_they_differ(PosePolicy& a, PosePolicy& b) {
  return a.kept() != b.kept() ? "the kept poses" : difference(a.estimator(), b.estimator());
}

void expect_consistent(PosePolicy& policy) {
  std::vector<Id> kept = policy.kept(), there = policy.estimator().variables();
  std::ranges::copy(policy.landmarks(), std::back_inserter(kept));
  std::ranges::sort(kept);
  std::ranges::sort(there);
  expect(policy.unlocated().empty() ? kept == there : std::ranges::includes(kept, there),
         [&] { return fmt::format("{} kept poses, {} in the graph", kept.size(), there.size()); });
  for (const Id id : there) {
    expect(std::ranges::all_of(policy.estimator().state(id),
                               [](double number) { return std::isfinite(number); }),
           [&] { return fmt::format("the estimate of {} is not finite", id); });
  }
}

/// The first word of each line, and how many words it has: the last bits of what is read depend on
/// what was read before, since the policy copies its estimator for that.
std::string forms_of(const std::string& answers) {
  std::string forms;
  std::istringstream lines(answers);
  for (std::string line; std::getline(lines, line);)
    forms += fmt::format("{} {}\n", first_word(line), std::ranges::count(line, ' '));
  return forms;
}

void run(Bytes bytes) {
  Source source(bytes);
  const std::uint8_t options = source.byte();
  const std::uint8_t settings = source.byte();
  const Choice choice = choice_of(options, settings);
  OwnedPolicy live(choice);
  Stream stream(live.lines());
  const std::string text(text_of(source.rest()));
  stream.take_all(text, kMostLines);
  expect_consistent(live.policy());

  std::vector<TakenLine> lines = stream.taken();
  for (const char* which : {"restored", "without questions"}) {
    OwnedPolicy again(choice);
    restore(lines, again.lines());
    again.lines().finish();
    const std::string where = where_they_differ(live.policy(), again.policy());
    expect(where.empty(), [&] { return fmt::format("{}, these differ: {}", which, where); });
    std::erase_if(lines, &is_question);
  }
  if ((settings & kQuestions) == 0) return;
  OwnedPolicy asked(choice);
  Stream with_questions(asked.lines());
  with_questions.ask_between();
  with_questions.take_all(text, kMostLines);
  const std::string where = where_they_differ(live.policy(), asked.policy());
  expect(where.empty(), [&] { return "with questions of others, these differ: " + where; });
  const std::string before = forms_of(stream.answers());
  const std::string after = forms_of(with_questions.answers());
  expect(before == after, [&] {
    return "with questions of others the answers differ: " + first_difference(before, after);
  });
}

/// A robot that drives round a square, asks for matches, and gets some.
std::string square(bool asks) {
  std::string text = "VERTEX_SE2 0 0 0 0\n";
  for (int k = 1; k < 10; ++k) {
    text += fmt::format("NEW VERTEX_SE2 {}\n", k);
    text += fmt::format("EDGE_SE2 {} {} 1 0 1.5708 25 0 0 25 0 100\n", k - 1, k);
    if (asks) text += "NEXT\n";
    if (k >= 4) text += fmt::format("EDGE_SE2 {} {} 0.0{} 0 0 100 0 0 100 0 400\n", k - 4, k, k);
    if (asks && k % 2 == 0) text += "NEXT\nESTIMATE ALL\n";
    if (k % 3 == 1) text += fmt::format("NEW VERTEX_XY {}\n", 50 + k % 2);
    if (k % 2 == 1) text += fmt::format("EDGE_SE2_XY {} {} 1 0.{} 9 0 9\n", k, 50 + k % 2, k);
    if (k % 5 == 0) text += fmt::format("EDGE_PRIOR_SE2 {} 0.5 {} 0 4 0 0 4 0 0\n", k, k % 4);
    if (k % 3 == 0) text += fmt::format("DONE\nCOVARIANCE 0 {}\n", k);
    if (k % 4 == 2) text += fmt::format("REMOVE LINK {} {}\n", k, k - 4);
  }
  return text;
}

std::vector<std::string> seeds() {
  const std::vector<std::string> streams = {square(true),
                                            square(false),
                                            R"(VERTEX_SE2 0 0 0 0
FIX 0
NEW VERTEX_SE2 1
EDGE_SE2 1 0 -1 0 0 9 0 0 9 0 9
EDGE_SE2 0 1 1 0 0 9 0 0 9 0 9
NEXT
NOMATCH 0 1
DONE
NEW VERTEX_SE2 2
REMOVE VARIABLE 2
NEW VERTEX_SE2 3
EDGE_SE2 1 3 1 0 0 9 0 0 9 0 9
LOCATE 3
NEXT
EDGE_SE2 101 3 0.1 0 0 9 0 0 9 0 9
NEXT
ESTIMATE ALL
COVARIANCE 1 101
CHI2
QUIT
)",
                                            R"(VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1
NEW VERTEX_SE3:QUAT 1
EDGE_SE3:QUAT 0 1 1 0 0 0 0 0.1 1 9 0 0 0 0 0 9 0 0 0 0 9 0 0 0 9 0 0 9 0 9
NEW VERTEX_SE3:QUAT 2
EDGE_SE3:QUAT 1 2 1 0 0 0 0 0.1 1 9 0 0 0 0 0 9 0 0 0 0 9 0 0 0 9 0 0 9 0 9
NEXT
EDGE_SE3:QUAT 0 2 2 0 0 0 0 0.2 1 9 0 0 0 0 0 9 0 0 0 0 9 0 0 0 9 0 0 9 0 9
ESTIMATE ALL
CHI2
)",
                                            R"(VERTEX_SE2 0 0 0 0
EDGE_PRIOR_SE2 0 5 5 1 4 0 0 4 0 0
NEW VERTEX_SE2 1
EDGE_SE2 0 1 1 0 0 9 0 0 9 0 9
EDGE_PRIOR_SE2 1 5 6 1 4 0 0 4 0 0
NEXT
DONE
NEW VERTEX_SE2 2
EDGE_SE2 1 2 1 0 0 9 0 0 9 0 9
EDGE_PRIOR_SE2 2 5 7 1 1e300 0 0 4 0 100
REMOVE LINK 0 2
EDGE_SE2 0 2 0 0 0 100 0 0 100 0 100
EDGE_SE2 101 2 0 0 0 100 0 0 100 0 100
REMOVE LINK 2 101
REMOVE LINK 2 0
DONE
NEW VERTEX_SE2 3
EDGE_SE2 2 3 1 0 0 9 0 0 9 0 9
EDGE_PRIOR_SE2 3 1e200 7 1 1 0 0 1 0 1
)",
                                            R"(NEXT
DONE
SPARSIFY 1
VERTEX_XY 1 0 0
VERTEX_SE2 0 1e200 0 0
NEW VERTEX_SE2 1
EDGE_SE2 0 1 1e200 0 0 1e-30 0 0 1e30 0 1
NEW VERTEX_SE2 2
EDGE_SE2 1 2 -1e300 0 3 1 0 0 1 0 1
EDGE_SE2 0 2 0 0 0 1 0 0 1 0 1
FULL
CHI2
)"};
  std::vector<std::string> all;
  int k = 0;
  for (const std::string& stream : streams) {
    for (int options = 0; options < 64; options += 5) {
      const unsigned questions = k % 2 == 0 ? kQuestions : 0;
      std::string seed{static_cast<char>(options), static_cast<char>((k++ * 7 & 63) | questions)};
      all.push_back(seed + stream);
    }
  }
  return all;
}

std::vector<std::string> words() {
  std::vector<std::string> all = protocol_words();
  for (const char* word : {"NEXT\n", "DONE\n", "NOMATCH ", "NEXT\nDONE\n", "REMOVE LINK ",
                           "EDGE_PRIOR_SE2 ", "NEW VERTEX_XY ", "EDGE_SE2_XY "})
    all.emplace_back(word);
  return all;
}

}  // namespace

Target policy_protocol() {
  return {"policy_protocol",
          &run,
          &seeds,
          &words,
          session_needs({{"pose_policy", "compact_pose"}, {"estimator", "batch"}}),
          2048};
}

}  // namespace cairn::fuzz
