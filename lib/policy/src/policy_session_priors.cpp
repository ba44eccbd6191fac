// SPDX-License-Identifier: BSD-3-Clause
// Absolute measurements of the newest pose, in the lines of a policy's session.
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/policy/policy_session.hpp"

namespace cairn {
namespace {

std::string_view word_of_prior(LinkVerdict verdict) {
  switch (verdict) {
    case LinkVerdict::linked:
      return "TAKEN";
    case LinkVerdict::inconsistent:
      return "INCONSISTENT";
    case LinkVerdict::waiting:
      return "WAITING";
    default:
      return "UNINFORMATIVE";
  }
}

}  // namespace

/// Data, as an edge is: not answered. Nothing that the policy would refuse later.
void PolicySession::take_prior(Factor prior) {
  const Id pose = prior.variables.front();
  const FactorType& type = *prior.type;
  const std::string name = fmt::format("{} {}", type.tag(), pose);
  if (!motions_ || type.variable_tags().front() != motions_->type().tag())
    throw bad_line(name + ": not a measurement of one pose, and a policy takes no landmarks");
  if (current() != pose) {
    throw bad_line(
        fmt::format("{}: expected a measurement of the newest pose before it ends (DONE)", name));
  }
  if (const std::string problem = type.normalize(prior.measurement.data()); !problem.empty())
    throw bad_line(fmt::format("{}: {}", name, problem));
  expect_complete();
  if (!policy_.unlocated().empty()) {
    throw bad_line(
        name +
        ": it is not known where the robot is on the map; expected a match with it (LOCATE) first");
  }
  begin();
  priors_.push_back(std::move(prior));
}

void PolicySession::offer_priors() {
  for (const Factor& prior : std::exchange(priors_, {})) {
    try {
      (void)policy_.offer_prior(prior);  // its report is in that of the pose
    } catch (const Error& error) {
      // The line was taken, and what follows it is not to blame.
      answer_ += fmt::format("NOTE {} {} was not taken: {}\n", prior.type->tag(),
                             prior.variables.front(), error.what());
    }
  }
}

void PolicySession::note_prior(const PriorReport& prior) {
  answer_ += fmt::format("PRIOR {} {} {} {}\n", prior.pose, word_of_prior(prior.verdict),
                         prior.gain, prior.innovation);
  counts_.priors += prior.verdict == LinkVerdict::linked;
}

}  // namespace cairn
