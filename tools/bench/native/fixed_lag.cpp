// SPDX-License-Identifier: BSD-3-Clause
// What a fixed lag costs beside keeping everything: a recorded graph, fed pose by pose to
// `incremental_cholesky`, once as it is and once so that only the newest poses stay. The oldest
// pose is marginalised in the update that brings a new one, and with it the landmarks that it was
// the last to see; later measurements of what has left are dropped. Processor time of the updates
// alone, medians over rounds that take turns.
//
//   cairn_fixed_lag GRAPH [STEPS] [LAG] [ROUNDS]     default: all 50 5
#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <limits>
#include <string>
#include <vector>

#include <fmt/core.h>

#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/update/recorded_graph.hpp"

namespace cairn::performance {
namespace {

/// A recorded graph as updates, with what leaves in each.
std::vector<GraphUpdate> updates_of(const Graph& graph, std::size_t steps, std::size_t lag) {
  const std::vector<Arrival> arrivals = arrival_order(graph);
  const std::size_t count = std::min(steps, arrivals.size());
  constexpr std::size_t kNever = std::numeric_limits<std::size_t>::max();
  const auto variables = static_cast<std::size_t>(graph.variable_count());
  std::vector<std::size_t> leaves(variables, kNever);  // by variable: the step that it leaves in
  std::vector<GraphUpdate> updates;
  for (std::size_t k = 0; k < count; ++k) {
    if (lag > 0) leaves[static_cast<std::size_t>(arrivals[k].pose())] = k + lag;
    GraphUpdate update = arrival_update(graph, arrivals[k]);
    const auto leaves_of = [&](Id id) -> std::size_t& {
      return leaves[static_cast<std::size_t>(graph.find(id).value())];
    };
    std::erase_if(update.factors, [&](const Factor& factor) {
      return std::ranges::any_of(factor.variables, [&](Id id) { return leaves_of(id) < k; });
    });
    for (const Factor& factor : update.factors) {
      for (const Id id : factor.variables) {
        if (lag == 0) continue;
        const bool landmark =
            graph.type(*graph.find(id)).tag() != graph.type(arrivals[k].pose()).tag();
        if (landmark) leaves_of(id) = k + lag;
      }
    }
    updates.push_back(std::move(update));
  }
  for (std::size_t v = 0; v < variables; ++v) {
    if (leaves[v] < count) updates[leaves[v]].marginalized.push_back(graph.id(static_cast<int>(v)));
  }
  return updates;
}

struct Run {
  double total = 0.0, longest = 0.0;  // [s]
  double linearize = 0.0, order = 0.0, factorize = 0.0, solve = 0.0, check = 0.0;
  std::int64_t relinearized = 0;
  int variables = 0, factors = 0;
};

Run run(const std::vector<GraphUpdate>& updates, Registry& registry) {
  const auto estimator = registry.make<Estimator>("incremental_cholesky");
  Run result;
  for (const GraphUpdate& recorded : updates) {
    GraphUpdate update = recorded;
    leave_states_to_factors(update, *estimator);
    const std::clock_t begin = std::clock();
    const UpdateReport report = estimator->update(update);
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    result.total += seconds;
    result.longest = std::max(result.longest, seconds);
    result.linearize += report.seconds.linearize;
    result.order += report.seconds.order;
    result.factorize += report.seconds.factorize;
    result.solve += report.seconds.solve;
    result.check += report.seconds.check;
    result.relinearized += report.relinearized_factors;
  }
  result.variables = estimator->variable_count();
  result.factors = estimator->factor_count();
  return result;
}

const Run& median(std::vector<Run>& runs) {
  std::ranges::sort(runs, {}, &Run::total);
  return runs[runs.size() / 2];
}

void compare(const std::string& file, std::size_t steps, std::size_t lag, int rounds) {
  Registry registry;
  const Graph graph = read_graph(file, registry);
  const std::vector<GraphUpdate> all = updates_of(graph, steps, 0),
                                 newest = updates_of(graph, steps, lag);
  std::vector<Run> keeping, lagging;
  for (int k = 0; k < rounds; ++k) {
    keeping.push_back(run(all, registry));
    lagging.push_back(run(newest, registry));
  }
  fmt::print("{} steps; processor time [ms]\n", all.size());
  fmt::print("{:24} {:>8} {:>8} {:>9} {:>8} {:>9} {:>8} {:>8} {:>12} {:>9} {:>8}\n", "", "total",
             "longest", "linearize", "order", "factorize", "solve", "check", "relinearized",
             "variables", "factors");
  const auto print = [](const std::string& what, const Run& r) {
    fmt::print("{:24} {:8.1f} {:8.2f} {:9.1f} {:8.1f} {:9.1f} {:8.1f} {:8.1f} {:12} {:9} {:8}\n",
               what, 1e3 * r.total, 1e3 * r.longest, 1e3 * r.linearize, 1e3 * r.order,
               1e3 * r.factorize, 1e3 * r.solve, 1e3 * r.check, r.relinearized, r.variables,
               r.factors);
  };
  print("everything", median(keeping));
  print(fmt::format("the newest {} poses", lag), median(lagging));
}

}  // namespace
}  // namespace cairn::performance

int main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "usage: cairn_fixed_lag GRAPH [STEPS] [LAG] [ROUNDS]\n");
    return 2;
  }
  const auto number = [&](int k, long otherwise) {
    return argc > k ? std::strtol(argv[k], nullptr, 10) : otherwise;
  };
  try {
    cairn::set_threads(1);
    cairn::performance::compare(
        argv[1], static_cast<std::size_t>(number(2, std::numeric_limits<int>::max())),
        static_cast<std::size_t>(number(3, 50)), static_cast<int>(std::max(1L, number(4, 5))));
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
}
