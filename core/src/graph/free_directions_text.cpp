// SPDX-License-Identifier: BSD-3-Clause
// What is free, in words.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "cairn/graph/free_directions.hpp"

namespace cairn {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// So many variables, and groups of them, are named.
constexpr std::size_t kNamed = 3;
/// Directions that agree to this are the same: what differences leave.
constexpr double kSame = 1e-4;
/// Of differences, in the units of the states.
constexpr double kStep = 1e-6;

/// Where a variable is; in the plane z and the rotations out of it are zero.
struct Place {
  Vector3d t = Vector3d::Zero();
  Matrix3d R = Matrix3d::Identity();
};

std::optional<Place> place_of(const VariableType& type, const double* x) {
  const Placement* placement = type.placement();
  if (!placement) return std::nullopt;
  const int n = placement->dimension();
  std::vector<double> R(static_cast<std::size_t>(n) * n), t(static_cast<std::size_t>(n));
  placement->split(x, R.data(), t.data());
  Place place;
  for (int k = 0; k < n; ++k) place.t[k] = t[static_cast<std::size_t>(k)];
  if (!placement->has_orientation()) return place;
  // Row- or column-major: the same turn, or its inverse, as long as all are read alike.
  for (int r = 0; r < n; ++r)
    for (int c = 0; c < n; ++c) place.R(r, c) = R[static_cast<std::size_t>(c) * n + r];
  return place;
}

bool is_pose(const VariableType& type) {
  return type.placement() && type.placement()->has_orientation();
}
bool is_point(const VariableType& type) {
  return type.placement() && !type.placement()->has_orientation();
}

/// How a variable's place moves in the world: by how much, and about which axis.
struct Motion {
  Vector3d shift = Vector3d::Zero(), turn = Vector3d::Zero();
};

std::optional<Motion> motion_of(const Graph& graph, const FreeMove& move) {
  const VariableType& type = graph.type(move.variable);
  const std::span<const double> x = graph.state(move.variable);
  const std::optional<Place> before = place_of(type, x.data());
  if (!before) return std::nullopt;
  double length = 0.0;
  for (const double d : move.delta) length = std::max(length, std::abs(d));
  const double step = kStep * std::max(1.0, before->t.cwiseAbs().maxCoeff()) / length;
  // Central differences.
  Place ends[2];
  for (int side = 0; side < 2; ++side) {
    std::vector<double> delta, moved(x.size());
    for (const double d : move.delta) delta.push_back((side ? step : -step) * d);
    const std::int64_t offset = 0;
    type.retract(1, x.data(), &offset, delta.data(), moved.data());
    ends[side] = *place_of(type, moved.data());
  }
  Motion motion;
  motion.shift = (ends[1].t - ends[0].t) / (2.0 * step);
  if (is_pose(type)) {
    const Eigen::AngleAxisd turn(Matrix3d(ends[1].R * ends[0].R.transpose()));
    motion.turn = turn.angle() / (2.0 * step) * turn.axis();
  }
  return motion;
}

std::string id_of(const Graph& graph, int variable) {
  const std::string name = graph.describe_variable(variable);
  return name.substr(name.rfind(' ') + 1);
}

/// "pose 7", or with its tag what is none, or more than that.
std::string name_of(const Graph& graph, int variable) {
  const VariableType& type = graph.type(variable);
  if (is_pose(type) && type.lie_group()) return "pose " + id_of(graph, variable);
  return graph.describe_variable(variable);
}

/// "(0.6, 0.8)", with the larger part of it positive.
std::string direction_text(Vector3d u, int dimension) {
  Eigen::Index largest = 0;
  u.normalize();
  u.cwiseAbs().maxCoeff(&largest);
  if (u[largest] < 0.0) u = -u;
  std::vector<std::string> numbers;
  for (int k = 0; k < dimension; ++k) {
    const std::string number = fmt::format("{:.4g}", std::abs(u[k]) < kSame ? 0.0 : u[k]);
    numbers.push_back(number);
  }
  return fmt::format("({})", fmt::join(numbers, ", "));
}

bool parallel(const Vector3d& a, const Vector3d& b) {
  return a.cross(b).norm() <= kSame * a.norm() * b.norm();
}

/// Another variable of one of its factors that lies, seen from this one, along u.
std::optional<int> seen_along(const Graph& graph, int variable, const Vector3d& u) {
  const Place at = *place_of(graph.type(variable), graph.state(variable).data());
  for (const int f : graph.factors_of(variable)) {
    for (const std::int32_t other : graph.factor_variables(f)) {
      if (other == variable) continue;
      const auto there = place_of(graph.type(other), graph.state(other).data());
      if (there && (there->t - at.t).norm() > 0.0 && parallel(there->t - at.t, u)) return other;
    }
  }
  return std::nullopt;
}

// One variable --------------------------------------------------------------------------------

std::string free_point(const Graph& graph, int variable, std::span<const Motion> motions) {
  const int n = graph.type(variable).placement()->dimension();
  const Vector3d u = motions[0].shift;
  if (motions.size() == 1) {
    if (const auto from = seen_along(graph, variable, u))
      return "along its bearing from " + name_of(graph, *from);
    if (n == 2) {
      if (const auto from = seen_along(graph, variable, {-u[1], u[0], 0.0}))
        return "across its bearing from " + name_of(graph, *from);
    }
    return "along " + direction_text(u, n);
  }
  const Vector3d normal = u.cross(motions[1].shift);  // two of three directions
  if (const auto from = seen_along(graph, variable, normal))
    return "across its bearing from " + name_of(graph, *from);
  return "across " + direction_text(normal, n);
}

std::string free_pose(const Graph& graph, int variable, std::span<const Motion> motions) {
  const int n = graph.type(variable).placement()->dimension();
  const bool turns = std::ranges::any_of(
      motions, [](const Motion& m) { return m.turn.norm() > kSame * m.shift.norm(); });
  const bool shifts = std::ranges::any_of(
      motions, [](const Motion& m) { return m.shift.norm() > kSame * m.turn.norm(); });
  if (motions.size() == 1 && !turns) return "along " + direction_text(motions[0].shift, n);
  if (motions.size() == 1 && !shifts)
    return n == 2 ? "to turn" : "to turn about " + direction_text(motions[0].turn, n);
  if (!turns && std::ssize(motions) == n) return "to shift";
  if (!shifts && motions.size() == 3) return "to turn";
  if (motions.size() == 1 && n == 2) {  // about what does not move
    const Vector3d shift = motions[0].shift / motions[0].turn[2];
    const Vector3d centre = place_of(graph.type(variable), graph.state(variable).data())->t +
                            Vector3d(-shift[1], shift[0], 0.0);
    for (const int f : graph.factors_of(variable)) {
      for (const std::int32_t other : graph.factor_variables(f)) {
        const auto there = place_of(graph.type(other), graph.state(other).data());
        if (other != variable && there && (there->t - centre).norm() <= kSame * shift.norm())
          return "to turn about " + name_of(graph, other);
      }
    }
    return fmt::format("to turn about ({:.4g}, {:.4g})", centre[0], centre[1]);
  }
  return {};
}

/// "along its bearing from pose 7", after "is free".
std::string free_variable(const Graph& graph, int variable,
                          std::span<const FreeMove* const> moves) {
  const VariableType& type = graph.type(variable);
  const auto n = static_cast<std::size_t>(type.tangent_size());
  if (moves.size() >= n) return n == 1 ? "" : fmt::format("in all of its {} directions", n);
  std::vector<Motion> motions;
  for (const FreeMove* move : moves) {
    if (const std::optional<Motion> motion = motion_of(graph, *move)) motions.push_back(*motion);
  }
  std::string text;
  if (motions.size() == moves.size()) {
    const int dimension = type.placement()->dimension();
    if (is_point(type) && type.tangent_size() == dimension)
      text = free_point(graph, variable, motions);
    if (is_pose(type) && type.tangent_size() == (dimension == 2 ? 3 : 6))
      text = free_pose(graph, variable, motions);
  }
  if (!text.empty()) return text;
  if (moves.size() > 1) return fmt::format("in {} of its {} directions", moves.size(), n);
  const Eigen::Map<const Eigen::VectorXd> delta(moves[0]->delta.data(),
                                                std::ssize(moves[0]->delta));
  Eigen::Index largest = 0;
  delta.cwiseAbs().maxCoeff(&largest);
  if (std::abs(delta[largest]) >= (1.0 - kSame) * delta.norm())
    return fmt::format("in number {} of its {} directions", largest + 1, n);
  return fmt::format("in one of its {} directions", n);
}

// Several together ----------------------------------------------------------------------------

/// The directions of variables that only move together.
struct Together {
  std::vector<const FreeDirection*> directions;
  std::set<int> variables;
};

std::string counted(std::size_t count, const char* one, const char* many) {
  return fmt::format("{} {}", count, count == 1 ? one : many);
}

/// "the 40 poses", "30 poses and 2 points".
std::string count_text(const Graph& graph, const std::set<int>& variables) {
  std::size_t poses = 0, points = 0;
  for (const int v : variables) {
    poses += is_pose(graph.type(v));
    points += is_point(graph.type(v));
  }
  const std::size_t others = variables.size() - poses - points;
  std::vector<std::string> parts;
  if (poses > 0) parts.push_back(counted(poses, "pose", "poses"));
  if (points > 0) parts.push_back(counted(points, "point", "points"));
  if (others > 0) parts.push_back(counted(others, "other variable", "other variables"));
  if (parts.size() == 3) return parts[0] + ", " + parts[1] + " and " + parts[2];
  return fmt::format("{}", fmt::join(parts, " and "));
}

/// The variables that do not move with these and share a factor that measures anything with them.
std::set<int> neighbours(const Graph& graph, const std::set<int>& variables) {
  std::set<int> found;
  for (int f = 0; f < graph.factor_count(); ++f) {
    if (graph.information_rank(f) == 0) continue;
    const auto on = graph.factor_variables(f);
    if (std::ranges::none_of(on, [&](int v) { return variables.contains(v); })) continue;
    for (const int v : on)
      if (!variables.contains(v)) found.insert(v);
  }
  return found;
}

/// Whether a direction turns all about that point: shift = turn × (t − centre).
bool turns_about(const Graph& graph, const FreeDirection& direction, const Vector3d& centre) {
  std::optional<Vector3d> turn;
  double error = 0.0, size = 0.0;
  for (const FreeMove& move : direction.moves) {
    const std::optional<Motion> motion = motion_of(graph, move);
    if (!motion) return false;
    if (!is_pose(graph.type(move.variable))) continue;
    if (!turn) turn = motion->turn;
    if ((motion->turn - *turn).norm() > kSame * turn->norm()) return false;
  }
  if (!turn || turn->norm() == 0.0) return false;
  for (const FreeMove& move : direction.moves) {
    const Vector3d arm =
        place_of(graph.type(move.variable), graph.state(move.variable).data())->t - centre;
    error = std::max(error, (motion_of(graph, move)->shift - turn->cross(arm)).norm());
    size = std::max(size, turn->norm() * (1.0 + arm.norm()));
  }
  return error <= kSame * size;
}

bool shifts(const Graph& graph, const FreeDirection& direction) {
  std::optional<Vector3d> shift;
  for (const FreeMove& move : direction.moves) {
    const std::optional<Motion> motion = motion_of(graph, move);
    if (!motion) return false;
    if (!shift) shift = motion->shift;
    if (motion->turn.norm() > kSame * shift->norm() ||
        (motion->shift - *shift).norm() > kSame * shift->norm())
      return false;
  }
  return shift && shift->norm() > 0.0;
}

/// What a direction turns all about: a point of the plane, or a line in space, by its point that is
/// nearest to the first pose.
struct Axis {
  Vector3d point, along;
};

std::optional<Axis> axis_of_turn(const Graph& graph, const FreeDirection& direction) {
  for (const FreeMove& move : direction.moves) {
    const VariableType& type = graph.type(move.variable);
    if (!is_pose(type)) continue;
    const Motion motion = *motion_of(graph, move);
    const double square = motion.turn.squaredNorm();
    if (!(square > 0.0)) return std::nullopt;
    const Vector3d at = place_of(type, graph.state(move.variable).data())->t;
    const Axis axis{at + motion.turn.cross(motion.shift) / square, motion.turn};
    return turns_about(graph, direction, axis.point) ? std::optional(axis) : std::nullopt;
  }
  return std::nullopt;
}

/// "can turn about pose 0", "can turn about the line through (1, 2, 0) along (1, 0, 0)".
std::string turn_text(const Graph& graph, const Axis& axis, const std::set<int>& variables) {
  const bool planar = graph.type(*variables.begin()).placement()->dimension() == 2;
  std::string through;
  for (const int v : variables) {
    const auto there = place_of(graph.type(v), graph.state(v).data());
    if (!there) continue;
    const Vector3d arm = there->t - axis.point;
    const Vector3d off = planar ? arm : Vector3d(axis.along.normalized().cross(arm));
    if (off.norm() > kSame * (1.0 + axis.point.norm())) continue;
    through = name_of(graph, v);
    break;
  }
  const Vector3d& p = axis.point;
  if (through.empty()) {
    through = planar ? fmt::format("({:.4g}, {:.4g})", p[0], p[1])
                     : fmt::format("({:.4g}, {:.4g}, {:.4g})", p[0], p[1], p[2]);
  }
  if (planar) return "can turn about " + through;
  return fmt::format("can turn about the line through {} along {}", through,
                     direction_text(axis.along, 3));
}

std::string group_name(const Graph& graph, const std::set<int>& variables,
                       std::optional<int> hinge) {
  const std::string count = count_text(graph, variables);
  if (hinge) {
    const bool after = std::ranges::all_of(variables, [&](int v) {
      return !is_pose(graph.type(v)) || graph.id(v) > graph.id(*hinge);
    });
    const std::string id =
        is_pose(graph.type(*hinge)) ? id_of(graph, *hinge) : graph.describe_variable(*hinge);
    return fmt::format("the {} {} {}", count, after ? "after" : "beyond", id);
  }
  const std::string first = graph.describe_variable(*variables.begin());
  if (std::ssize(variables) == graph.variable_count()) return fmt::format("all {}", count);
  return fmt::format("{} (the first is {})", count, first);
}

std::string group_text(const Graph& graph, const Together& together) {
  const std::set<int> around = neighbours(graph, together.variables);
  const std::optional<int> hinge = around.size() == 1 && graph.type(*around.begin()).placement()
                                       ? std::optional(*around.begin())
                                       : std::nullopt;
  const std::string who = group_name(graph, together.variables, hinge);
  const auto all = [&](const auto& holds) {
    return std::ranges::all_of(together.directions,
                               [&](const FreeDirection* d) { return holds(*d); });
  };
  std::string what;
  if (hinge) {
    const Vector3d centre = place_of(graph.type(*hinge), graph.state(*hinge).data())->t;
    if (all([&](const FreeDirection& d) { return turns_about(graph, d, centre); }))
      what = "can turn about it";
  }
  if (what.empty() && all([&](const FreeDirection& d) { return shifts(graph, d); }))
    what = "can shift";
  if (what.empty() && together.directions.size() == 1) {
    if (const auto axis = axis_of_turn(graph, *together.directions.front())) {
      std::set<int> all_there = around;
      all_there.insert(together.variables.begin(), together.variables.end());
      what = turn_text(graph, *axis, all_there);
    }
  }
  if (what.empty()) {
    what = together.directions.size() == 1
               ? "can move together in one direction"
               : fmt::format("can move together in {} directions", together.directions.size());
  }
  return fmt::format("{} {}; a prior or one more measurement holds them", who, what);
}

/// Directions that move more than one variable, those together that have some in common.
std::vector<Together> groups(std::span<const FreeDirection> directions) {
  std::vector<Together> all;
  for (const FreeDirection& direction : directions) {
    if (direction.moves.size() < 2) continue;
    Together joined{{&direction}, {}};
    for (const FreeMove& move : direction.moves) joined.variables.insert(move.variable);
    std::erase_if(all, [&](Together& other) {
      const bool common =
          std::ranges::any_of(other.variables, [&](int v) { return joined.variables.contains(v); });
      if (!common) return false;
      joined.directions.insert(joined.directions.begin(), other.directions.begin(),
                               other.directions.end());
      joined.variables.merge(other.variables);
      return true;
    });
    all.push_back(std::move(joined));
  }
  return all;
}

}  // namespace

std::string FreeDirections::describe(const Graph& graph, bool estimated) const {
  std::map<int, std::vector<const FreeMove*>> single;
  for (const FreeDirection& direction : directions) {
    if (direction.moves.size() == 1)
      single[direction.moves[0].variable].push_back(&direction.moves[0]);
  }
  std::vector<std::string> sentences, names;
  for (const auto& [variable, moves] : single) {
    if (names.size() == kNamed) break;
    const std::string how = free_variable(graph, variable, moves);
    names.push_back(graph.describe_variable(variable) + " is free" +
                    (how.empty() ? "" : " " + how));
  }
  if (!names.empty()) {
    std::string text = fmt::format("{}", fmt::join(names, ", "));
    if (single.size() > names.size()) {
      text += fmt::format(", and so {} in part or wholly",
                          single.size() - names.size() == 1
                              ? "is one more variable"
                              : fmt::format("are {} more variables", single.size() - names.size()));
    }
    if (estimated) text += single.size() == 1 ? "; it stays" : "; they stay";
    if (estimated) text += " at the initial estimate";
    sentences.push_back(std::move(text));
  }
  const std::vector<Together> together = groups(directions);
  for (std::size_t k = 0; k < std::min(together.size(), kNamed); ++k)
    sentences.push_back(group_text(graph, together[k]));
  if (together.size() > kNamed) {
    sentences.push_back(
        fmt::format("{} more groups of variables can move", together.size() - kNamed));
  }
  return fmt::format("{}", fmt::join(sentences, "; "));
}

}  // namespace cairn
