// SPDX-License-Identifier: BSD-3-Clause
#include "nearest_points.hpp"

#include <cstddef>
#include <cstdint>
#include <utility>

#include <nanoflann.hpp>

namespace cairn::icp {
namespace {

/// nanoflann asks for the points by these names.
struct Cloud {
  std::vector<Eigen::Vector2d> points;
  // NOLINTBEGIN(readability-identifier-naming)
  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t k, std::size_t axis) const {
    return points[k][static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
  // NOLINTEND(readability-identifier-naming)
};

/// Keeps the nearest of what nanoflann finds.
class Nearest {
 public:
  using DistanceType = double;
  using IndexType = std::uint32_t;
  explicit Nearest(double square) : square_(square) {}
  int index() const { return index_; }
  double worstDist() const { return square_; }  // NOLINT(readability-identifier-naming)
  bool full() const { return true; }
  bool addPoint(double square, std::uint32_t k) {  // NOLINT(readability-identifier-naming)
    if (square < square_) {
      square_ = square;
      index_ = static_cast<int>(k);
    }
    return true;
  }

 private:
  double square_;
  int index_ = -1;
};

#if NANOFLANN_VERSION >= 0x150
using Parameters = nanoflann::SearchParameters;
#else
using Parameters = nanoflann::SearchParams;
#endif

using KdTree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Cloud>,
                                                   Cloud, 2, std::uint32_t>;

}  // namespace

struct NearestPoints::Tree {
  Cloud cloud;
  KdTree index;

  explicit Tree(std::vector<Eigen::Vector2d> points) : cloud{std::move(points)}, index(2, cloud) {
    index.buildIndex();
  }
};

NearestPoints::NearestPoints() = default;
NearestPoints::NearestPoints(std::vector<Eigen::Vector2d> points) {
  if (!points.empty()) tree_ = std::make_unique<const Tree>(std::move(points));
}
NearestPoints::NearestPoints(NearestPoints&&) noexcept = default;
NearestPoints& NearestPoints::operator=(NearestPoints&&) noexcept = default;
NearestPoints::~NearestPoints() = default;

int NearestPoints::nearest(const Eigen::Vector2d& at, double radius) const {
  if (!tree_) return -1;
  Nearest found(radius * radius);
  tree_->index.findNeighbors(found, at.data(), Parameters());
  return found.index();
}

}  // namespace cairn::icp
