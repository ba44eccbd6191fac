// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <pybind11/pybind11.h>
#include <Eigen/Core>

#include "cairn/exploration/explorer.hpp"
#include "cairn/exploration/path_planner.hpp"
#include "estimates.hpp"

namespace cairn::python {

namespace py = pybind11;

/// What an explorer written in Python decides upon. It refers to a map and an estimator that go on
/// changing, so it can be asked until the call that it was an argument of has returned.
class BoundSituation final : public HasEstimator {
 public:
  explicit BoundSituation(const Situation& now)
      : HasEstimator("the situation is in use by a call in another thread that has not returned"),
        now_(&now) {}

  /// Throws `Error` (usage) after `end`.
  const Situation& now() const;
  void end() {
    now_ = nullptr;
    planners_.clear();
  }

  /// A path of the robot to `goal` [m] by a planner of that name; see `PathPlanner::path_to`.
  std::optional<PlannedPath> path_to(const Eigen::Vector2d& goal, double tolerance,
                                     std::optional<double> radius, const std::string& planner);

 private:
  Estimator& held() override { return now().estimator; }

  const Situation* now_;
  /// Those that have started, by name and radius.
  std::map<std::pair<std::string, double>, std::unique_ptr<PathPlanner>> planners_;
};

/// What an explorer written in Python returns.
struct BoundDecision {
  Decision::Kind kind = Decision::Kind::finished;
  std::string why;
  py::object to;       ///< to drive: a goal (2,), points (n, 2) [m] or a PlannedPath
  py::object look_at;  ///< (2,) [m], or None
};

/// Throws `Error` (usage), which names what was returned, where that is no decision.
Decision decision_of(const py::object& returned, BoundSituation& situation);

}  // namespace cairn::python
