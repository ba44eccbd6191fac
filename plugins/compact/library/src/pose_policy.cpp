// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/pose_policy.hpp"

#include <algorithm>
#include <array>
#include <unordered_set>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/result_fields.hpp"

namespace cairn {

PosePolicy::~PosePolicy() = default;
OptionFinder::~OptionFinder() = default;
void PosePolicy::expect(const Graph&, std::span<const Arrival>) {}
void PosePolicy::keep_chains(bool) {}
void PosePolicy::load(const Graph&) {
  throw Error(ErrorCode::usage, "this policy does not continue a map: use compact_pose");
}

PriorReport PosePolicy::offer_prior(const Factor&) {
  throw Error(ErrorCode::usage, "this policy takes no absolute measurements: use compact_pose");
}

void PosePolicy::offer_landmark(const LandmarkObservation&) {
  throw Error(ErrorCode::usage, "this policy takes no landmarks: use compact_pose");
}

bool PosePolicy::revoke(Id, Id) {
  throw Error(ErrorCode::usage, "this policy does not revoke links: use compact_pose");
}

std::string_view to_string(LinkVerdict verdict) {
  constexpr std::array<std::string_view, 6> kNames{"linked",       "unmatched", "uninformative",
                                                   "inconsistent", "waiting",   "nonlinear"};
  return kNames[static_cast<std::size_t>(verdict)];
}

PolicySeconds& PolicySeconds::operator+=(const PolicySeconds& other) {
  total += other.total;
  estimate += other.estimate;
  covariances += other.covariances;
  search += other.search;
  return *this;
}

namespace {

void match_newest(PosePolicy& policy, Registration& registration, Id newest) {
  std::unordered_set<Id> matched;
  const auto match_proposed = [&] {
    while (const auto match = policy.next_match()) {
      if (!matched.insert(match->earlier).second) {
        throw Error(ErrorCode::plugin,
                    fmt::format("the pose policy proposes poses {} and {} again, though offer() "
                                "was called for them: it would never end",
                                match->earlier, match->later));
      }
      policy.offer(match->earlier, registration.match_proposed(*match));
    }
  };
  match_proposed();
  const std::vector<Id> map = policy.unlocated();
  if (map.empty()) return;
  const std::optional<RecognisedPlace> found = registration.recognise(map, newest);
  if (!found) return;
  policy.offer(found->place, found->factors);
  match_proposed();
}

}  // namespace

PoseReport process_pose(const Variable& pose, std::span<const Factor> odometry, PosePolicy& policy,
                        Registration& registration, std::span<const Factor> priors,
                        std::span<const LandmarkObservation> observations) {
  policy.add_pose(pose, odometry);
  match_newest(policy, registration, pose.id);
  if (!(priors.empty() && observations.empty()) && policy.unlocated().empty()) {
    for (const Factor& prior : priors) policy.offer_prior(prior);
    for (const LandmarkObservation& observation : observations) policy.offer_landmark(observation);
  }
  PoseReport report = policy.end_pose();
  registration.pose_ended(report.id, report.kept);
  for (const Id left : policy.removed()) registration.pose_ended(left, false);
  return report;
}

std::vector<LandmarkObservation> observations_of(const Graph& recording, const Arrival& arrival) {
  std::vector<LandmarkObservation> observations;
  for (const int f : arrival.observations) {
    const auto on = recording.factor_variables(f);
    const int landmark = on[0] == arrival.pose() ? on[1] : on[0];
    const Id id = recording.id(landmark);
    auto there = std::ranges::find(observations, id,
                                   [](const LandmarkObservation& s) { return s.landmark.id; });
    if (there == observations.end()) {
      there = observations.insert(there, {recording.variable(landmark), {}});
      if (!there->landmark.fixed) there->landmark.state.clear();
    }
    there->factors.push_back(recording.factor(f));
  }
  return observations;
}

bool run_policy(const Graph& recording, std::span<const Arrival> poses, PosePolicy& policy,
                Registration& registration, const std::function<bool(const PoseReport&)>& each) {
  policy.expect(recording, poses);
  bool first = true;
  for (const Arrival& arrival : poses) {
    GraphUpdate update = arrival_update(recording, arrival);
    Variable& pose = update.variables.front();
    if (!first && !pose.fixed) pose.state.clear();  // where its odometry puts it
    first = false;
    const std::span<const Factor> factors = update.factors;
    const PoseReport report = process_pose(
        pose, factors.first(arrival.odometry.size()), policy, registration,
        factors.subspan(arrival.odometry.size() + arrival.links.size(), arrival.priors.size()),
        observations_of(recording, arrival));
    if (each && !each(report)) break;
  }
  return first || policy.finish();
}

Graph recovered_trajectory(PosePolicy& policy, Recovery how) {
  const Graph compact = policy.estimator().graph();
  Graph whole;
  if (compact.variable_count() == 0) return whole;
  const std::shared_ptr<const VariableType>& type = compact.variable_pools().front().type;
  const auto state = [&](Id id) { return compact.state(*compact.find(id)); };
  const std::vector<OdometryChain>& chains = policy.chains();
  const Id first = chains.empty() ? policy.kept().back() : chains.front().from;
  whole.add_variable(type, first, state(first));
  for (const OdometryChain& chain : chains) {
    const std::vector<RecoveredPose> poses =
        recover(*type, chain, state(chain.from), state(chain.to), how);
    for (std::size_t k = 0; k < poses.size(); ++k) {
      const RecoveredPose& pose = poses[k];
      // A pose that was matched is in another chain, or on the map that was continued.
      if (chain.steps[k].matched || whole.find(pose.id)) continue;
      const auto kept = compact.find(pose.id);
      whole.add_variable(type, pose.id, kept ? compact.state(*kept) : pose.state);
    }
  }
  return whole;
}

std::optional<std::vector<double>> recovered_state(PosePolicy& policy, const VariableType& type,
                                                   Id pose, Recovery how) {
  const std::vector<OdometryChain>& chains = policy.chains();
  for (auto chain = chains.rbegin(); chain != chains.rend(); ++chain) {
    const auto step = std::ranges::find(chain->steps, pose, &ChainStep::pose);
    // At its end is a pose that is kept; at its beginning may be a match, whose pose ended another.
    if (step == chain->steps.end() || pose == chain->to || step->matched) continue;
    Estimator& estimator = policy.estimator();
    const auto from = estimator.state(chain->from), to = estimator.state(chain->to);
    const std::vector<RecoveredPose> poses = recover(type, *chain, from, to, how);
    return poses[static_cast<std::size_t>(step - chain->steps.begin())].state;
  }
  return std::nullopt;
}

namespace {

/// What the three kinds of measurements have in common.
template <class Report>
ResultFields<Report> with_verdict(ResultFields<Report> fields) {
  return fields.figure("gain", &Report::gain, "nats", "information gain")
      .figure("innovation", &Report::innovation,
              "squared Mahalanobis distance from what was expected")
      .figure("verdict", &Report::verdict,
              "linked (it is in the graph), unmatched (there is nothing to link), uninformative "
              "(its information gain is below the threshold), inconsistent (it contradicts the "
              "estimate, or other links), waiting (until others confirm it) or nonlinear (of a "
              "landmark: not linear over what is not known of where the two are)");
}

}  // namespace

ResultFields<LinkReport> LinkReport::fields() {
  return with_verdict(ResultFields<LinkReport>()
                          .figure("earlier", &LinkReport::earlier, "id of the earlier pose")
                          .figure("later", &LinkReport::later, "id of the later pose")
                          .figure("expected_gain", &LinkReport::expected_gain, "nats",
                                  "information gain before it was measured"));
}

ResultFields<PriorReport> PriorReport::fields() {
  return with_verdict(ResultFields<PriorReport>().figure("pose", &PriorReport::pose, "its id"));
}

ResultFields<LandmarkReport> LandmarkReport::fields() {
  using R = LandmarkReport;
  return with_verdict(
      ResultFields<R>()
          .figure("pose", &R::pose, "id of the pose")
          .figure("landmark", &R::landmark, "id of the landmark")
          .figure("factors", &R::factors, "how many measurements they were")
          .figure("added", &R::added, "whether the landmark came with them")
          .figure("removed", &R::removed,
                  "whether they have left the graph with the landmark, which waits again"));
}

ResultFields<PolicySeconds> PolicySeconds::fields() {
  using S = PolicySeconds;
  return ResultFields<S>()
      .figure("total", &S::total, "s", "of the policy, without matching")
      .figure("estimate", &S::estimate, "s", "updates of the estimator")
      .figure("covariances", &S::covariances, "s", "cross covariances")
      .figure("search", &S::search, "s", "candidates and their gains")
      .details();
}

ResultFields<PoseReport> PoseReport::fields() {
  using R = PoseReport;
  return ResultFields<R>()
      .figure("id", &R::id, "its id")
      .column("pose")
      .figure("kept", &R::kept, "whether it is in the graph")
      .figure("closed_loop", &R::closed_loop, "whether a loop was closed with it")
      .figure("near", &R::near, "poses that the search for candidates found")
      .figure("candidates", &R::candidates, "those near enough to be matched")
      .figure("least_gain", &R::least_gain, "nats",
              "the least information gain of a link to a candidate; infinite: none")
      .figure(
          "matched",
          [](const R& report) {
            return std::ranges::count_if(report.links, [](const LinkReport& link) {
              return link.verdict != LinkVerdict::unmatched;
            });
          },
          "links for which there was a match")
      .figure(
          "linked",
          [](const R& report) {
            return std::ranges::count(report.links, LinkVerdict::linked, &LinkReport::verdict);
          },
          "links that are in the graph")
      .figure("links", &R::links,
              "a LinkReport for each link, earlier ones that had been waiting among them")
      .figure("priors", &R::priors, "a PriorReport for each, likewise")
      .figure("landmarks", &R::landmarks, "a LandmarkReport for each")
      .part("seconds", &R::seconds)
      .figure("removed", &R::removed, "poses that left the graph with it")
      .figure("notes", &R::notes, "sentences for the user");
}

}  // namespace cairn
