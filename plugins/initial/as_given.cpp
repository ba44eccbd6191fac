// SPDX-License-Identifier: BSD-3-Clause
#include "guesses.hpp"

namespace cairn::initial {
namespace {

/// The states that the graph came with.
class AsGiven final : public InitialGuess {
 public:
  std::vector<std::string> compute(Graph&) override { return {}; }
};

}  // namespace

std::unique_ptr<InitialGuess> make_as_given() { return std::make_unique<AsGiven>(); }

}  // namespace cairn::initial
