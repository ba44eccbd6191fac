// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/policy_run.hpp"

#include <algorithm>
#include <chrono>
#include <span>
#include <utility>

#include <fmt/core.h>

#include "cairn/evaluation/nonzeros.hpp"
#include "cairn/evaluation/step_times.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/runtime/result_fields.hpp"
#include "cairn/runtime/timed.hpp"
#include "odometry_gaps.hpp"

namespace cairn {
namespace {

using Clock = std::chrono::steady_clock;

/// Its analysis says how many nonzeros a factor of the information matrix has.
constexpr const char* kCountingSolver = "block_cholesky";

/// Counts and times what goes through it.
class WatchedRegistration final : public Registration {
 public:
  WatchedRegistration(Registration& inner, std::string name, PolicyResult& result)
      : inner_(inner),
        name_(std::move(name)),
        result_(result),
        false_(query<FalseMatches>(inner)) {}
  void begin(const RegistrationData& data) override { inner_.begin(data); }
  std::vector<Factor> match(Id earlier, Id later) override {
    return watched(earlier, later, [&] { return inner_.match(earlier, later); });
  }
  std::vector<Factor> match_proposed(const MatchProposal& proposal) override {
    return watched(proposal.earlier, proposal.later,
                   [&] { return inner_.match_proposed(proposal); });
  }
  std::optional<RecognisedPlace> recognise(std::span<const Id> places, Id pose) override {
    const auto begin = Clock::now();
    std::optional<RecognisedPlace> found =
        call_plugin([&] { return fmt::format("registration '{}'", name_); },
                    [&] { return inner_.recognise(places, pose); });
    result_.registration_seconds += seconds_since(begin);
    ++result_.proposed;
    result_.registered += found.has_value();
    if (found && was_false(found->place, pose)) ++result_.false_registered;
    return found;
  }
  void pose_ended(Id pose, bool kept) override { inner_.pose_ended(pose, kept); }
  bool was_false(Id earlier, Id later) const { return false_ && false_->was_false(earlier, later); }

 private:
  template <class Match>
  std::vector<Factor> watched(Id earlier, Id later, Match&& match) {
    const auto begin = Clock::now();
    std::vector<Factor> factors =
        call_plugin([&] { return fmt::format("registration '{}'", name_); }, match);
    result_.registration_seconds += seconds_since(begin);
    ++result_.proposed;
    result_.registered += !factors.empty();
    if (!factors.empty() && was_false(earlier, later)) ++result_.false_registered;
    return factors;
  }

  Registration& inner_;
  std::string name_;
  PolicyResult& result_;
  FalseMatches* false_;
};

bool has_all_of(const Graph& truth, const Graph& recording) {
  for (int v = 0; v < recording.variable_count(); ++v) {
    const auto there = truth.find(recording.id(v));
    if (!there || truth.type(*there).tag() != recording.type(v).tag()) return false;
  }
  return true;
}

void evaluate_map(const PolicyData& data, PolicyResult& result) {
  // A map without a common frame is nowhere in that of the truth.
  if (result.located && data.truth_graph && has_all_of(*data.truth_graph, result.compact))
    result.normalized = normalized_error(result.compact, *data.truth_graph);
}

void evaluate(PosePolicy& policy, const PolicyData& data, PolicyResult& result) {
  if (!data.truth) return;
  try {
    for (const auto& [how, name] : enum_names(Recovery{})) {
      result.errors[std::string(name)] =
          compare(trajectory(recovered_trajectory(policy, how)), *data.truth);
    }
  } catch (const Error& error) {  // too few poses to compare, when it was interrupted
    if (!result.interrupted || error.code() != ErrorCode::input) throw;
  }
  evaluate_map(data, result);
}

/// Before any work: what the policy would refuse when a pose sees it.
void check_landmarks(const PosePolicy& policy, const std::string& name, const Graph& recording) {
  for (int v = 0; v < recording.variable_count(); ++v) {
    if (!is_point(recording.type(v))) continue;
    if (!policy.takes_landmarks()) {
      throw Error(ErrorCode::usage,
                  fmt::format("policy '{}' takes no landmarks, and {} is one: use compact_pose, or "
                              "leave the landmarks and what is measured of them out of the graph",
                              name, recording.describe_variable(v)));
    }
    if (!recording.fixed(v)) continue;
    throw Error(ErrorCode::input,
                fmt::format("{} is fixed (FIX), and a policy estimates all landmarks: remove its "
                            "FIX; where the map is follows from a pose that is fixed, or from "
                            "absolute measurements of poses, such as EDGE_PRIOR_SE2",
                            recording.describe_variable(v)));
  }
}

}  // namespace

PolicyData policy_data(Graph recording, std::optional<Graph> truth, std::optional<Id> begin,
                       Gaps gaps) {
  PolicyData data;
  if (gaps == Gaps::bridge) data.gaps = bridge_gaps(recording, begin);
  data.poses = pose_chain(recording, begin);
  for (const Arrival& pose : data.poses) {
    data.loops += std::ssize(pose.links);
    data.priors += std::ssize(pose.priors);
    data.observations += std::ssize(pose.observations);
    data.landmarks += std::ssize(pose.variables) - 1;
  }
  if (truth) {
    data.truth = trajectory(*truth);
    if (has_all_of(*truth, recording)) data.truth_graph = std::move(truth);
  }
  data.recording = std::move(recording);
  return data;
}

namespace {

std::unique_ptr<Registration> make_registration(const std::string& text, Registry& registry) {
  std::unique_ptr<Registration> made = registry.make<Registration>(text);
  if (made->ability(kScanRegistration)) {
    throw Error(
        ErrorCode::usage,
        fmt::format("registration '{}' matches laser scans, and a graph has none: 'recorded' "
                    "takes its loop closures, 'simulated' the truth; cairn explore and "
                    "cairn map have scans",
                    parse_component(text).name));
  }
  return made;
}

}  // namespace

PolicyRun::PolicyRun(const PolicyJob& job, const PolicySetting& setting)
    : setting_(setting),
      policy_(setting.registry.make<PosePolicy>(job.policy)),
      registration_name_(job.own ? "of the caller" : job.registration),
      made_(job.own ? nullptr : make_registration(job.registration, setting.registry)),
      registration_(job.own ? job.own : made_.get()) {
  const PolicyData& data = setting.data;
  check_landmarks(*policy_, job.policy.name, data.recording);
  policy_->estimator().set_loss(setting.loss, setting.loss_on);
  registration_->begin(
      {.recording = &data.recording, .truth = data.truth_graph ? &*data.truth_graph : nullptr});
  result_.policy = spec_text(job.policy);
  result_.loops = data.loops;
  result_.priors = data.priors;
  result_.landmarks = data.landmarks;
  result_.observations = data.observations;
}

void PolicyRun::load(const Graph& map) {
  for (const Arrival& arrival : setting_.data.poses) {
    const Id pose = setting_.data.recording.id(arrival.pose());
    if (!map.find(pose)) continue;
    throw Error(
        ErrorCode::input,
        fmt::format(
            "pose {} is in the map and in the recording: where the recording has "
            "earlier sessions as well, give the pose at which to begin (begin=ID); where it is "
            "another pose, give it another id",
            pose));
  }
  call_plugin([&] { return fmt::format("policy '{}'", result_.policy); },
              [&] { policy_->load(map); });
  // Poses of earlier sessions that the map has not kept.
  const Graph& recording = setting_.data.recording;
  if (!setting_.data.poses.empty()) {
    const Id first = recording.id(setting_.data.poses.front().pose());
    for (int v = 0; v < recording.variable_count(); ++v) {
      const Id pose = recording.id(v);
      if (!is_point(recording.type(v)) && pose < first && !map.find(pose))
        registration_->pose_ended(pose, false);
    }
  }
  for (int v = 0; v < map.variable_count(); ++v) result_.map_poses += !is_point(map.type(v));
}

void PolicyRun::run(std::size_t count, std::string_view title,
                    const std::function<void(std::size_t)>& after) {
  WatchedRegistration watched(*registration_, registration_name_, result_);
  const auto count_pose = [&](const PoseReport& pose) {
    result_.poses.push_back(pose);
    result_.seconds += pose.seconds;
    for (const LinkReport& link : pose.links) {
      ++result_.verdicts[std::string(to_string(link.verdict))];
      if (link.verdict != LinkVerdict::linked) continue;
      ++result_.kept_loops;
      result_.false_kept += watched.was_false(link.earlier, link.later);
    }
    result_.kept_priors +=
        std::ranges::count(pose.priors, LinkVerdict::linked, &PriorReport::verdict);
    for (const LandmarkReport& landmark : pose.landmarks) {
      if (landmark.verdict == LinkVerdict::linked) result_.kept_observations += landmark.factors;
      if (landmark.removed) result_.kept_observations -= landmark.factors;
      result_.nonlinear_observations +=
          landmark.verdict == LinkVerdict::nonlinear ? landmark.factors : 0;
    }
    if (setting_.progress) setting_.progress(title, count, result_);
    if (after) after(result_.poses.size() - 1);
    return !setting_.interrupted();
  };
  call_plugin([&] { return fmt::format("policy '{}'", result_.policy); },
              [&] {
                result_.converged =
                    run_policy(setting_.data.recording, std::span(setting_.data.poses).first(count),
                               *policy_, watched, count_pose);
              });
  result_.interrupted = setting_.interrupted();
}

void evaluate_again(PolicyResult& result, const PolicyData& data, const std::string& name) {
  if (!data.truth) return;
  result.errors = {{name, compare(trajectory(result.trajectory), *data.truth)}};
  evaluate_map(data, result);
}

PolicyResult PolicyRun::finish(Recovery recovery) {
  result_.compact = policy_->estimator().graph();
  result_.kept_poses = static_cast<int>(std::ssize(policy_->kept()));
  const Graph& recording = setting_.data.recording;
  for (const Id id : policy_->landmarks()) {
    const auto there = recording.find(id);
    result_.kept_landmarks += there && is_point(recording.type(*there));
  }
  result_.undetermined_landmarks = std::ssize(policy_->undetermined());
  result_.chi2 = policy_->estimator().chi2();
  result_.located = policy_->unlocated().empty();
  result_.trajectory = recovered_trajectory(*policy_, recovery);
  const Nonzeros nonzeros =
      count_nonzeros(result_.compact, *setting_.registry.make<LinearSolver>(kCountingSolver));
  result_.information_nonzeros = nonzeros.information;
  result_.factor_nonzeros = nonzeros.factor;
  evaluate(*policy_, setting_.data, result_);
  return std::move(result_);
}

ResultFields<PolicyResult> PolicyResult::fields() {
  using R = PolicyResult;
  return ResultFields<R>()
      .figure("policy", &R::policy,
              "the policy with all its options, those that were found among them")
      .figure(
          "poses.in", [](const R& r) { return r.poses.size(); }, "poses of the recording")
      .attribute("counts.poses")
      .figure(
          "poses.kept", [](const R& r) { return r.kept_poses - r.map_poses; },
          "poses that were kept")
      .attribute("counts.kept")
      .figure("poses.map", &R::map_poses, "poses of the map that was continued")
      .attribute("counts.map")
      .figure("loops.in", &R::loops, "loop closures of the recording")
      .attribute("counts.loops")
      .figure("loops.proposed", &R::proposed, "pairs of poses that were to be matched")
      .attribute("counts.proposed")
      .figure("loops.registered", &R::registered, "those of them that matched")
      .attribute("counts.registered")
      .figure("loops.kept", &R::kept_loops, "loop closures in the graph")
      .attribute("counts.kept_loops")
      .figure("loops.false_registered", &R::false_registered,
              "matches of places that are not the same, as far as that is known")
      .attribute("counts.false_registered")
      .figure("loops.false_kept", &R::false_kept, "those of them that are in the graph")
      .attribute("counts.false_kept")
      .figure("priors.in", &R::priors, "absolute measurements of the recording")
      .attribute("counts.priors")
      .figure("priors.kept", &R::kept_priors, "those of them that are in the graph")
      .attribute("counts.kept_priors")
      .figure("landmarks.in", &R::landmarks, "landmarks of the recording")
      .attribute("counts.landmarks")
      .figure("landmarks.kept", &R::kept_landmarks, "those of them that are in the graph")
      .attribute("counts.kept_landmarks")
      .figure("landmarks.undetermined", &R::undetermined_landmarks,
              "of the others, those that what was measured of them does not determine")
      .attribute("counts.undetermined_landmarks")
      .figure("observations.in", &R::observations, "measurements of landmarks in the recording")
      .attribute("counts.observations")
      .figure("observations.kept", &R::kept_observations, "those of them that are in the graph")
      .attribute("counts.kept_observations")
      .figure("observations.nonlinear", &R::nonlinear_observations,
              "those left out since the estimate cannot take them as linear")
      .attribute("counts.nonlinear_observations")
      .figure("verdicts", &R::verdicts, "how many links there were of each verdict")
      .details()
      .figure("chi2.final", &R::chi2, "of what was kept")
      .label("chi2")
      .round("{:.8g}")
      .attribute("chi2")
      .part("seconds", &R::seconds)
      .figure("seconds.registration", &R::registration_seconds, "s", "matching")
      .detail()
      .part("steps",
            [](const R& r) {
              std::vector<double> times;
              for (const PoseReport& pose : r.poses) times.push_back(pose.seconds.total);
              return StepTimes(std::move(times));
            })
      .figure("nonzeros.information", &R::information_nonzeros,
              "numbers in the information matrix of what was kept")
      .detail()
      .attribute("counts.information_nonzeros")
      .figure("nonzeros.factor", &R::factor_nonzeros, "numbers in its factor")
      .detail()
      .attribute("counts.factor_nonzeros")
      .figure(
          "errors", [](const R& r) { return r.errors.empty() ? nullptr : &r.errors; },
          "with the truth: errors of all poses, by the name of each recovery, or 'whole'")
      .figure(
          "rmse",
          [](const R& r) -> std::optional<double> {
            for (const char* const name : {"v2", "whole"}) {
              if (const auto of = r.errors.find(name); of != r.errors.end())
                return of->second.ate_translation;
            }
            return std::nullopt;
          },
          "m", "with the truth: absolute error of the trajectory, after alignment")
      .detail()
      .part("nees", &R::normalized);
}

}  // namespace cairn
