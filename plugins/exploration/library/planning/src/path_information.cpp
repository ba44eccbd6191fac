// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/path_information.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "match_index.hpp"
#include "path_closure.hpp"
#include "pose_covariances.hpp"

namespace cairn {

using Eigen::Matrix3d;

struct PathInformation::Node {
  std::shared_ptr<const Node> before;
  Model* model = nullptr;
  Pose2 pose;
  int steps = 0;
  double length = 0.0;
  Matrix3d walk = Matrix3d::Zero();       ///< of ε_k − ε_t, without loop closures
  Matrix3d posterior = Matrix3d::Zero();  ///< of ε_k, without the prior
  /// Σ ln|Σ_jj| of those of the path; with `loops=exact` of those since the last closure.
  double path_sum = 0.0;
  double odometry = 0.0, loop = 0.0;           ///< changes of ln|Λ|
  std::shared_ptr<const PathClosure> closure;  ///< the last one
};

namespace {

Matrix3d symmetric(const Matrix3d& M) { return 0.5 * (M + M.transpose()); }

}  // namespace

/// The algorithm: one object per decision.
class PathInformation::Model {
 public:
  Model(const Situation& situation, const PathInformationOptions& options, CanMatch can_match)
      : covariances_(situation, situation.pose),
        updates_(covariances_, options.memory * 1e6),
        estimates_(covariances_, options.memory * 1e6,
                   options.sampled_poses > 0 ? options.sampled_poses : covariances_.size()),
        options_(options),
        can_match_(std::move(can_match)),
        match_(situation.match),
        odometry_(situation.robot.odometry),
        index_(covariances_.poses(), situation.pose, situation.match),
        newest_(covariances_.size() - 1),
        loop_gain_(match_.loop_gain_unless(options.loop_gain)),
        factor_(options.entropy == EntropyForm::standard ? 0.5 : 1.0),
        match_determinant_(match_.covariance().determinant()) {
    for (int l = 0; options.loops == LoopForm::exact && l < covariances_.size(); ++l) {
      const Matrix3d cross = covariances_.block(l, newest_).transpose();  // of ε_k and ε_l
      terms_.push_back({covariances_.diagonal(l) - cross - cross.transpose(), cross});
    }
    start_ = std::make_shared<Node>();
    start_->model = this;
    start_->pose = situation.pose;
    // A robot whose newest pose is not kept has driven on from the one before.
    if (const auto since = motion_since_newest(situation))
      start_->walk = covariances_.moved(situation.pose, odometry_.covariance(*since));
    start_->posterior = covariances_.diagonal(newest_) + start_->walk;
  }

  const std::shared_ptr<Node>& start() const { return start_; }
  std::shared_ptr<const Node> extended(const std::shared_ptr<const Node>& path,
                                       const Pose2& motion) {
    auto next = std::make_shared<Node>();
    next->before = path;
    next->model = this;
    next->pose = path->pose * motion;
    next->steps = path->steps + 1;
    next->length = path->length + motion.translation().norm();
    const Matrix3d Q = odometry_.covariance(motion);
    const Matrix3d noise = covariances_.moved(next->pose, Q);
    next->walk = path->walk + noise;
    next->posterior = path->posterior + noise;
    next->path_sum = path->path_sum + log_determinant(next->posterior);
    next->odometry = path->odometry - std::log(Q.determinant());
    next->loop = path->loop;
    next->closure = path->closure;
    if (options_.loops == LoopForm::exact)
      close_exactly(*next);
    else
      close_as_thesis(*next);
    return next;
  }

  /// Of the trajectory's entropy, exactly or estimated.
  double change(const Node& node, bool is_exact) {
    double sum = updates_.sum() + node.path_sum;
    if (node.closure && options_.loops == LoopForm::exact) {
      sum += path_sum(node);
      MarginalUpdates& updates = is_exact || estimates_.is_of_all() ? updates_ : estimates_;
      sum += updates.change(*node.closure);
    }
    return factor_ * (sum / (covariances_.size() + node.steps) - mean());
  }

  const PoseCovariances& covariances() const { return covariances_; }
  double mean() const { return updates_.sum() / covariances_.size(); }
  double factor() const { return factor_; }
  int poses() const { return covariances_.size(); }

 private:
  bool can_match(int older, const Pose2& newer) const {
    return !can_match_ || can_match_(covariances_.pose(older), newer);
  }

  double log_determinant(const Matrix3d& without_prior) const {
    return std::log((without_prior + covariances_.prior()).determinant());
  }

  // Exact -----------------------------------------------------------------------------------------

  /// A loop closure that could be made.
  struct Choice {
    int pose = -1;
    double determinant = std::numeric_limits<double>::infinity();  ///< |Σ'_kk|
    double gain = 0.0;                                             ///< ln(|S| / |R|)
    Matrix3d S, K;                                                 ///< cov(y, y), cov(ε_k, y)
  };

  /// After the closures of a path, of which `last` is the newest; null: there is none.
  const PoseTerms& terms(const PathClosure* last, int l) {
    if (!last) return terms_[static_cast<std::size_t>(l)];
    if (const auto known = last->of_poses.find(l); known != last->of_poses.end())
      return known->second.terms;
    PoseTerms terms = this->terms(last->before.get(), l);
    Matrix3d y = (covariances_.block(l, newest_) - covariances_.block(l, last->pose)).transpose();
    auto coupling = last->coupling.rbegin();
    for (const PathClosure* b = last->before.get(); b; b = b->before.get())
      y.noalias() -= *coupling++ * b->of_poses.find(l)->second.Z;
    const Matrix3d Z = last->inverse * y, difference = last->end - Z;
    terms.apart.noalias() -= difference.transpose() * difference;
    terms.cross.noalias() += last->end.transpose() * difference;
    return last->of_poses.emplace(l, PathClosure::OfPose{Z, terms}).first->second.terms;
  }

  Choice best_choice(const Node& node) {
    Choice best;
    const Matrix3d R = covariances_.moved(node.pose, match_.covariance());
    const Matrix3d end = covariances_.diagonal(newest_) + node.walk;
    const Matrix3d before = node.posterior + covariances_.prior();
    const double least = match_determinant_ * std::exp(2.0 * loop_gain_);
    index_.for_each(node.pose, [&](int l) {
      const PoseTerms& known = terms(node.closure.get(), l);
      const Matrix3d S = symmetric(end + R + known.apart);
      if (!(S.determinant() > least)) return;
      const Matrix3d K = end - known.cross;
      const double determinant = (before - K * S.inverse() * K.transpose()).determinant();
      // Last whether it can be matched, which takes longest.
      if (!(determinant < best.determinant) || !can_match(l, node.pose)) return;
      best = {l, determinant, 0.0, S, K};
    });
    if (best.pose >= 0) best.gain = std::log(best.S.determinant() / match_determinant_);
    return best;
  }

  void close_exactly(Node& node) {
    const Choice choice = best_choice(node);
    if (choice.pose < 0) return;
    const std::vector<const PathClosure*> closures = in_order(node.closure.get());
    auto closure = std::make_shared<PathClosure>();
    closure->before = node.closure;
    closure->count = static_cast<int>(closures.size()) + 1;
    closure->pose = choice.pose;
    closure->step = node.steps;
    closure->ratio = choice.determinant / (node.posterior + covariances_.prior()).determinant();
    for (const PathClosure* c : closures)
      closure->coupling.emplace_back(
          (c->end - c->of_poses.find(choice.pose)->second.Z).transpose());
    const Matrix3d L = Eigen::LLT<Matrix3d>(choice.S).matrixL();
    closure->inverse = L.triangularView<Eigen::Lower>().solve(Matrix3d::Identity());
    closure->end = closure->inverse * choice.K.transpose();
    node.posterior = symmetric(node.posterior - closure->end.transpose() * closure->end);
    node.loop += choice.gain;
    node.closure = closure;
    node.path_sum = 0.0;
    closure->walk = node.walk;
    closure->posterior = node.posterior;
    const Matrix3d innovation =
        covariances_.diagonal(newest_) - covariances_.block(choice.pose, newest_);
    update_stretches(closures, innovation, start_->walk, start_->posterior, *closure);
  }

  /// Σ ln|Σ_jj| of the poses of a path up to its newest closure, after it.
  double path_sum(const Node& last) const {
    const PathClosure& newest = *last.closure;
    if (newest.path_sum) return *newest.path_sum;
    constexpr int kDeterminantsPerLogarithm = 8;  // even 10⁻³⁰ each does not underflow
    double sum = 0.0, product = (newest.posterior + covariances_.prior()).determinant();
    int factors = 1;
    const Node* node = &last;
    while (node->steps >= newest.step) node = node->before.get();
    while (node->steps > 0) {
      const PathClosure* begin = node->closure.get();
      const StretchMarginals stretch(newest, begin ? begin->count : 0);
      const Matrix3d& walk = begin ? begin->walk : start_->walk;
      for (; node->steps > 0 && node->closure.get() == begin; node = node->before.get()) {
        product *= (stretch.after(node->walk - walk) + covariances_.prior()).determinant();
        if (++factors % kDeterminantsPerLogarithm > 0) continue;
        sum += std::log(product);
        product = 1.0;
      }
    }
    newest.path_sum = sum + std::log(product);
    return *newest.path_sum;
  }

  // As in the thesis ------------------------------------------------------------------------------

  /// |Σ'_ll| / |Σ_ll| of a pose of the graph by the closures of a path (5.16): 1 up to the pose
  /// with which the loop is closed, and from there in a straight line to that at its end.
  double ratio(const PathClosure* closure, int pose) const {
    double ratio = 1.0;
    for (; closure; closure = closure->before.get()) {
      if (pose <= closure->pose) continue;
      const int length = covariances_.size() - 1 + closure->step - closure->pose;
      ratio *= 1.0 + (pose - closure->pose) * (closure->ratio - 1.0) / length;
    }
    return ratio;
  }

  void close_as_thesis(Node& node) {
    const Matrix3d R = covariances_.moved(node.pose, match_.covariance());
    const Matrix3d now = node.posterior + covariances_.prior();
    Matrix3d after;
    int best = -1;
    double least = now.determinant() * std::exp(-2.0 * loop_gain_);
    index_.for_each(node.pose, [&](int l) {
      const Matrix3d older = std::cbrt(ratio(node.closure.get(), l)) *
                             (covariances_.diagonal(l) + covariances_.prior());
      const double determinant = (older + R).determinant();
      if (!(determinant < least) || !can_match(l, node.pose)) return;
      least = determinant;
      best = l;
      after = older + R;
    });
    if (best < 0) return;
    auto closure = std::make_shared<PathClosure>();
    closure->before = node.closure;
    closure->count = node.closure ? node.closure->count + 1 : 1;
    closure->pose = best;
    closure->step = node.steps;
    closure->ratio = least / now.determinant();
    const int length = covariances_.size() - 1 + node.steps - best;
    const double slope = (closure->ratio - 1.0) / length;
    for (int j = 1; j <= length; ++j) node.path_sum += std::log(1.0 + j * slope);
    node.loop -= std::log(closure->ratio);
    node.posterior = after - covariances_.prior();
    node.closure = std::move(closure);
  }

  PoseCovariances covariances_;
  MarginalUpdates updates_, estimates_;
  PathInformationOptions options_;
  CanMatch can_match_;
  MatchModel match_;
  OdometryModel odometry_;
  MatchIndex index_;
  int newest_;
  double loop_gain_, factor_, match_determinant_;
  std::vector<PoseTerms> terms_;  ///< of each pose, before any closure
  std::shared_ptr<Node> start_;
};

const Pose2& PathInformation::State::pose() const { return node_->pose; }
int PathInformation::State::steps() const { return node_->steps; }
double PathInformation::State::length() const { return node_->length; }
double PathInformation::State::trajectory_change() const {
  return node_->model->change(*node_, true);
}
double PathInformation::State::estimated_trajectory_change() const {
  return node_->model->change(*node_, false);
}
double PathInformation::State::odometry_log_determinant() const { return node_->odometry; }
double PathInformation::State::loop_log_determinant() const { return node_->loop; }
int PathInformation::State::loops() const { return node_->closure ? node_->closure->count : 0; }

Matrix3d PathInformation::State::covariance() const {
  const PoseCovariances& frame = node_->model->covariances();
  return symmetric(frame.moved_back(node_->pose, node_->posterior + frame.prior()));
}

std::optional<Id> PathInformation::State::closes_with() const {
  if (!node_->closure || node_->closure->step != node_->steps) return std::nullopt;
  return node_->model->covariances().id(node_->closure->pose);
}

PathInformation::State PathInformation::State::before() const {
  return State(node_->before ? node_->before : node_);
}

PathInformation::PathInformation(const Situation& situation, const PathInformationOptions& options,
                                 CanMatch can_match)
    : model_(std::make_unique<Model>(situation, options, std::move(can_match))) {}
PathInformation::PathInformation(PathInformation&&) noexcept = default;
PathInformation& PathInformation::operator=(PathInformation&&) noexcept = default;
PathInformation::~PathInformation() = default;

PathInformation::State PathInformation::start() const { return State(model_->start()); }

PathInformation::State PathInformation::extended(const State& path, const Pose2& motion) {
  return State(model_->extended(path.node_, motion));
}

PathInformation::State PathInformation::extended(State path, std::span<const Pose2> motions) {
  for (const Pose2& motion : motions) path = extended(path, motion);
  return path;
}

double PathInformation::trajectory_entropy() const {
  const double constant = 1.5 * std::log(2.0 * std::numbers::pi * std::numbers::e);
  return constant + model_->factor() * model_->mean();
}

int PathInformation::poses() const { return model_->poses(); }

}  // namespace cairn
