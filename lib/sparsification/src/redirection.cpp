// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/redirection.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>

#include <Eigen/Core>

#include "cairn/geometry/motion.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/geometry/state_group.hpp"

namespace cairn {
namespace {

struct Point {
  int variable;
  Eigen::Vector3d t;  ///< what is near is near in these
};

/// The point nearest to t; -1: there is none.
int nearest(const std::vector<Point>& points, const Eigen::Vector3d& t) {
  int best = -1;
  double least = std::numeric_limits<double>::infinity();
  for (const Point& point : points) {
    double squares = 0.0;
    for (int k = 0; k < 3; ++k) squares += (point.t[k] - t[k]) * (point.t[k] - t[k]);
    if (squares < least) {
      least = squares;
      best = point.variable;
    }
  }
  return best;
}

}  // namespace

void Redirection::leave(const Graph& graph, std::span<const int> nodes, std::span<const int> also) {
  std::vector<bool> leaving(graph.variable_count());
  for (const int v : nodes) leaving[v] = true;
  for (const int v : also) leaving[v] = true;
  const auto where = [&](const VariableType& type, Id id, std::span<const double> x) {
    if (nearest_ == Nearest::order) return Eigen::Vector3d(static_cast<double>(id), 0.0, 0.0);
    return has_position(type) ? position(type, x) : Eigen::Vector3d(0.0, 0.0, 0.0);
  };
  std::unordered_map<std::string_view, std::vector<Point>> points;
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (!leaving[v] && graph.type(v).lie_group())
      points[graph.type(v).tag()].push_back({v, where(graph.type(v), graph.id(v), graph.state(v))});
  }
  const auto move = [&](Id id, std::shared_ptr<const VariableType> type,
                        std::span<const double> x) {
    Place place{.type = std::move(type), .motion = {}};
    const int to = nearest(points[place.type->tag()], where(*place.type, id, x));
    place.lost = to < 0;
    if (!place.lost) {
      place.anchor = graph.id(to);
      place.motion = StateGroup(*place.type).between(graph.state(to), x);
    }
    at_.insert_or_assign(id, std::move(place));
  };
  std::vector<Id> follow;
  for (const auto& [id, place] : at_) {
    const auto anchor = graph.find(place.anchor);
    if (!place.lost && anchor && leaving[*anchor]) follow.push_back(id);
  }
  for (const Id id : follow) {
    const Place place = at_.at(id);
    move(id, place.type, state(id, graph.state(graph.find(place.anchor).value())));
  }
  for (const int v : nodes) {
    if (graph.type(v).lie_group()) move(graph.id(v), graph.type_of(v), graph.state(v));
  }
}

std::vector<double> Redirection::state(Id node, std::span<const double> anchor) const {
  const Place& place = at_.at(node);
  return StateGroup(*place.type).compose(anchor, place.motion);
}

std::optional<Factor> Redirection::redirect(const Factor& factor) const {
  if (std::ranges::none_of(factor.variables, [&](Id id) { return has(id); })) return factor;
  if (factor.variables.size() != 2 || !factor.type->is_relative()) return std::nullopt;
  std::vector<Id> ends = factor.variables;
  const Place& any = at_.at(has(ends[0]) ? ends[0] : ends[1]);
  const MotionGroup motions(any.type);
  const auto n = static_cast<std::size_t>(motions.tangent_size());
  Motion z = motions.of_factor(*factor.type, factor.measurement, factor.information);
  for (int end = 0; end < 2; ++end) {
    if (!has(ends[end])) continue;
    const Place& place = at_.at(ends[end]);
    if (place.lost) return std::nullopt;
    const Motion from_anchor{place.motion, std::vector<double>(n * n, 0.0)};
    z = end == 0 ? motions.compose(from_anchor, z)
                 : motions.compose(z, motions.inverse(from_anchor));
    ends[end] = place.anchor;
  }
  if (ends[0] == ends[1]) return std::nullopt;
  return motions.to_factor(factor.type, ends[0], ends[1], z);
}

}  // namespace cairn
