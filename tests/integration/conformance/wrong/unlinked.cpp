// SPDX-License-Identifier: BSD-3-Clause
// An initial guess that uses libcairn_slam and is not linked with it.
#include <memory>
#include <string>
#include <vector>

#include "cairn/evaluation/plausibility.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/initial_guess.hpp"

namespace {

using namespace cairn;

class Unlinked final : public InitialGuess {
 public:
  std::vector<std::string> compute(Graph& graph) override {
    return implausible_estimate(graph, 0.0).empty() ? std::vector<std::string>{}
                                                    : std::vector<std::string>{"implausible"};
  }
};

}  // namespace

void cairn_register(Registrar& registrar) {
  registrar.add<InitialGuess>(
      "unlinked", {}, [](const Options&, Registry&) { return std::make_unique<Unlinked>(); });
}
