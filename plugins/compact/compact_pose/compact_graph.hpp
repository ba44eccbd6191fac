// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cairn/geometry/motion.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/update/pose_remover.hpp"
#include "chains.hpp"
#include "graph_landmarks.hpp"
#include "kept_poses.hpp"
#include "link_record.hpp"
#include "newest_covariances.hpp"
#include "rigid_group.hpp"
#include "temporary_poses.hpp"

namespace cairn::compact {

/// A compact pose graph while it grows: the poses that are kept, and landmarks, in an estimator,
/// and the newest pose, which may not be kept.
///
/// Poses that odometry alone has added are a chain at the end of the graph, without information
/// about the others. So they are passed to the estimator only when a link closes a loop, and all of
/// them at once (readers get a copy that has them); replacing a redundant pose by the next one does
/// not involve it either (Algorithm 1, line 12). Until then their states and covariances follow
/// from those of the pose at which the chain starts, the anchor (`NewestCovariances`).
class CompactGraph {
 public:
  /// The newest pose.
  struct Newest {
    Variable pose;
    PlacedState placed{};
    bool kept = false;
    int predecessor = -1;  ///< last kept pose before it
    std::shared_ptr<const FactorType> type;
    Motion odometry;  ///< from the predecessor

    Id id() const { return pose.id; }
    const State& state() const { return placed.x; }
  };
  /// Poses that have left.
  struct Leaving {
    std::vector<Id> poses;
    std::vector<int> now;  ///< the number that each kept pose has now; −1: it has left
    std::string note{};    ///< why more stay than there is room for; empty: they do not
    std::vector<std::string> notes{};  ///< of the remover, each said once
  };

  /// `marginals`: what the estimator keeps, which costs time with each link; the diagonal if many
  /// poses are candidates at a time, nothing if few are.
  CompactGraph(std::unique_ptr<Estimator> estimator, CompositionOrder order,
               KeptMarginals marginals = KeptMarginals::diagonal);

  /// Before the first pose: the poses, landmarks and factors of an earlier session's map. Throws
  /// `Error` (input) if it is not one connected graph of these.
  void load(const Graph& map);
  /// The first pose of the trajectory.
  void start(const Variable& pose, PolicySeconds& seconds);
  /// The next pose, moved by `motion` from the one before: from then on the newest.
  void advance(const Variable& pose, const Motion& motion,
               const std::shared_ptr<const FactorType>& type);
  /// Keeps the newest pose.
  void keep(PolicySeconds& seconds);
  /// Keeps the newest pose, and takes these links in.
  void link(std::span<const Factor> links, PolicySeconds& seconds);
  /// Takes factors of kept poses in, and leaves the newest as it is.
  void add(std::span<const Factor> factors, PolicySeconds& seconds) { update(factors, seconds); }
  /// Keeps the newest pose; adds landmarks, and factors on it and landmarks.
  void see(std::vector<Variable> added, std::span<const Factor> factors, PolicySeconds& seconds);
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
  /// The newest pose, matched with a pose of the map, `measured` from there: moves the whole
  /// trajectory to its place on the map, x_k ← x_pose z x_n⁻¹ x_k, and adds the links.
  void locate(int pose, const State& measured, std::span<const Factor> links,
              PolicySeconds& seconds);
  /// Keeps the newest pose; moves the whole graph, x_k ← move x_k, to where these absolute
  /// measurements of kept poses say together, and takes them in.
  void refer(const State& move, std::span<const Factor> priors, PolicySeconds& seconds);
  /// Takes the link, or links, between two poses out, of which one is kept: what is left is as if
  /// there had never been one, except that the same poses are kept and that the information of
  /// other matches is divided as it was. False if there is none (any more). Throws `Error` (input),
  /// and changes nothing, where it cannot be separated from other measurements any more, or is all
  /// that connects a trajectory to its map.
  bool revoke(Id a, Id b, PolicySeconds& seconds);
  /// Removes landmarks, and all that was measured of them.
  void release(std::span<const Id> landmarks, PolicySeconds& seconds);
  /// Where more than `limit` poses are kept, makes that many of them: others leave, and are
  /// replaced by factors between their neighbours. Never the newest, the first of the trajectory,
  /// those that are fixed or anchored, and `held`.
  Leaving make_room(PoseRemover& remover, int limit, std::span<const int> held,
                    PolicySeconds& seconds);
  /// Removes one of the temporary poses, if there is one that may leave (`TemporaryPoses::judge`).
  /// `cover`: a pose that stays at the place of another; `needed`: whether something else waits for
  /// one. Nothing: none has left.
  std::optional<Leaving> drop_temporary(const InformationLoss& most,
                                        const std::function<std::optional<Id>(int)>& cover,
                                        const std::function<bool(Id)>& needed,
                                        PolicySeconds& seconds);
  /// Relinearises and solves everything until it has converged; false if it does not.
  bool solve_fully();

  /// Whether the trajectory has not begun.
  bool empty() const { return kept_.size() == map_size_; }
  const RigidGroup& group() const { return *kept_.group(); }
  const KeptPoses& kept() const { return kept_; }
  const Newest& newest() const { return newest_; }
  const GraphLandmarks& landmarks() const { return landmarks_; }
  /// What has left the graph since this was called last: by `release`, or, since with it there was
  /// no covariance of what an update measured, by that update.
  std::vector<LeftOut> take_left_out() { return landmarks_.take_left_out(); }
  /// With everything that is kept. Good until the graph changes; reading it changes no later
  /// result.
  Estimator& estimator() { return kept_.whole(); }
  int factor_count() const;
  /// Whether something absolute determines where the graph is: a fixed pose, or measurements.
  /// Otherwise its first pose holds it, and covariances are relative to that.
  bool referenced() const { return referenced_; }
  /// Whether it is known where the trajectory is on the map; true if there is none. Until then the
  /// two are separate components, and nothing is known of a displacement between them.
  bool located() const { return located_; }
  /// Poses below this number are those of the map.
  int map_size() const { return map_size_; }
  /// Whether something is known of the displacement between two kept poses.
  bool connected(int a, int b) const { return located_ || (a < map_size_) == (b < map_size_); }
  /// Whether poses have left: there is no room for more than there are.
  bool full() const { return full_; }
  /// Kept poses within a distance [m] of the newest, itself not among them, nor the map while the
  /// trajectory's place on it is unknown.
  std::vector<int> near(double radius) const;
  /// From each kept pose to the next one of the trajectory.
  const std::vector<OdometryChain>& chains() const { return chains_.all(); }
  void keep_chains(bool keep) { chains_.keep(keep); }

  /// Whether a kept pose is temporary.
  bool temporary(int pose) const { return temporary_.contains(kept_.id(pose)); }
  /// The newest, which is kept and may leave.
  void make_temporary() { temporary_.add_newest(kept_); }
  void make_permanent(int pose) { temporary_.remove(kept_.id(pose)); }

  // Covariances, at the present estimate ---------------------------------------------------------
  /// Rises whenever the estimate and its covariances change.
  int version() const { return covariances_.version(); }
  /// Sees to it that the covariances of these poses with the newest are known.
  void prepare(std::span<const int> poses, PolicySeconds& seconds);
  bool prepared(int pose) const { return covariances_.prepared(pose, kept_); }
  /// From a kept pose, which was prepared, to the newest, with its covariance.
  Displacement displacement(int pose) const;
  /// Covariance of the newest pose itself, Σ_nn.
  Matrix newest_covariance(PolicySeconds& seconds);
  /// Joint covariance of landmarks of the graph and, after them, the newest pose; without passing
  /// anything to the estimator.
  Eigen::MatrixXd landmark_covariance(std::span<const Id> landmarks, PolicySeconds& seconds);
  /// Of kept poses and, after them, the newest; by solving, for which all of them must reach the
  /// estimator.
  Eigen::MatrixXd joint_covariance(std::span<const int> poses, PolicySeconds& seconds);
  /// Of a landmark and, after it, a kept pose; likewise.
  Eigen::MatrixXd landmark_covariance(Id landmark, int pose, PolicySeconds& seconds);
  /// Of a kept pose itself; likewise.
  Matrix covariance(int pose);
  /// Between two kept poses, with its covariance; likewise.
  Displacement between(int a, int b);

 private:
  FactorId update(std::span<const Factor> links, PolicySeconds& seconds,
                  std::vector<ChangedFactor> changed = {}, std::vector<Variable> added = {});
  void refresh();
  void set_anchor();
  void hang_newest();
  void move_poses(int first, const State& move, std::span<const Factor> factors);
  void add_bridge(std::pair<int, int> ends, Motion motion, PolicySeconds& seconds);
  void check_connected(Id a, Id b, const GraphUpdate& leaving) const;
  void renumber(const Leaving& leaving, const GraphUpdate& update, std::span<const Factor> removed,
                FactorId first_factor);
  Leaving remove(const TemporaryPoses::Leaving& pose);

  CompositionOrder order_;
  KeptPoses kept_;
  GraphLandmarks landmarks_;
  Newest newest_;
  NewestCovariances covariances_;
  LinkRecord links_;
  Chains chains_;
  TemporaryPoses temporary_;
  int map_size_ = 0;
  bool located_ = true, referenced_ = false, full_ = false;
};

}  // namespace cairn::compact
