// SPDX-License-Identifier: BSD-3-Clause
#include "policy_answers.hpp"

#include <sstream>

#include <fmt/format.h>
#include <Eigen/Core>

#include "cairn/graph/packed.hpp"

namespace cairn {
namespace {

std::string_view word_of(LinkVerdict verdict) {
  switch (verdict) {
    case LinkVerdict::linked:
      return "LINKED";
    case LinkVerdict::unmatched:
      return "UNMATCHED";
    case LinkVerdict::uninformative:
      return "UNINFORMATIVE";
    case LinkVerdict::inconsistent:
      return "INCONSISTENT";
    case LinkVerdict::waiting:
      return "WAITING";
    case LinkVerdict::nonlinear:
      return "NONLINEAR";
  }
  return "";
}

/// Of absolute measurements, and those of landmarks.
std::string_view word_of_prior(LinkVerdict verdict) {
  if (verdict == LinkVerdict::linked) return "TAKEN";
  return word_of(verdict == LinkVerdict::unmatched ? LinkVerdict::uninformative : verdict);
}

std::string_view word_of_landmark(const LandmarkReport& landmark) {
  if (landmark.added) return "ADDED";
  if (landmark.removed) return "LEFT";
  return landmark.verdict == LinkVerdict::unmatched ? "NOTADDED" : word_of_prior(landmark.verdict);
}

}  // namespace

void PolicyAnswers::note(std::string_view sentence) { text_ += fmt::format("NOTE {}\n", sentence); }

/// "MATCH i n gain", the expected motion, and the upper triangle of its covariance by rows.
std::string PolicyAnswers::match_line(const MatchProposal& match, int tangent) {
  std::string text = fmt::format("MATCH {} {} {}", match.earlier, match.later, match.gain);
  for (const double number : match.expected.mean) text += fmt::format(" {}", number);
  if (!match.expected.covariance.empty()) {
    const Eigen::Map<const Eigen::MatrixXd> S(match.expected.covariance.data(), tangent, tangent);
    for (const double number : pack(S)) text += fmt::format(" {}", number);
  }
  return text + '\n';
}

void PolicyAnswers::link(const LinkReport& link) {
  text_ += fmt::format("{} {} {} {} {}\n", word_of(link.verdict), link.earlier, link.later,
                       link.gain, link.innovation);
  linked += link.verdict == LinkVerdict::linked;
}

void PolicyAnswers::prior(const PriorReport& prior) {
  text_ += fmt::format("PRIOR {} {} {} {}\n", prior.pose, word_of_prior(prior.verdict), prior.gain,
                       prior.innovation);
  priors += prior.verdict == LinkVerdict::linked;
}

void PolicyAnswers::landmark(const LandmarkReport& landmark,
                             const std::function<std::int64_t()>& in_graph) {
  text_ += fmt::format("LANDMARK {} {} {} {} {}\n", landmark.pose, landmark.landmark,
                       word_of_landmark(landmark), landmark.gain, landmark.innovation);
  landmarks += landmark.added;
  if (landmark.verdict == LinkVerdict::linked) observations += landmark.factors;
  if (!landmark.removed) return;
  observations -= landmark.factors;
  landmarks = in_graph();
}

std::vector<std::string> PolicyAnswers::notes() const {
  constexpr std::string_view kNote = "NOTE ";
  std::vector<std::string> notes;
  std::istringstream lines(text_);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with(kNote)) notes.push_back(line.substr(kNote.size()));
  }
  return notes;
}

}  // namespace cairn
