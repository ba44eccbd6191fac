// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/registration.hpp"

namespace cairn {

Registration::~Registration() = default;
std::vector<Factor> Registration::match_proposed(const MatchProposal& proposal) {
  return match(proposal.earlier, proposal.later);
}
void Registration::pose_ended(Id, bool) {}
bool Registration::matches_recorded_only() const { return false; }
FalseMatches::~FalseMatches() = default;

std::optional<RecognisedPlace> Registration::recognise(std::span<const Id> places, Id pose) {
  for (const Id place : places) {
    if (std::vector<Factor> factors = match(place, pose); !factors.empty())
      return RecognisedPlace{place, std::move(factors)};
  }
  return std::nullopt;
}

}  // namespace cairn
