// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "cairn/geometry/motion.hpp"
#include "cairn/geometry/pose_chain.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/update/pose_remover.hpp"
#include "pose_index.hpp"
#include "rigid_group.hpp"
#include "temporary_poses.hpp"
#include "ways.hpp"

namespace cairn::compact {

/// Throws `Error` (numerical) where an estimator has no covariance of a variable.
void need_covariance(bool there, Id id);

/// A compact pose graph while it grows: the poses that are kept, in an estimator, and the newest
/// pose, which may not be kept.
///
/// Poses that odometry alone has added are a chain at the end of the graph, without information
/// about the others. So they are passed to the estimator only when a link closes a loop,
/// and all of them at once (readers get a copy that has them); replacing a redundant pose by the
/// next one does not involve it either (Algorithm 1, line 12). Until then their states and
/// covariances follow from those of the pose at which the chain starts, the anchor a, which the
/// estimator has: with μ the composed relative pose from there and A = Ad(μ⁻¹),
///
///     x_n = x_a μ,  Σ_in = Σ_ia Aᵀ,  Σ_nn = A Σ_aa Aᵀ + Σ_μ,
///
/// just as the estimator would have them.
class CompactGraph {
 public:
  /// Poses that have left.
  struct Leaving {
    std::vector<Id> poses;
    std::vector<int> now;  ///< the number that each kept pose has now; −1: it has left
    std::string note;      ///< why more stay than there is room for; empty: they do not
    std::vector<std::string> notes{};  ///< of the remover, each said once
  };

  /// Measurements of a landmark that have left the graph, by their poses.
  struct LeftOut {
    Variable landmark;  ///< without a state
    bool removed =
        false;  ///< the landmark itself has left, these being all that was measured of it
    std::vector<std::pair<Id, Factor>> factors;
  };

  /// `marginals`: what the estimator keeps, which costs time with each link; the diagonal if many
  /// poses are candidates at a time, nothing if few are.
  CompactGraph(std::unique_ptr<Estimator> estimator, CompositionOrder order,
               KeptMarginals marginals = KeptMarginals::diagonal);

  /// With everything that is kept: the estimator, or while it does not have all odometry yet, a
  /// copy that has. Good until the graph changes; reading it changes no later result.
  Estimator& estimator();
  /// Whether the trajectory has not begun.
  bool empty() const { return size() == map_size_; }
  const RigidGroup& group() const { return *group_; }

  /// Before the first pose: the poses, landmarks and factors of an earlier session's map. Throws
  /// `Error` (input) if it is not one connected graph of these.
  void load(const Graph& map);
  /// Whether something absolute determines where the graph is: a fixed pose, or measurements.
  /// Otherwise its first pose holds it, and covariances are relative to that.
  bool referenced() const { return referenced_; }
  /// Keeps the newest pose; moves the whole graph, x_k ← move x_k, to where these absolute
  /// measurements of kept poses say together, and takes them in.
  void refer(const State& move, std::span<const Factor> priors, PolicySeconds& seconds);
  /// Whether it is known where the trajectory is on the map; true if there is none. Until then the
  /// two are separate components, and nothing is known of a displacement between them.
  bool located() const { return located_; }
  /// Poses below this number are those of the map.
  int map_size() const { return map_size_; }
  /// Whether something is known of the displacement between two kept poses.
  bool connected(int a, int b) const { return located_ || (a < map_size_) == (b < map_size_); }
  /// The newest pose, matched with a pose of the map, `measured` from there: moves the whole
  /// trajectory to its place on the map, x_k ← x_pose z x_n⁻¹ x_k, and adds the links.
  void locate(int pose, const State& measured, std::span<const Factor> links,
              PolicySeconds& seconds);

  /// The first pose of the trajectory.
  void start(const Variable& pose, PolicySeconds& seconds);
  /// All measurements of the relative pose of two poses, fused. Throws `Error` (input) if one of
  /// them measures something else.
  Motion fuse(std::span<const Factor> factors, Id from, Id to) const;
  /// The next pose, moved by `motion` from the one before: from then on the newest.
  void advance(const Variable& pose, const Motion& motion,
               const std::shared_ptr<const FactorType>& type);
  /// Keeps the newest pose.
  void keep(PolicySeconds& seconds);
  /// Keeps the newest pose, and takes these links in.
  void link(std::span<const Factor> links, PolicySeconds& seconds);
  /// Takes factors of kept poses in, and leaves the newest as it is.
  void add(std::span<const Factor> factors, PolicySeconds& seconds) { update(factors, seconds); }
  /// The newest pose, which is not kept, has been matched with a kept one, `measured` from there.
  /// Instead of keeping it, the chain between its predecessor and that pose becomes a link of these
  /// two, and the trajectory continues from that pose. The measurement is used in both, so its
  /// information is divided: the part `of_way` (0 < `of_way` < 1) goes to the chain, the rest
  /// to what follows. Two parts that are treated as independent have no more information than the
  /// one measurement.
  ///
  /// Once poses have left (`make_room`), or if the predecessor is temporary, that link is used as
  /// all others are: if its information gain exceeds `least_gain` [nats]. If not, the whole
  /// measurement goes to what follows.
  void relocate(int pose, const Motion& measured, double of_way, double least_gain,
                PolicySeconds& seconds);
  /// Takes the link, or links, between two poses out, of which one is kept: what is left is as if
  /// there had never been one, except that the same poses are kept and that the information of
  /// other matches is divided as it was. False if there is none (any more). Throws `Error` (input),
  /// and changes nothing, where it cannot be separated from other measurements any more, or is all
  /// that connects a trajectory to its map.
  bool revoke(Id a, Id b, PolicySeconds& seconds);
  /// Whether poses have left: there is no room for more than there are.
  bool full() const { return full_; }
  /// Where more than `limit` poses are kept, makes that many of them: others leave, and are
  /// replaced by factors between their neighbours. Never the newest, the first of the trajectory,
  /// those that are fixed or anchored, and `held`.
  Leaving make_room(PoseRemover& remover, int limit, std::span<const int> held,
                    PolicySeconds& seconds);
  /// Relinearises and solves everything until it has converged; false if it does not.
  bool solve_fully();

  // The newest pose
  // --------------------------------------------------------------------------------
  Id newest_id() const { return newest_.pose.id; }
  const State& newest_state() const { return newest_.placed.x; }
  bool newest_kept() const { return newest_.kept; }
  /// Last kept pose before the newest.
  int predecessor() const { return newest_.predecessor; }
  /// Covariance of the motion from there.
  Matrix newest_odometry() const {
    return to_matrix(newest_.odometry.covariance, group_->tangent_size());
  }
  /// Covariance of the newest pose itself, Σ_nn.
  Matrix newest_covariance(PolicySeconds& seconds);

  // Kept poses, numbered in the order of arrival; anew when poses leave --------------------------
  int size() const { return static_cast<int>(kept_.size()); }
  Id id(int pose) const { return kept_[pose].id; }
  const State& state(int pose) const { return kept_[pose].placed.x; }
  std::vector<Id> kept() const;
  int factor_count() const;
  /// The number of a kept pose; -1: it is not there.
  int find(Id id) const;
  /// Kept poses within a distance [m] of the newest, itself not among them, nor the map while the
  /// trajectory's place on it is unknown.
  std::vector<int> near(double radius);

  /// Rises whenever the estimate and its covariances change.
  int version() const { return version_; }
  /// Sees to it that the covariances of these poses with the newest are known.
  void prepare(std::span<const int> poses, PolicySeconds& seconds);
  bool prepared(int pose) const;
  /// Where the newest is as seen from a kept pose.
  Pose newest_seen_from(int pose) const {
    return RigidGroup::seen_from(kept_[pose].placed, newest_.placed);
  }
  /// From a kept pose to the newest; without covariance.
  Displacement displacement(int pose) const;
  /// Its covariance; the pose must have been prepared.
  void set_covariance(int pose, Displacement& displacement) const;
  /// Between two kept poses, with its covariance; by solving, for which all of them must reach the
  /// estimator.
  Displacement between(int a, int b);
  /// Of kept poses and, after them, the newest; likewise.
  Eigen::MatrixXd joint_covariance(std::span<const int> poses, PolicySeconds& seconds);
  /// Covariance of a kept pose itself; likewise.
  Matrix covariance(int pose);

  // Landmarks ------------------------------------------------------------------------------------
  /// In the order in which they were added.
  const std::vector<Id>& landmarks() const { return landmarks_; }
  /// The type of one; null: it is not in the graph.
  const VariableType* landmark(Id id) const;
  std::span<const double> landmark_state(Id id) const { return estimator_->state(id); }
  /// Joint covariance of landmarks of the graph and, after them, the newest pose; without passing
  /// anything to the estimator.
  Eigen::MatrixXd landmark_covariance(std::span<const Id> landmarks, PolicySeconds& seconds);
  /// Joint covariance of a landmark and, after it, a kept pose; by solving, for which both must
  /// reach the estimator.
  Eigen::MatrixXd landmark_covariance(Id landmark, int pose, PolicySeconds& seconds);
  /// Keeps the newest pose; adds landmarks, and factors on it and landmarks.
  void see(std::vector<Variable> added, std::span<const Factor> factors, PolicySeconds& seconds);

  /// Removes landmarks, and all that was measured of them.
  void release(std::span<const Id> landmarks, PolicySeconds& seconds);
  /// What has left the graph since this was called last: by `release`, or, since with it there was
  /// no covariance of what an update measured, by that update.
  std::vector<LeftOut> take_left_out();

  // Temporary poses ------------------------------------------------------------------------------
  /// Whether a kept pose is one.
  bool temporary(int pose) const;
  /// The newest, which is kept and may leave.
  void make_temporary();
  void make_permanent(int pose);
  /// Removes one of them, if a pose that stays is at its place (`cover`; nothing: there is none)
  /// and no more than this is lost about the map: the oldest with all that it measured, or if too
  /// much is lost by that, with what it measured of landmarks alone, while its odometry becomes a
  /// part of that to the next pose. Where no pose covers it, or more is lost, it is permanent from
  /// now on. Nothing: none has left. It waits while it is the newest pose that would lose too much,
  /// or while something else waits for it (`needed`); if too many wait, the first whose odometry
  /// can be joined is judged all the same.
  std::optional<Leaving> drop_temporary(const InformationLoss& most,
                                        const std::function<std::optional<Id>(int)>& cover,
                                        const std::function<bool(Id)>& needed,
                                        PolicySeconds& seconds);

  /// From each kept pose to the next one of the trajectory.
  const std::vector<OdometryChain>& chains() const { return chains_; }
  void keep_chains(bool keep) { keeps_chains_ = keep; }

 private:
  /// A motion from the anchor, with its covariance.
  struct Ahead {
    State mean{};
    Matrix covariance{};
  };
  struct Kept {
    Id id = 0;
    PlacedState placed{};
    int version = -1;       ///< of the covariances below
    Matrix own{}, cross{};  ///< Σ_ii; Σ_ia
    Ahead ahead{};          ///< while the estimator does not have it
    Variable variable{};    ///< likewise
    Factor odometry{};      ///< likewise
  };
  struct Newest {
    Variable pose;
    PlacedState placed{};
    bool kept = false;
    int predecessor = -1;
    std::shared_ptr<const FactorType> type;
    Motion odometry;  ///< from the predecessor
    Ahead ahead;
    std::vector<ChainStep> steps;
  };

  /// Whether a pose is connected to the anchor by odometry alone, or is the anchor.
  bool ahead(int pose) const { return pose == anchor_ || pose >= solved_; }
  Ahead compose(const Ahead& ahead, const Motion& motion) const;
  /// Passes to the estimator what it does not have yet, and links. Returns the number of the first
  /// of these.
  FactorId update(std::span<const Factor> links, PolicySeconds& seconds,
                  std::vector<ChangedFactor> changed = {}, std::vector<Variable> added = {});
  void refresh();
  void move_poses(int first, const State& move, std::span<const Factor> factors);
  void move_landmarks(const State& move, GraphUpdate& leaving, GraphUpdate& coming) const;
  void note_landmark(Id id, std::shared_ptr<const VariableType> type);
  Matrix block(int i, int k);
  void hang_newest();
  void know_anchor();
  void know_newest();
  void add_bridge(std::pair<int, int> ends, Motion bridge, PolicySeconds& seconds);
  ChangedFactor replaced(FactorId factor, Id from, const Motion& motion) const;
  void note_links(std::span<const Factor> links, FactorId first);
  void close_way(Id to, Way::Became became);
  void merge_ways(const GraphUpdate& leaving, std::span<const Factor> removed);
  double gain(std::pair<int, int> ends, const Motion& measured);
  void renumber(const GraphUpdate& leaving, FactorId first_factor, std::span<const int> now);
  void join_chains(const GraphUpdate& leaving);

  struct Temporary {
    Id id = 0;
    FactorId since = 0;  ///< no older factor is on it
  };
  /// The estimator does not have the pose yet.
  static constexpr FactorId kComing = std::numeric_limits<FactorId>::max();
  struct IncidentFactor {
    FactorId id = 0;
    Factor factor;
    std::vector<Eigen::MatrixXd> J{};  ///< whitened, by each variable
  };
  std::vector<IncidentFactor> factors_of_temporary();
  struct LandmarkFactor {
    FactorId id = 0;
    Id pose = 0;
    Factor factor;
  };
  bool has_covariance(Id id, Eigen::Index size);
  bool determined(std::span<const Id> measured, const std::unordered_set<Id>& gone = {});
  bool solved_anew(std::span<const Id> measured);
  std::map<Id, std::vector<LandmarkFactor>> landmark_factors() const;
  std::vector<std::size_t> not_linear(Id of, std::span<const LandmarkFactor> factors) const;
  void leave_out(Id of, std::span<const LandmarkFactor> factors, bool with_landmark);
  void leave_out(std::span<const Id> landmarks);
  void restore_covariances(std::span<const Id> measured);
  InformationLoss loss_without(std::size_t k, bool all, std::span<const IncidentFactor> incident);
  void recast_chains(Id leaving, Id cover);
  bool joins(std::size_t k, std::span<const IncidentFactor> incident) const;
  Leaving remove_temporary(std::size_t k, bool joined, Id cover,
                           std::span<const IncidentFactor> incident);

  /// Kept poses from this number on, which odometry alone has added, with that.
  GraphUpdate odometry_from(int first) const;

  std::unique_ptr<Estimator> estimator_;
  std::unique_ptr<Estimator> copy_;  ///< for readers, with the first `copied_` poses; or null
  int copied_ = 0;
  CompositionOrder order_;
  std::unique_ptr<RigidGroup> group_;
  std::unique_ptr<PoseIndex> index_;
  std::vector<Kept> kept_;
  int map_size_ = 0;
  bool located_ = true, referenced_ = false;
  int solved_ = 0;   ///< so many of them has the estimator
  int anchor_ = -1;  ///< one of those: where the chain of the newest pose and those since the last
                     ///< update starts
  std::unordered_map<Id, int> number_;
  std::vector<Id> landmarks_;
  std::unordered_map<Id, std::shared_ptr<const VariableType>> landmark_types_;
  std::vector<LeftOut> left_out_;
  bool keeps_covariances_ = false;  ///< the estimator, of each variable
  Newest newest_;
  void end_chain(Id from, Id to);

  std::vector<OdometryChain> chains_;
  bool keeps_chains_ = true;
  /// Links that replace chains between kept poses, by the two (the smaller number first).
  struct Bridge {
    FactorId factor = 0;
    Motion motion;
    std::optional<Motion> rest{};  ///< of it, what is in none of `ways_`
  };
  std::map<std::pair<int, int>, Bridge> bridges_;
  std::map<std::pair<int, int>, Bridge> replace_ways(Ways::Change& change, GraphUpdate& update);
  FactorId odometry_factor(Id from, Id to) const;
  void check_connected(Id a, Id b, const GraphUpdate& leaving) const;
  void replace_chains(const Ways::Change& change);
  /// The factors of links whose two poses are kept, by the smaller id and the larger.
  std::map<std::pair<Id, Id>, std::vector<FactorId>> links_;
  std::vector<Temporary> temporary_;  ///< in the order of arrival
  FactorId latest_factors_ = 0;       ///< the first of those that came last
  Ways ways_;                         ///< with the links of poses that are not kept
  bool full_ = false;
  int version_ = 0;

  int anchored_version_ = -1;
  Matrix S_aa_;         ///< of that version
  bool known_ = false;  ///< A_ and S_nn_ are those of the newest pose
  Matrix A_, S_nn_;
};

}  // namespace cairn::compact
