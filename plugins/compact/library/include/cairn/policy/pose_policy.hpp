// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/geometry/motion.hpp"
#include "cairn/geometry/pose_chain.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/policy/registration.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/update/recorded_graph.hpp"

namespace cairn {

/// The outcome of a measured link.
enum class LinkVerdict {
  linked,         ///< it is in the graph
  unmatched,      ///< there was nothing to link
  uninformative,  ///< its information gain is below the threshold
  inconsistent,   ///< it contradicts the estimate, or other links
  waiting,        ///< consistent, but not confirmed: until another link agrees
  nonlinear,      ///< of a landmark: not linear over what is not known of where the two are
};
/// "linked", "unmatched", ….
CAIRN_API std::string_view to_string(LinkVerdict verdict);

struct LinkReport {
  Id earlier = 0, later = 0;
  double expected_gain = 0.0;  ///< before it was measured [nats]
  double gain = 0.0;           ///< with the covariance of the measurement [nats]
  double innovation = 0.0;     ///< squared Mahalanobis distance from what was expected
  LinkVerdict verdict = LinkVerdict::unmatched;

  CAIRN_API static ResultFields<LinkReport> fields();
};

/// The outcome of an absolute measurement of a pose.
struct PriorReport {
  Id pose = 0;
  double gain = 0.0;        ///< ½ ln |I + Σ_r⁻¹ J Σ Jᵀ| of the pose's covariance Σ [nats]
  double innovation = 0.0;  ///< squared Mahalanobis distance from what was expected
  /// `linked`: it is in the graph. `waiting`: until enough of them are there (see `offer_prior`).
  LinkVerdict verdict = LinkVerdict::uninformative;

  CAIRN_API static ResultFields<PriorReport> fields();
};

/// The outcome of what a pose has measured of a landmark.
struct LandmarkReport {
  Id pose = 0, landmark = 0;
  int factors = 0;     ///< of the observation
  bool added = false;  ///< the landmark is in the graph with it, and was not before
  /// It was in the graph, and has left with the landmark, which what was measured of it does not
  /// determine any more; both wait again.
  bool removed = false;
  /// ½ ln |I + J Σ Jᵀ| with the joint covariance Σ of pose and landmark, given what was used before
  /// it [nats]; of a landmark that is not in the graph infinite. Where several poses determine a
  /// landmark together: the entropy that these poses lose by what all of them measured of it.
  double gain = 0.0;
  double innovation = 0.0;  ///< squared Mahalanobis distance from what was expected; likewise
  /// `linked`: it is in the graph. `waiting`: what was measured so far does not determine where the
  /// landmark is. `unmatched`: the landmark is not in the graph, since the pose was not kept, or
  /// has left while it waited. `nonlinear`: left out, since the estimate takes a measurement as
  /// linear over what is not known of where the landmark is from the pose, and this one is not,
  /// such as a bearing of a landmark that is nearer than it is known.
  LinkVerdict verdict = LinkVerdict::unmatched;

  CAIRN_API static ResultFields<LandmarkReport> fields();
};

/// What is measured of a landmark from one pose: factors on the two.
struct LandmarkObservation {
  Variable landmark;  ///< without a state: where the first factor that is used puts it
  std::vector<Factor> factors;
};

/// Seconds that a pose took, without the matching itself.
struct PolicySeconds {
  double total = 0.0;
  double estimate = 0.0;     ///< updates of the estimator
  double covariances = 0.0;  ///< cross covariances
  double search = 0.0;       ///< candidates and their gains

  CAIRN_API PolicySeconds& operator+=(const PolicySeconds& other);

  CAIRN_API static ResultFields<PolicySeconds> fields();
};

/// The outcome of a pose, and of the links that were measured for it.
struct PoseReport {
  Id id = 0;
  bool kept = true;
  bool closed_loop = false;
  int near = 0;                                                 ///< poses that the index found
  int candidates = 0;                                           ///< those near enough to be matched
  double least_gain = std::numeric_limits<double>::infinity();  ///< among the candidates [nats]
  double most_gain = 0.0;           ///< expected of those that were not proposed, at most [nats]
  std::vector<LinkReport> links;    ///< also earlier ones that had been waiting
  std::vector<PriorReport> priors;  ///< likewise
  std::vector<LandmarkReport> landmarks;  ///< likewise, of earlier poses as well
  int removed = 0;  ///< poses that left the graph with it: see `PosePolicy::removed`
  PolicySeconds seconds;
  std::vector<std::string> notes;

  CAIRN_API static ResultFields<PoseReport> fields();
};

/// Decides online which poses of a trajectory are kept and which loop closures are used.
///
/// For each pose: `add_pose`; then, as long as `next_match` proposes a pair, the caller matches it
/// and passes the result to `offer`; then `end_pose`. `run_policy` does so for a recording. Poses
/// that are not kept have no variable in the estimator; their odometry is composed.
class CAIRN_API PosePolicy : public Component {
 public:
  static constexpr std::string_view kKind = "pose_policy";
  ~PosePolicy() override;

  /// Called before the first pose if what follows is a recording, for policies that need it as a
  /// whole; does nothing unless a policy overrides it.
  virtual void expect(const Graph& recording, std::span<const Arrival> poses);
  /// Called before the first pose with false if `chains` will not be read: a policy that keeps them
  /// needs memory for every pose that ever was. Does nothing unless a policy overrides it.
  virtual void keep_chains(bool keep);
  /// Called before the first pose: a map that an earlier session, or another robot, has left, which
  /// this trajectory continues. Its poses are kept ones. Where the trajectory is on it is unknown
  /// until a match with one of its poses is offered. Throws `Error` (input) for a map that it
  /// cannot continue; (usage) unless a policy overrides it.
  virtual void load(const Graph& map);
  /// The poses of the map while it is unknown where the trajectory is on it: a match of the newest
  /// pose with any of them is wanted. Empty if that is known, or there is no map.
  virtual std::vector<Id> unlocated() const { return {}; }
  /// The next pose, with its odometry from the previous pose (several factors are fused; none for
  /// the first pose). A pose marked as fixed is kept. Throws `Error` (input) if there is no
  /// odometry, or a factor that is not a relative pose of the two; nothing has changed then.
  virtual void add_pose(const Variable& pose, std::span<const Factor> odometry) = 0;
  /// The pair that is most worth matching with the newest pose; none: no pair is.
  virtual std::optional<MatchProposal> next_match() = 0;
  /// What was measured between the newest pose and a pose that is kept, proposed or not; nothing:
  /// they do not match. Throws `Error` (input) if the other pose is not there (any more).
  virtual LinkReport offer(Id other, std::span<const Factor> measured) = 0;
  /// An absolute measurement of the newest pose, such as a position from GPS: a factor on it alone.
  /// It is judged as a link is: in the graph if its information gain exceeds a threshold; its pose
  /// is kept then. Offer it after the links of the pose, which leave less for it to add. Where
  /// nothing absolute is in the graph yet, neither a fixed pose nor a measurement, it waits until
  /// the measurements that do determine together where the graph is; then all are used. Throws
  /// `Error` (input) for a factor that is not on the newest pose alone, or while it is unknown
  /// where the trajectory is on a map; (usage) unless a policy overrides it.
  virtual PriorReport offer_prior(const Factor& measured);
  /// Whether it takes landmarks; false unless a policy overrides this and `offer_landmark`.
  virtual bool takes_landmarks() const { return false; }
  /// What the newest pose measures of a landmark, a point of any type that is placed in the plane
  /// or in space as the poses are. It is judged when the pose ends, with all others of the pose and
  /// after its links: those of landmarks that are in the graph are used, the most informative
  /// first, as long as the information gain of one exceeds a threshold, and the pose is kept then.
  /// If the pose is kept, for whatever reason, landmarks that it sees for the first time are added;
  /// where a single observation does not determine one, as a bearing does not, it is left out, or
  /// waits for those of other poses if an option of the policy says so. Throws `Error` (input) for
  /// a factor that is not on the newest pose and this landmark, for a landmark that is fixed, or of
  /// another type than before, or while it is unknown where the trajectory is on a map; (usage)
  /// unless a policy overrides it.
  virtual void offer_landmark(const LandmarkObservation& observation);
  /// Takes a link back that was false: the graph is as if there had never been one between these
  /// two poses, and so is what was learnt from it; which poses are kept stays as it was decided. At
  /// any time; one that waits waits no more. False if there is no such link. Throws `Error`
  /// (input), and changes nothing, if it cannot be separated from other measurements any more;
  /// (usage) unless a policy overrides it.
  virtual bool revoke(Id a, Id b);
  /// Ends the pose: decides whether to keep it.
  virtual PoseReport end_pose() = 0;
  /// Ends the trajectory: the newest pose is kept in any case, and everything is solved to
  /// convergence. False if it has not converged.
  virtual bool finish() = 0;

  /// The compact graph's estimate, good until the next call. Only to be read, which changes no
  /// later result, but for `set_loss` before the first pose.
  virtual Estimator& estimator() = 0;
  /// The poses that are kept, in the order of arrival.
  virtual std::vector<Id> kept() const = 0;
  /// Poses that were kept, and have left with the latest `end_pose` or `finish`: factors between
  /// others have taken their place, or what they measured adds little to what others did. None,
  /// unless a policy bounds the number of poses that it keeps.
  virtual std::vector<Id> removed() const { return {}; }
  /// The landmarks that are in the graph, in the order in which they were added.
  virtual std::vector<Id> landmarks() const { return {}; }
  /// Those that were measured and are not in the graph, since no observation, nor several where the
  /// policy takes them together, determines where they are; by rising id.
  virtual std::vector<Id> undetermined() const { return {}; }
  /// How many factors there are between all of these; the estimator need not have all of them yet.
  virtual int factor_count() const = 0;
  /// The information gain that a link must exceed to be used [nats], good from the first pose on;
  /// none: the policy does not decide by it, as all do that don't override it.
  virtual std::optional<double> link_gain() const { return std::nullopt; }
  /// The newest pose as it is estimated, kept or not.
  virtual std::vector<double> newest_state() const = 0;
  /// From each kept pose to the next one of the trajectory, in order. A chain may end at a pose
  /// that was kept before. Empty after `keep_chains(false)`, if the policy forgets them.
  virtual const std::vector<OdometryChain>& chains() const = 0;
};

/// Ability of a policy that finds options for itself from what it has seen.
class CAIRN_API OptionFinder {
 public:
  static constexpr std::string_view kAbility = "option_finder";
  virtual ~OptionFinder();
  /// The options with which to process a sample of the data: all measurements are used.
  /// `recorded_only`: as `Registration::matches_recorded_only` has it.
  virtual OptionValues watching(bool recorded_only) const = 0;
  /// What it would choose after that. Throws `Error` (input) if the sample does not determine it.
  virtual OptionValues found() const = 0;
  /// A choice that accepts more than `found` (factors < 1) or less (> 1): of links, and of poses.
  virtual OptionValues scaled(const OptionValues& found, double links, double poses) const = 0;
  /// How accurate a link of the sample is: root mean square of its translation's error [m]. Errors
  /// below that are negligible.
  virtual double accuracy() const = 0;
};

/// One pose, from `add_pose` to `end_pose`: what the policy proposes is matched by `registration`,
/// which is also asked to recognise a place while it is unknown where the trajectory is on a map.
/// `priors` are absolute measurements of the pose, `observations` what it measures of landmarks;
/// they are not used while that is unknown.
CAIRN_API PoseReport process_pose(const Variable& pose, std::span<const Factor> odometry,
                                  PosePolicy& policy, Registration& registration,
                                  std::span<const Factor> priors = {},
                                  std::span<const LandmarkObservation> observations = {});

/// What a pose of a recorded trajectory (`pose_chain`) measures of landmarks, one after the other;
/// without their recorded states, but for those that are fixed.
CAIRN_API std::vector<LandmarkObservation> observations_of(const Graph& recording,
                                                           const Arrival& arrival);

/// Feeds the first poses of a recording to a policy, matching by `registration`. `each` is called
/// for every pose, and stops the run by returning false. The policy is finished at the end; false
/// if it has not converged. With a map whose place is unknown, `registration.recognise` is asked
/// for each pose until it is.
CAIRN_API bool run_policy(const Graph& recording, std::span<const Arrival> poses,
                          PosePolicy& policy, Registration& registration,
                          const std::function<bool(const PoseReport&)>& each = {});

/// All poses of a trajectory, the left-out ones recovered between those that are kept; without
/// factors.
CAIRN_API Graph recovered_trajectory(PosePolicy& policy, Recovery how);

/// The state of one pose that was left out; nothing: it is in no chain, since it is kept, never
/// came, or the next pose that is kept has not come yet. Where the robot passed several times, of
/// the last.
CAIRN_API std::optional<std::vector<double>> recovered_state(PosePolicy& policy,
                                                             const VariableType& type, Id pose,
                                                             Recovery how);

}  // namespace cairn
