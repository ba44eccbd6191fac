// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/recorder.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Geometry>

#include "cairn/io/output_file.hpp"
#include "cairn/io/packed_array.hpp"
#include "cairn/report/scene.hpp"
#include "cairn/runtime/timed.hpp"
#include "cairn/runtime/version.hpp"
#include "map_delta.hpp"
#include "pose_covariance.hpp"
#include "scan_poses.hpp"

namespace cairn {
namespace {

/// Of so many candidates, the best, the paths are recorded: those of others are hardly seen in a
/// figure, and an explorer may have thousands.
constexpr std::size_t kMostPaths = 100;

std::string list(const std::vector<std::string>& texts) {
  return fmt::format("[{}]", fmt::join(texts, ","));
}

std::string strings(const std::vector<std::string>& texts) {
  std::vector<std::string> literals;
  for (const std::string& text : texts) literals.push_back(json_string(text));
  return list(literals);
}

/// A length or an angle, to 0.1 mm or 0.1 mrad.
std::string rounded(double number) {
  return std::isfinite(number) ? fmt::format("{:.4f}", number) : "null";
}

std::string pose_json(const Pose2& pose) {
  return fmt::format("[{},{},{}]", rounded(pose.x()), rounded(pose.y()), rounded(pose.theta()));
}

std::string point_json(const Eigen::Vector2d& point) {
  return fmt::format("[{},{}]", rounded(point.x()), rounded(point.y()));
}

std::string path_json(const PlannedPath& path) {
  std::vector<std::string> points;
  for (const Eigen::Vector2d& point : path.points) points.push_back(point_json(point));
  std::string text = fmt::format(R"(,"points":{})", list(points));
  if (path.look_at) text += fmt::format(R"(,"look_at":{})", point_json(*path.look_at));
  return text;
}

std::string candidate_json(const Candidate& candidate, bool with_path) {
  std::string text =
      fmt::format(R"({{"value":{},"what":{},"length":{})", json_number(candidate.value),
                  json_string(candidate.what), rounded(candidate.path.length));
  if (candidate.change) {
    text += fmt::format(R"(,"change":{{"trajectory":{},"map":{},"alpha":{}}})",
                        json_number(candidate.change->trajectory),
                        json_number(candidate.change->map), json_number(candidate.change->alpha));
  }
  return text + (with_path ? path_json(candidate.path) : "") + "}";
}

/// Whether each candidate is among the best, or the one that was chosen.
std::vector<bool> drawn(const Decision& decision) {
  const std::vector<Candidate>& all = decision.candidates;
  std::vector<std::size_t> order(all.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t k) {
    const double value = all[k].value;
    return std::isnan(value) ? std::numeric_limits<double>::infinity() : value;
  });
  std::vector<bool> best(all.size(), all.size() <= kMostPaths);
  for (std::size_t k = 0; k < std::min(kMostPaths, order.size()); ++k) best[order[k]] = true;
  if (decision.chosen < best.size()) best[decision.chosen] = true;
  return best;
}

std::string candidates_json(const Decision& decision) {
  const std::vector<bool> with_path = drawn(decision);
  std::vector<std::string> texts;
  for (std::size_t k = 0; k < decision.candidates.size(); ++k)
    texts.push_back(candidate_json(decision.candidates[k], with_path[k]));
  return list(texts);
}

/// Positions and values as 16-bit steps, since a tree may have ten thousands of poses.
std::string tree_json(const std::vector<TreePose>& tree) {
  std::vector<float> positions, values;
  std::vector<std::int32_t> parents;
  for (const TreePose& node : tree) {
    positions.push_back(static_cast<float>(node.pose.x()));
    positions.push_back(static_cast<float>(node.pose.y()));
    values.push_back(static_cast<float>(node.value));
    parents.push_back(node.parent);
  }
  return fmt::format(R"({{"count":{},"positions":{},"parents":{},"values":{}}})", tree.size(),
                     packed_points_json(positions, 2),
                     packed_json(std::span<const std::int32_t>(parents), Packing::deflate),
                     packed_points_json(values, 1));
}

std::string_view to_string(Decision::Kind kind) {
  switch (kind) {
    case Decision::Kind::drive:
      return "drive";
    case Decision::Kind::finished:
      return "finished";
    case Decision::Kind::stuck:
      break;
  }
  return "stuck";
}

/// Of the position of a pose in the world: xx, xy, yy [m²].
std::string covariance_json(const Situation& at) {
  if (at.poses.empty()) return "null";
  const auto covariance = covariance_with_prior(
      at.estimator, at.poses.back(), pose_in(at.estimator, at.poses.front()), at.first_sigma);
  if (!covariance) return "null";
  const double theta = pose_in(at.estimator, at.poses.back()).theta();
  const Eigen::Matrix2d turn = Eigen::Rotation2Dd(theta).toRotationMatrix();
  const Eigen::Matrix2d world = turn * covariance->topLeftCorner<2, 2>() * turn.transpose();
  return fmt::format("[{:.6g},{:.6g},{:.6g}]", world(0, 0), world(0, 1), world(1, 1));
}

/// What has changed of the graph since it was last asked: members of a line.
class GraphDelta {
 public:
  std::string changes(Estimator& estimator, std::span<const Id> poses) {
    return poses_json(estimator, poses) + edges_json(estimator, poses);
  }
  /// Poses alone.
  std::string moved(const Graph& graph) {
    std::vector<std::string> texts;
    for (int v = 0; v < graph.variable_count(); ++v)
      add_if_moved(graph.id(v), Pose2::from_state(graph.state(v)), texts);
    return texts.empty() ? "" : fmt::format(R"(,"poses":{})", list(texts));
  }

 private:
  void add_if_moved(Id id, const Pose2& pose, std::vector<std::string>& texts) {
    std::string text =
        fmt::format("{},{},{},{}", id, rounded(pose.x()), rounded(pose.y()), rounded(pose.theta()));
    std::string& written = poses_[id];
    if (text == written) return;
    texts.push_back(fmt::format("[{}]", text));
    written = std::move(text);
  }

  std::string poses_json(Estimator& estimator, std::span<const Id> poses) {
    std::vector<std::string> moved, removed;
    for (const Id id : poses) add_if_moved(id, pose_in(estimator, id), moved);
    if (poses_.size() > poses.size()) {
      std::vector<Id> kept(poses.begin(), poses.end());
      std::ranges::sort(kept);
      std::erase_if(poses_, [&](const auto& pose) {
        const bool gone = !std::ranges::binary_search(kept, pose.first);
        if (gone) removed.push_back(fmt::format("{}", pose.first));
        return gone;
      });
    }
    std::string text;
    if (!moved.empty()) text += fmt::format(R"(,"poses":{})", list(moved));
    if (!removed.empty()) text += fmt::format(R"(,"removed_poses":{})", list(removed));
    return text;
  }

  std::string edges_json(Estimator& estimator, std::span<const Id> poses) {
    const std::vector<FactorId> now = estimator.factors();
    std::vector<std::string> added, removed;
    std::map<FactorId, bool> still;
    for (const FactorId id : now) {
      still.emplace(id, true);
      if (!edges_.emplace(id, true).second) continue;
      added.push_back(edge_json(id, estimator.factor(id), poses));
    }
    std::erase_if(edges_, [&](const auto& edge) {
      const bool gone = !still.contains(edge.first);
      if (gone) removed.push_back(fmt::format("{}", edge.first));
      return gone;
    });
    std::string text;
    if (!added.empty()) text += fmt::format(R"(,"edges":{})", list(added));
    if (!removed.empty()) text += fmt::format(R"(,"removed_edges":{})", list(removed));
    return text;
  }

  static std::string edge_json(FactorId id, const Factor& factor, std::span<const Id> poses) {
    const Id a = factor.variables.front(), b = factor.variables.back();
    const auto place = [&](Id pose) { return std::ranges::find(poses, pose) - poses.begin(); };
    const EdgeClass kind = factor.variables.size() == 1         ? EdgeClass::prior
                           : std::abs(place(a) - place(b)) == 1 ? EdgeClass::odometry
                                                                : EdgeClass::loop;
    return fmt::format("[{},{},{},{}]", id, a, b, static_cast<int>(kind));
  }

  std::map<Id, std::string> poses_;
  std::map<FactorId, bool> edges_;
};

}  // namespace

struct ExplorationRecorder::Impl {
  std::optional<OutputFile> file;
  Each each;
  MapDelta map;
  GraphDelta graph;
  std::chrono::steady_clock::time_point began = std::chrono::steady_clock::now();

  /// One call, so that what is there ends with a line unless it is killed within that call. Errors
  /// come up in finish(): a full disk must not end the run.
  void write_line(const std::string& line) {
    if (file) file->write(line);
    if (each) each(line);
  }
  void write(const std::string& members) {
    write_line(fmt::format("{{{},\"time\":{:.4f}}}\n", members, seconds_since(began)));
  }
  std::string map_member(const FloorMap& now) {
    const std::string changes = map.changes(now);
    return changes.empty() ? "" : fmt::format(R"(,"map":{{{}}})", changes);
  }
};

ExplorationRecorder::ExplorationRecorder(const std::filesystem::path& file, const RecordedRun& run,
                                         Each each)
    : impl_(std::make_unique<Impl>()) {
  if (!file.empty()) impl_->file.emplace(file);
  impl_->each = std::move(each);
  std::vector<std::string> parts;
  for (const auto& [kind, name] : run.parts)
    parts.push_back(fmt::format("{}:{}", json_string(kind), json_string(name)));
  const LidarModel& lidar = run.robot.lidar;
  impl_->write_line(fmt::format(
      R"({{"format":"cairn-recording","version":1,"cairn":"{}","kind":"exploration","name":{},)"
      R"("floor":{},"parts":{{{}}},"seed":{},"robot":{{"radius":{},"step":{},"turn":{},)"
      R"("lidar":{{"aperture":{},"beams":{},"range":{},"sigma":{}}}}}}})"
      "\n",
      CAIRN_VERSION, json_string(run.name), json_string(run.floor), fmt::join(parts, ","), run.seed,
      json_number(run.robot.radius), json_number(run.robot.step), json_number(run.robot.turn),
      json_number(lidar.aperture), lidar.beams, json_number(lidar.range),
      json_number(lidar.sigma)));
}

ExplorationRecorder::~ExplorationRecorder() = default;

void ExplorationRecorder::moved(const ExplorationStep& step, const Situation& at,
                                const LaserScan& scan) {
  std::string text =
      fmt::format(R"("step":{},"decision":{},"distance":{},"estimate":{})", step.step,
                  step.decision, rounded(step.distance), pose_json(step.estimate));
  if (step.truth) text += fmt::format(R"(,"truth":{})", pose_json(*step.truth));
  text += fmt::format(
      R"(,"covariance":{},"coverage":{},"map_entropy":{},"grid_area":{},)"
      R"("trajectory_entropy":{},"kept":{},)"
      R"("loops":{},"collisions":{},"scan":{{"first_angle":{},"angle_step":{},"max_range":{},)"
      R"("ranges":{}}})",
      covariance_json(at), json_number(step.coverage), json_number(step.map_entropy),
      json_number(step.grid_area), json_number(step.trajectory_entropy), step.kept, step.loops,
      step.collisions, json_number(scan.first_angle), json_number(scan.angle_step),
      json_number(scan.max_range), packed_points_json(scan.ranges, 1));
  impl_->write(text + impl_->graph.changes(at.estimator, at.poses) + impl_->map_member(at.map));
}

void ExplorationRecorder::decided(const Decision& decision, const Situation& at) {
  std::string text =
      fmt::format(R"("decision":{},"kind":"{}","why":{},"candidates":{})", at.decision,
                  to_string(decision.kind), json_string(decision.why), candidates_json(decision));
  if (decision.kind == Decision::Kind::drive)
    text += fmt::format(R"(,"chosen":{})", decision.chosen);
  if (!decision.notes.empty()) text += fmt::format(R"(,"notes":{})", strings(decision.notes));
  if (!decision.tree.empty()) text += fmt::format(R"(,"tree":{})", tree_json(decision.tree));
  impl_->write(text);
}

void ExplorationRecorder::finish(const ExplorationResult& result) {
  std::string text =
      fmt::format(R"("end":"{}","why":{},"converged":{},"collisions":{},"map_error":{},"notes":{})",
                  to_string(result.end), json_string(result.why), result.converged,
                  result.collisions, json_number(result.map_error), strings(result.notes));
  if (result.against) {
    text += fmt::format(R"(,"floor":{{"area":{},"seen":{},"free_wrong":{},"occupied_wrong":{}}})",
                        json_number(result.against->floor), json_number(result.against->seen),
                        json_number(result.against->free_wrong),
                        json_number(result.against->occupied_wrong));
  }
  impl_->write(text + impl_->graph.moved(result.graph) + impl_->map_member(result.map));
  if (impl_->file) impl_->file->finish();
}

}  // namespace cairn
