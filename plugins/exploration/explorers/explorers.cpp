// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <memory>
#include <optional>

#include "cairn/exploration/random_stream.hpp"
#include "cairn/plugin/registry.hpp"
#include "frontier_explorer.hpp"

namespace cairn::exploration {
namespace {

/// The nearest one by the length of the path.
class NearestFrontier final : public FrontierExplorer {
 public:
  using FrontierExplorer::FrontierExplorer;

 private:
  void choose(const Situation&, Decision& decision) override {
    const auto nearest = std::ranges::min_element(decision.candidates, {}, &Candidate::value);
    decision.chosen = static_cast<std::size_t>(nearest - decision.candidates.begin());
  }
};

class RandomFrontier final : public FrontierExplorer {
 public:
  using FrontierExplorer::FrontierExplorer;
  void begin(std::uint64_t seed) override {
    FrontierExplorer::begin(seed);
    random_.emplace(seed, RandomStream::Purpose::explorer);
  }

 private:
  void choose(const Situation&, Decision& decision) override {
    decision.chosen = random_->below(decision.candidates.size());
  }

  std::optional<RandomStream> random_;
};

}  // namespace
}  // namespace cairn::exploration

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::exploration;
  registrar.add<Explorer, FrontierOptions>(
      "frontier", [](const FrontierOptions& options, Registry& registry) {
        return std::make_unique<NearestFrontier>(options, registry);
      });
  registrar.add<Explorer, FrontierOptions>(
      "random", [](const FrontierOptions& options, Registry& registry) {
        return std::make_unique<RandomFrontier>(options, registry);
      });
}
