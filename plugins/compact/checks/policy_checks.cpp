// SPDX-License-Identifier: BSD-3-Clause
// What policies leave of a small pose graph, against the minimum of the whole.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/conformance/checker.hpp"
#include "cairn/conformance/repetition.hpp"
#include "cairn/conformance/sample_graph.hpp"
#include "cairn/conformance/samples.hpp"
#include "cairn/geometry/pose_chain.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/policy_run.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/policy/registration.hpp"
#include "cairn/runtime/error.hpp"

namespace {

using namespace cairn;
using namespace cairn::conformance;

constexpr int kPoses = 40;
/// How far a pose may be from where all measurements put it [m, rad]: some standard deviations of
/// the odometry of half a lap.
constexpr double kDrift = 0.5;

/// Share of chi2 that may be left after `finish`.
constexpr double kSolved = 1e-6;

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

/// After `finish`: the estimate is of the poses that are kept, with all of their factors, and
/// solved.
void check_what_is_kept(PosePolicy& policy, const Graph& compact, const std::set<Id>& kept,
                        Checker& check) {
  const std::vector<Id> ids = policy.estimator().variables();
  check.expect(std::set<Id>(ids.begin(), ids.end()) == kept,
               "the estimate has the poses that are kept, and no others",
               [&] { return fmt::format("{} poses, where {} are kept", ids.size(), kept.size()); });
  check.expect(policy.factor_count() == compact.factor_count(),
               "factor_count is that of the estimate after finish", [&] {
                 return fmt::format("{} and {}", policy.factor_count(), compact.factor_count());
               });
  Graph solved = compact.clone();
  const double found = chi2(compact), least = minimize_densely(solved);
  check.expect(found <= least * (1.0 + kSolved) + kSolved, "finish solves to convergence", [&] {
    return fmt::format("chi2 {}, where dense Gauss-Newton reaches {}", found, least);
  });
}

void check_policy(const Subject& subject, Checker& check) {
  Graph minimum = two_laps(kPoses, check.options().seed);
  minimize_densely(minimum);
  check.sample(fmt::format("{} poses on two laps, matched as recorded", kPoses), [&] {
    const PolicyData data = policy_data(two_laps(kPoses, check.options().seed));
    FunctionRegistration registration{Recorded(data.recording)};
    const auto policy = made<PosePolicy>(subject, check);
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
    check_what_is_kept(*policy, compact, distinct, check);
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

/// What is wrong is refused, and changes nothing.
void check_bad_calls(PosePolicy& policy, const PolicyData& data, Checker& check) {
  const auto held = [&] {
    State all = policy.newest_state();
    for (const Id id : policy.kept()) all.push_back(static_cast<double>(id));
    all.push_back(policy.factor_count());
    return all;
  };
  const Graph& recording = data.recording;
  const Arrival& last = data.poses.back();
  const Factor odometry = recording.factor(last.odometry.front());
  const Variable pose = recording.variable(last.pose());
  Variable next = pose;
  next.id = pose.id + 1;
  Factor onwards = odometry, elsewhere = odometry;
  onwards.variables = {pose.id, next.id};
  elsewhere.variables = {recording.id(data.poses.front().pose()), next.id};
  const std::vector<std::pair<const char*, std::function<void()>>> calls{
      {"a pose that is there already",
       [&] {
         policy.add_pose(pose, {&onwards, 1});
       }},
      {"a pose without odometry", [&] { policy.add_pose(next, {}); }},
      {"odometry from another pose",
       [&] {
         policy.add_pose(next, {&elsewhere, 1});
       }},
      {"a match with a pose that never came", [&] {
         policy.offer(1000000, {&odometry, 1});
       }}};
  for (const auto& [what, call] : calls) {
    check.describe(what);
    const State before = held();
    const bool refused = check.call("the policy", [&, &call = call] {
      try {
        call();
        return false;
      } catch (const Error&) {
        return true;
      }
    });
    if (!check.expect(refused, "what is wrong is refused with an Error",
                      [] { return std::string("it was accepted"); }))
      return;
    check.expect(held() == before, "a refused call changes nothing",
                 [] { return std::string("it does"); });
  }
}

/// One pose of the recording, with every match that is proposed answered.
void drive(PosePolicy& policy, const PolicyData& data, const Recorded& recorded, std::size_t k,
           const std::function<void()>& while_open) {
  const Arrival& arrival = data.poses[k];
  std::vector<Factor> odometry;
  for (const int f : arrival.odometry) odometry.push_back(data.recording.factor(f));
  policy.add_pose(data.recording.variable(arrival.pose()), odometry);
  while_open();
  for (std::size_t proposals = 0; proposals <= k; ++proposals) {
    const std::optional<MatchProposal> proposal = policy.next_match();
    if (!proposal) break;
    policy.offer(proposal->earlier, recorded(proposal->earlier, proposal->later));
  }
  policy.end_pose();
}

/// The end of a drive, to the last bit.
State end_of(PosePolicy& policy) {
  State all = policy.newest_state();
  all.push_back(policy.finish() ? 1.0 : 0.0);
  for (const Id id : policy.kept()) all.push_back(static_cast<double>(id));
  all.push_back(policy.factor_count());
  const State states = states_of(policy.estimator().graph());
  all.insert(all.end(), states.begin(), states.end());
  return all;
}

/// A drive with refused calls on the way ends as one without: what they would have left may show
/// with the next pose alone.
void check_refusals(const Subject& subject, Checker& check) {
  check.sample(fmt::format("{} poses on two laps, with wrong calls after some", kPoses), [&] {
    const PolicyData data = policy_data(two_laps(kPoses, check.options().seed));
    const Recorded recorded(data.recording);
    const auto undisturbed = made<PosePolicy>(subject, check),
               disturbed = made<PosePolicy>(subject, check);
    const auto refused = [&](const std::function<void()>& call) {
      try {
        call();
      } catch (const Error&) {  // as it must be; that it is is checked elsewhere
      }
    };
    Factor foreign = data.recording.factor(0);
    foreign.variables = {data.recording.id(data.poses.front().pose()), 1000000};
    for (PosePolicy* policy : {undisturbed.get(), disturbed.get()})
      check.call("expect", [&] { policy->expect(data.recording, data.poses); });
    for (std::size_t k = 0; k < data.poses.size(); ++k) {
      check.call("the policy", [&] {
        drive(*undisturbed, data, recorded, k, [] {});
        const bool wrong = k > 0 && k % 5 == 0;
        if (wrong) {
          Variable pose = data.recording.variable(data.poses[k].pose());
          refused([&] { disturbed->add_pose(pose, {}); });
          pose.id = 1000000;
          refused([&] { disturbed->add_pose(pose, {&foreign, 1}); });
        }
        drive(*disturbed, data, recorded, k, [&] {
          if (wrong) refused([&] { disturbed->offer(2000000, {&foreign, 1}); });
        });
      });
    }
    const State right = check.call("finish", [&] { return end_of(*undisturbed); }),
                found = check.call("finish", [&] { return end_of(*disturbed); });
    check.expect(found == right, "a refused call changes nothing of what follows", [&] {
      return fmt::format("it ends with {} and not with {}", text_of(found), text_of(right));
    });
  });
}

/// Pose by pose, each decision against what the policy had said before.
void check_decisions(const Subject& subject, Checker& check) {
  const Graph whole = two_laps(kPoses, check.options().seed);
  check.sample(fmt::format("{} poses on two laps, one by one", kPoses), [&] {
    const PolicyData data = policy_data(whole.clone());
    const Recorded recorded(data.recording);
    const auto policy = made<PosePolicy>(subject, check);
    check.call("expect", [&] { policy->expect(data.recording, data.poses); });
    std::set<Id> kept;
    for (const Arrival& arrival : data.poses) {
      const Variable pose = data.recording.variable(arrival.pose());
      std::vector<Factor> odometry;
      for (const int f : arrival.odometry) odometry.push_back(data.recording.factor(f));
      check.describe(fmt::format("pose {}", pose.id));
      check.call("add_pose", [&] { policy->add_pose(pose, odometry); });
      std::size_t offered = 0;
      // Each pair once: there are no more than poses that are kept.
      for (; offered <= kept.size(); ++offered) {
        const std::optional<MatchProposal> proposal =
            check.call("next_match", [&] { return policy->next_match(); });
        if (!proposal) break;
        check.describe(fmt::format("poses {} and {} proposed", proposal->earlier, proposal->later));
        if (!check.expect(kept.contains(proposal->earlier) && proposal->later == pose.id,
                          "a proposal is of a kept pose and the newest",
                          [] { return std::string("it is not"); }))
          return;
        const LinkReport link = check.call("offer", [&] {
          return policy->offer(proposal->earlier, recorded(proposal->earlier, proposal->later));
        });
        check.expect(std::min(link.earlier, link.later) == proposal->earlier &&
                         std::max(link.earlier, link.later) == proposal->later,
                     "the report of an offer is of its poses",
                     [&] { return fmt::format("of {} and {}", link.earlier, link.later); });
      }
      check.describe(fmt::format("pose {}", pose.id));
      if (!check.expect(offered <= kept.size(), "next_match comes to an end",
                        [&] { return fmt::format("{} proposals for one pose", offered); }))
        return;
      const PoseReport report = check.call("end_pose", [&] { return policy->end_pose(); });
      check.expect(report.id == pose.id, "the report is of the pose that has ended",
                   [&] { return fmt::format("it is of {}", report.id); });
      const State newest = check.call("newest_state", [&] { return policy->newest_state(); });
      check.expect(newest.size() == 3 &&
                       std::ranges::all_of(newest, [](double x) { return std::isfinite(x); }),
                   "newest_state is a state", [&] { return text_of(newest); });
      const std::vector<Id> now = check.call("kept", [&] { return policy->kept(); }),
                            gone = check.call("removed", [&] { return policy->removed(); });
      for (const Id id : gone) {
        check.expect(kept.contains(id) || id == pose.id, "removed names poses that were kept",
                     [&] { return fmt::format("{} was not", id); });
        kept.erase(id);
      }
      if (report.kept) kept.insert(pose.id);
      check.expect(
          std::set<Id>(now.begin(), now.end()) == kept, "kept is what the reports say that is kept",
          [&] { return fmt::format("{} poses, by the reports {}", now.size(), kept.size()); });
      kept = {now.begin(), now.end()};
    }
    check_bad_calls(*policy, data, check);
    check.describe("after the last pose");
    check.call("finish", [&] { return policy->finish(); });
    const std::vector<Id> now = check.call("kept", [&] { return policy->kept(); });
    check.expect(std::ranges::count(now, data.recording.id(data.poses.back().pose())) == 1,
                 "finish keeps the newest pose", [] { return std::string("it is not kept"); });
  });
}

/// A whole run, each with a new policy: none can be begun again.
Repetition policy_uses(const Subject& subject, Checker& check) {
  return {"a run", 3, [&subject, seed = check.options().seed](std::uint64_t input) {
            const auto data =
                std::make_shared<const PolicyData>(policy_data(two_laps(kPoses, seed + input)));
            return [&subject, data] {
              const auto policy = subject.registry.make<PosePolicy>(subject.name);
              FunctionRegistration registration{Recorded(data->recording)};
              policy->expect(data->recording, data->poses);
              run_policy(data->recording, data->poses, *policy, registration);
              State result = states_of(policy->estimator().graph());
              for (const Id id : policy->kept()) result.push_back(static_cast<double>(id));
              return result;
            };
          }};
}

class PolicyChecks final : public KindChecks {
 public:
  std::span<const Group> groups() const override {
    static constexpr std::array<Group, 5> all{{{"run", check_policy},
                                               {"decisions", check_decisions},
                                               {"refusals", check_refusals},
                                               {"memory", memory_group<policy_uses>, true},
                                               {"threads", threads_group<policy_uses>, true}}};
    return all;
  }
};

}  // namespace

void cairn_register(Registrar& registrar) {
  registrar.add<KindChecks>("pose_policy", {}, [](const Options&, Registry&) {
    return std::make_unique<PolicyChecks>();
  });
}
