// SPDX-License-Identifier: BSD-3-Clause
// Absolute measurements of poses: judged by what they add, as links are.
#include <utility>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"
#include "compact_pose.hpp"

namespace cairn::compact {

LinkVerdict CompactPose::judge_prior(const MeasuredFit& fit, PriorReport& report) const {
  report.gain = fit.gain;
  report.innovation = fit.innovation;
  if (!(fit.gain > prior_gain_)) return LinkVerdict::uninformative;
  if (!check_->passes(fit.innovation, fit.dof)) return LinkVerdict::inconsistent;
  return LinkVerdict::linked;
}

PriorReport CompactPose::offer_prior(const Factor& measured) {
  if (!open_) throw Error(ErrorCode::usage, "offer_prior without a pose");
  AbsoluteMeasurement prior(measured, graph_.newest_id(), graph_.group().motions().type());
  if (!graph_.located()) {
    throw Error(ErrorCode::input,
                "it is not known where the pose is on the map: absolute measurements are used from "
                "the first match with it on");
  }
  const Timed timed(report_.seconds.total);
  settle_priors();
  PriorReport report{.pose = graph_.newest_id()};
  const bool referenced = graph_.referenced();
  const AbsoluteMeasurement::Linear now = prior.at(graph_.newest_state());
  report.verdict = judge_prior(
      referenced ? fit(now, graph_.newest_covariance(report_.seconds)) : frame().fit(now), report);
  if (report.verdict == LinkVerdict::linked) {
    if (referenced) {
      graph_.link({&prior.factor(), 1}, report_.seconds);
    } else {
      report.verdict = LinkVerdict::waiting;
      graph_.keep(report_.seconds);
      waiting_priors_.push_back({std::move(prior), report});
      if (find_frame()) report.verdict = LinkVerdict::linked;
    }
  }
  report_.priors.push_back(report);
  return report;
}

/// What the measurements that wait say of where the graph is.
FrameEstimate CompactPose::frame() {
  std::vector<PlacedMeasurement> placed;
  std::vector<int> poses;
  for (const WaitingPrior& waiting : waiting_priors_) {
    const int pose = graph_.find(waiting.measurement.pose());
    placed.push_back({&waiting.measurement, graph_.state(pose)});
    poses.push_back(pose);
  }
  Eigen::MatrixXd joint = graph_.joint_covariance(poses, report_.seconds);
  return {graph_.group(), std::move(placed), graph_.newest_state(), std::move(joint)};
}

/// Whether the measurements that wait determine where the graph is: then it is moved there, and has
/// them.
bool CompactPose::find_frame() {
  const FrameEstimate estimate = frame();
  if (!estimate.determined()) return false;
  std::vector<Factor> factors;
  for (WaitingPrior& waiting : waiting_priors_) {
    factors.push_back(waiting.measurement.factor());
    waiting.report.verdict = LinkVerdict::linked;
    if (&waiting != &waiting_priors_.back())  // which is that of now
      report_.priors.push_back(waiting.report);
  }
  graph_.refer(estimate.best_move(), factors, report_.seconds);
  waiting_priors_.clear();
  return true;
}

/// After a pose was fixed nothing has to wait.
void CompactPose::settle_priors() {
  if (!graph_.referenced()) return;
  for (WaitingPrior& waiting : std::exchange(waiting_priors_, {})) {
    const int pose = graph_.find(waiting.measurement.pose());
    const Matrix covariance = graph_.covariance(pose);
    PriorReport& report = waiting.report;
    report.verdict =
        judge_prior(fit(waiting.measurement.at(graph_.state(pose)), covariance), report);
    if (report.verdict == LinkVerdict::linked)
      graph_.add({&waiting.measurement.factor(), 1}, report_.seconds);
    report_.priors.push_back(report);
  }
}

}  // namespace cairn::compact
