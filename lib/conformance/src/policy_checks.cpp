// SPDX-License-Identifier: BSD-3-Clause
// What policies and sparsifiers leave of a small pose graph, against the minimum of the whole.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "cairn/geometry/pose_chain.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/policy/policy_run.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/policy/registration.hpp"
#include "cairn/sparsification/sparsifier.hpp"
#include "checker.hpp"
#include "sample_graph.hpp"
#include "samples.hpp"

namespace cairn::conformance {
namespace {

constexpr int kPoses = 40;
/// How far a pose may be from where all measurements put it [m, rad]: some standard deviations of
/// the odometry of half a lap.
constexpr double kDrift = 0.5;

/// The largest distance of a variable of both graphs.
double largest_distance(const Graph& some, const Graph& all) {
  double largest = 0.0;
  for (int v = 0; v < some.variable_count(); ++v) {
    const std::optional<int> other = all.find(some.id(v));
    if (!other) continue;
    State delta(3);
    some.type(v).local(1, some.state(v).data(), all.state(*other).data(), delta.data());
    const double distance = norm(delta);
    if (!(distance <= largest)) largest = distance;
  }
  return largest;
}

/// The measurements of the graph, as answers to the policy's questions.
class Recorded {
 public:
  explicit Recorded(const Graph& graph) {
    for (int f = 0; f < graph.factor_count(); ++f) {
      Factor factor = graph.factor(f);
      auto ends = std::minmax(factor.variables[0], factor.variables[1]);
      factors_[{ends.first, ends.second}].push_back(std::move(factor));
    }
  }
  std::vector<Factor> operator()(Id a, Id b) const {
    const auto found = factors_.find({std::min(a, b), std::max(a, b)});
    return found == factors_.end() ? std::vector<Factor>{} : found->second;
  }

 private:
  std::map<std::pair<Id, Id>, std::vector<Factor>> factors_;
};

void check_policy(const Subject& subject, Checker& check) {
  Graph minimum = two_laps(kPoses, check.options().seed);
  minimize_densely(minimum);
  check.sample(fmt::format("{} poses on two laps, matched as recorded", kPoses), [&] {
    const PolicyData data = policy_data(two_laps(kPoses, check.options().seed));
    FunctionRegistration registration{Recorded(data.recording)};
    const auto policy = subject.registry.make<PosePolicy>(subject.name);
    std::size_t ended = 0;
    check.call("the policy", [&] {
      policy->expect(data.recording, data.poses);
      run_policy(data.recording, data.poses, *policy, registration, [&](const PoseReport&) {
        ++ended;
        return true;
      });
    });
    check.expect(ended == data.poses.size(), "every pose is ended with a report",
                 [&] { return fmt::format("{} of {}", ended, data.poses.size()); });
    const std::vector<Id> kept = check.call("kept", [&] { return policy->kept(); });
    const std::set<Id> distinct(kept.begin(), kept.end());
    check.expect(!kept.empty() && distinct.size() == kept.size(), "kept names poses once each",
                 [&] { return fmt::format("{} names, {} poses", kept.size(), distinct.size()); });
    check.expect(std::ranges::all_of(kept, [&](Id id) { return minimum.find(id).has_value(); }),
                 "kept names poses of the trajectory",
                 [] { return std::string("one is not of it"); });
    const Graph compact = check.call("estimator", [&] { return policy->estimator().graph(); });
    check.expect(std::isfinite(chi2(compact)), "chi2 is finite",
                 [&] { return fmt::format("{}", chi2(compact)); });
    check.within(largest_distance(compact, minimum), kDrift,
                 "poses that are kept are where all measurements put them");
    const Graph whole =
        check.call("chains", [&] { return recovered_trajectory(*policy, Recovery{}); });
    check.expect(whole.variable_count() == kPoses, "all poses can be recovered",
                 [&] { return fmt::format("{} of {}", whole.variable_count(), kPoses); });
    check.within(largest_distance(whole, minimum), kDrift,
                 "poses that are recovered are where all measurements put them");
  });
}

void check_sparsifier(const Subject& subject, Checker& check) {
  Graph minimum = two_laps(kPoses, check.options().seed);
  minimize_densely(minimum);
  std::vector<int> nodes;
  for (int v = 1; v < kPoses; v += 3) nodes.push_back(v);
  check.sample(fmt::format("{} of {} poses removed", nodes.size(), kPoses), [&] {
    const auto sparsifier = subject.registry.make<Sparsifier>(subject.name);
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
    minimize_densely(sparse);
    check.within(largest_distance(sparse, minimum), 1e-3,
                 "the sparse graph has its minimum where the whole graph has it");
  });
}

}  // namespace

std::span<const Group> pose_policy_groups() {
  static constexpr std::array<Group, 1> groups{{{"run", check_policy}}};
  return groups;
}

std::span<const Group> sparsifier_groups() {
  static constexpr std::array<Group, 1> groups{{{"removal", check_sparsifier}}};
  return groups;
}

}  // namespace cairn::conformance
