// SPDX-License-Identifier: BSD-3-Clause
// What a sparsifier leaves of a small pose graph, against the minimum of the whole.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/conformance/checker.hpp"
#include "cairn/conformance/repetition.hpp"
#include "cairn/conformance/sample_graph.hpp"
#include "cairn/conformance/samples.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/sparsification/sparsifier.hpp"

namespace {

using namespace cairn;
using namespace cairn::conformance;

constexpr int kPoses = 40;

std::vector<int> some_nodes() {
  std::vector<int> nodes;
  for (int v = 1; v < kPoses; v += 3) nodes.push_back(v);
  return nodes;
}

void check_sparsifier(const Subject& subject, Checker& check) {
  Graph minimum = two_laps(kPoses, check.options().seed);
  minimize_densely(minimum);
  const std::vector<int> nodes = some_nodes();
  check.sample(fmt::format("{} of {} poses removed", nodes.size(), kPoses), [&] {
    const auto sparsifier = made<Sparsifier>(subject, check);
    const Sparsification change =
        check.call("remove", [&] { return sparsifier->remove(minimum, nodes); });
    check.expect(change.removed_variables.size() + change.refused.size() == nodes.size(),
                 "every node is removed or refused", [&] {
                   return fmt::format("{} and {} of {}", change.removed_variables.size(),
                                      change.refused.size(), nodes.size());
                 });
    check.expect(std::ranges::includes(nodes, change.removed_variables), "no other node is removed",
                 [] { return std::string("one is"); });
    Graph sparse = minimum.clone();
    apply(change, sparse);
    const auto left = static_cast<std::size_t>(sparse.variable_count());
    check.expect(left + change.removed_variables.size() == kPoses,
                 "the nodes that stay are those not removed",
                 [&] { return fmt::format("{} stay", left); });
    check.expect(std::isfinite(change.kld) && change.kld > -1e-6, "the KLD is not negative",
                 [&] { return fmt::format("it is {}", change.kld); });
    if (!check.of_defaults()) return;  // an option may give up the minimum for speed
    minimize_densely(sparse);
    check.within(largest_distance(sparse, minimum), 1e-3,
                 "the sparse graph has its minimum where the whole graph has it");
  });
}

Repetition sparsifier_uses(const Subject& subject, Checker& check) {
  return {"remove", 3, [&subject, &check](std::uint64_t input) {
            Graph minimum = two_laps(kPoses, check.options().seed + input);
            minimize_densely(minimum);
            const auto graph = std::make_shared<const Graph>(std::move(minimum));
            const std::shared_ptr<Sparsifier> sparsifier = made<Sparsifier>(subject, check);
            return [sparsifier, graph, nodes = some_nodes()] {
              const Sparsification change = sparsifier->remove(*graph, nodes);
              State result{change.kld};
              for (const Factor& factor : change.factors)
                result.insert(result.end(), factor.measurement.begin(), factor.measurement.end());
              return result;
            };
          }};
}

class SparsifierChecks final : public KindChecks {
 public:
  std::span<const Group> groups() const override {
    static constexpr std::array<Group, 3> all{{{"removal", check_sparsifier},
                                               {"memory", memory_group<sparsifier_uses>, true},
                                               {"threads", threads_group<sparsifier_uses>, true}}};
    return all;
  }
};

}  // namespace

void cairn_register(Registrar& registrar) {
  registrar.add<KindChecks>("sparsifier", {}, [](const Options&, Registry&) {
    return std::make_unique<SparsifierChecks>();
  });
}
