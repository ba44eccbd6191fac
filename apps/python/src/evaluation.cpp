// SPDX-License-Identifier: BSD-3-Clause
// Errors of trajectories.
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <pybind11/pybind11.h>

#include "bindings.hpp"
#include "bound_graph.hpp"
#include "cairn/evaluation/trajectory.hpp"
#include "cairn/runtime/error.hpp"
#include "result_attributes.hpp"

namespace cairn::python {
namespace {

Trajectory trajectory_of(const Graph& graph, const std::vector<double>& stamps) {
  Trajectory poses = trajectory(graph);
  if (stamps.size() != poses.size()) return poses;  // of a graph that has changed since
  for (std::size_t k = 0; k < poses.size(); ++k) poses[k].stamp = stamps[k];
  return poses;
}

/// How poses are paired: "id", "stamp", or "auto" for what fits both.
bool by_stamp(const std::string& match, const Trajectory& estimate, const Trajectory& truth) {
  if (match == "id") return false;
  if (match == "auto") return stamps_tell_more(estimate, truth);
  if (match != "stamp") {
    throw Error(ErrorCode::usage,
                fmt::format("match='{}': expected 'auto', 'id' or 'stamp'", match));
  }
  for (const Trajectory* poses : {&estimate, &truth}) {
    if (poses->empty() || poses->front().stamp) continue;
    throw Error(ErrorCode::usage, fmt::format("the {} has no time stamps; read it from a file that "
                                              "has them, or match='id'",
                                              poses == &estimate ? "estimate" : "truth"));
  }
  return true;
}

void warn(const std::string& text) {
  if (PyErr_WarnEx(PyExc_UserWarning, text.c_str(), 1) != 0) throw py::error_already_set();
}

/// A UserWarning where one of the two has no height that could be wrong.
void warn_of_dimensions(const Graph& estimate, const Graph& truth, const Trajectory& poses,
                        const Trajectory& true_poses) {
  const bool planar_estimate = is_planar(estimate) && !is_planar(true_poses);
  if (!planar_estimate && !(is_planar(truth) && !is_planar(poses))) return;
  const std::string text = fmt::format(
      "the {} is of the plane and the {} in space: heights, roll and pitch count as errors; "
      "planar=True compares x, y and yaw alone",
      planar_estimate ? "estimate" : "truth", planar_estimate ? "truth" : "estimate");
  warn(text);
}

/// Refuses, or warns of, what rests on the numbers of rows.
void judge_rows(const TrajectoryPairs& pairs, bool estimate_rows, bool truth_rows) {
  const RowPairing rows = row_pairing(pairs, estimate_rows, truth_rows);
  if (rows == RowPairing::none || rows == RowPairing::complete) return;
  const std::string what = fmt::format(
      "the {} has no ids, and pose k is compared with row k, with {} poses left without a partner",
      estimate_rows ? "estimate" : "truth", pairs.only_in_estimate + pairs.only_in_truth);
  if (rows == RowPairing::partial) return warn(what + "; match='id' takes rows for ids");
  const bool truth_timed = pairs.truth.front().stamp.has_value();
  throw Error(ErrorCode::input,
              fmt::format("{}: that means nothing where rows were taken at other times; set the "
                          "stamps of the {} (Graph.stamps) to pair by time, or match='id' to "
                          "compare by row all the same",
                          what, truth_timed ? "estimate" : "truth"));
}

void suggest_scale(const TrajectoryPairs& pairs) {
  const std::optional<double> scale = explaining_scale(pairs);
  if (!scale) return;
  warn(
      fmt::format("a scale of {:.6g} explains most of the error of the estimate, as for a single "
                  "camera; align_scale=True compares it so",
                  *scale));
}

void suggest_axes(const TrajectoryPairs& pairs, const TrajectoryError& error) {
  if (const auto axes = camera_axes_of_one(pairs, error.ate_rotation)) {
    warn(fmt::format(
        "with axes='camera' for cairn.read of the {} the ATE in rotation is {:.6g} deg "
        "instead of {:.6g} deg: one of the two is in the axes of a camera, the other "
        "of a robot",
        axes->of_estimate ? "estimate" : "truth", axes->ate_rotation, error.ate_rotation));
  }
}

TrajectoryError evaluate(BoundGraph& estimate, BoundGraph& truth, const std::string& match,
                         bool planar, bool align_scale) {
  Trajectory poses = trajectory_of(estimate.get(), estimate.stamps);
  Trajectory true_poses = trajectory_of(truth.get(), truth.stamps);
  if (planar) {
    poses = projected_to_plane(std::move(poses));
    true_poses = projected_to_plane(std::move(true_poses));
  }
  warn_of_dimensions(estimate.get(), truth.get(), poses, true_poses);
  const bool stamps = by_stamp(match, poses, true_poses);
  const TrajectoryPairs pairs =
      stamps ? pair_by_stamp(poses, true_poses) : pair_by_id(poses, true_poses);
  if (!stamps && match != "id") judge_rows(pairs, estimate.row_ids, truth.row_ids);
  if (!align_scale) suggest_scale(pairs);
  const TrajectoryError error = [&] {
    const py::gil_scoped_release unlocked;
    return compare(pairs, align_scale ? Alignment::similarity : Alignment::rigid);
  }();
  if (!planar) suggest_axes(pairs, error);
  return error;
}

}  // namespace

void bind_evaluation(py::module_& module) {
  py::class_<TrajectoryError> type(module, "TrajectoryError",
                                   "Root mean squares of errors of an estimate against the truth.");
  type.def("__repr__", [](const TrajectoryError& error) {
    return fmt::format(
        "<cairn.TrajectoryError of {} poses: ATE {:.6g} m, {:.6g} deg; RPE {:.6g} "
        "m, {:.6g} deg>",
        error.poses, error.ate_translation, error.ate_rotation, error.rpe_translation,
        error.rpe_rotation);
  });
  bind_fields<TrajectoryError>(type);
  module.def(
      "evaluate", &evaluate, py::arg("estimate"), py::arg("truth"), py::kw_only(),
      py::arg("match") = "auto", py::arg("planar") = false, py::arg("align_scale") = false,
      R"(Errors of the poses of a graph against those of another, after rigid alignment: a TrajectoryError.

match: "id" pairs poses of equal id, "stamp" by the times of both (Graph.stamps), "auto" does what fits them. Where a file
has no ids, they are its row numbers: an Error where the other has ids, one of the two has times, and not every pose has a
partner; match="id" compares by row all the same.
align_scale: aligns with a scale, too, which the estimate of a single camera lacks (`TrajectoryError.scale`), for all errors
alike. Without it a UserWarning says where a scale explains most of the error.
planar: compares x, y and yaw alone. Without it a UserWarning says where one of the two is of the plane and the other not,
and where one is in the axes of a camera (axes of `cairn.read`) and the other of a robot.)");
}

}  // namespace cairn::python
