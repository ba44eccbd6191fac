// SPDX-License-Identifier: BSD-3-Clause
#include "absolute_selection.hpp"

#include <utility>

#include "cairn/runtime/error.hpp"

namespace cairn::compact {

LinkVerdict AbsoluteSelection::verdict(const MeasuredFit& fit, PriorReport& outcome) const {
  outcome.gain = fit.gain;
  outcome.innovation = fit.innovation;
  if (!(fit.gain > least_gain_)) return LinkVerdict::uninformative;
  if (!gate_.passes(fit.innovation, fit.dof)) return LinkVerdict::inconsistent;
  return LinkVerdict::linked;
}

PriorReport AbsoluteSelection::judge(const Factor& measured, CompactGraph& graph,
                                     PoseReport& report) {
  AbsoluteMeasurement prior(measured, graph.newest().id(), graph.group().motions().type());
  if (!graph.located()) {
    throw Error(ErrorCode::input,
                "it is not known where the pose is on the map: absolute measurements are used from "
                "the first match with it on");
  }
  settle(graph, report);
  PriorReport outcome{.pose = graph.newest().id()};
  const bool referenced = graph.referenced();
  const AbsoluteMeasurement::Linear now = prior.at(graph.newest().state());
  outcome.verdict = verdict(referenced ? fit(now, graph.newest_covariance(report.seconds))
                                       : frame(graph, report.seconds).fit(now),
                            outcome);
  if (outcome.verdict == LinkVerdict::linked) {
    if (referenced) {
      graph.link({&prior.factor(), 1}, report.seconds);
    } else {
      outcome.verdict = LinkVerdict::waiting;
      graph.keep(report.seconds);
      waiting_.push_back({std::move(prior), outcome});
      if (find_frame(graph, report)) outcome.verdict = LinkVerdict::linked;
    }
  }
  report.priors.push_back(outcome);
  return outcome;
}

/// What the measurements that wait say of where the graph is.
FrameEstimate AbsoluteSelection::frame(CompactGraph& graph, PolicySeconds& seconds) const {
  std::vector<PlacedMeasurement> placed;
  const std::vector<int> poses = held(graph);
  for (std::size_t k = 0; k < waiting_.size(); ++k)
    placed.push_back({&waiting_[k].measurement, graph.kept().state(poses[k])});
  Eigen::MatrixXd joint = graph.joint_covariance(poses, seconds);
  return {graph.group(), std::move(placed), graph.newest().state(), std::move(joint)};
}

/// Whether the measurements that wait determine where the graph is: then it is moved there, and has
/// them.
bool AbsoluteSelection::find_frame(CompactGraph& graph, PoseReport& report) {
  const FrameEstimate estimate = frame(graph, report.seconds);
  if (!estimate.determined()) return false;
  std::vector<Factor> factors;
  for (Waiting& waiting : waiting_) {
    factors.push_back(waiting.measurement.factor());
    waiting.report.verdict = LinkVerdict::linked;
    if (&waiting != &waiting_.back())  // which is that of now
      report.priors.push_back(waiting.report);
  }
  graph.refer(estimate.best_move(), factors, report.seconds);
  waiting_.clear();
  return true;
}

void AbsoluteSelection::settle(CompactGraph& graph, PoseReport& report) {
  if (!graph.referenced()) return;
  for (Waiting& waiting : std::exchange(waiting_, {})) {
    const int pose = graph.kept().find(waiting.measurement.pose());
    const Matrix covariance = graph.covariance(pose);
    PriorReport& outcome = waiting.report;
    outcome.verdict =
        verdict(fit(waiting.measurement.at(graph.kept().state(pose)), covariance), outcome);
    if (outcome.verdict == LinkVerdict::linked)
      graph.add({&waiting.measurement.factor(), 1}, report.seconds);
    report.priors.push_back(outcome);
  }
}

std::vector<int> AbsoluteSelection::held(const CompactGraph& graph) const {
  std::vector<int> poses;
  for (const Waiting& waiting : waiting_)
    poses.push_back(graph.kept().find(waiting.measurement.pose()));
  return poses;
}

}  // namespace cairn::compact
