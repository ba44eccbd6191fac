// SPDX-License-Identifier: BSD-3-Clause
#include "pose_index.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <nanoflann.hpp>

namespace cairn::compact {
namespace {

/// So many are looked at one by one before a tree repays itself.
constexpr int kFew = 64;
/// The tree is built anew when its poses have moved by this part of a radius.
constexpr double kMostDrift = 0.25;

/// nanoflann asks for the points by these names.
struct Cloud {
  std::vector<Eigen::Vector3d> points;
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

/// Takes what nanoflann finds.
class Found {
 public:
  using DistanceType = double;
  using IndexType = std::uint32_t;
  Found(double square, std::vector<int>& out) : square_(square), out_(out) {}
  double worstDist() const { return square_; }  // NOLINT(readability-identifier-naming)
  bool full() const { return true; }
  bool addPoint(double square, std::uint32_t k) {  // NOLINT(readability-identifier-naming)
    if (square <= square_) out_.push_back(static_cast<int>(k));
    return true;
  }

 private:
  double square_;
  std::vector<int>& out_;
};

#if NANOFLANN_VERSION >= 0x150
using Parameters = nanoflann::SearchParameters;
#else
using Parameters = nanoflann::SearchParams;
#endif

template <int kDimension>
using KdTree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Cloud>,
                                                   Cloud, kDimension, std::uint32_t>;

}  // namespace

struct PoseIndex::Tree {
  Cloud cloud;
  std::unique_ptr<KdTree<2>> plane;
  std::unique_ptr<KdTree<3>> space;

  Tree(int dimension, std::vector<Eigen::Vector3d> points) : cloud{std::move(points)} {
    if (dimension == 2) {
      plane = std::make_unique<KdTree<2>>(2, cloud);
      plane->buildIndex();
    } else {
      space = std::make_unique<KdTree<3>>(3, cloud);
      space->buildIndex();
    }
  }
  int size() const { return static_cast<int>(cloud.points.size()); }
  void find(const Eigen::Vector3d& position, double radius, std::vector<int>& out) const {
    // nanoflann takes only what is nearer than the radius.
    Found found(std::nextafter(radius * radius, std::numeric_limits<double>::infinity()), out);
    if (plane) plane->findNeighbors(found, position.data(), Parameters());
    if (space) space->findNeighbors(found, position.data(), Parameters());
  }
};

PoseIndex::PoseIndex(int dimension) : dimension_(dimension) {}
PoseIndex::~PoseIndex() = default;

void PoseIndex::add(const Eigen::Vector3d& position) { now_.push_back(position); }

void PoseIndex::move(int pose, const Eigen::Vector3d& position) {
  now_[pose] = position;
  if (tree_ && pose < tree_->size())
    drift_ = std::max(drift_, (position - tree_->cloud.points[pose]).norm());
}

void PoseIndex::build() {
  tree_ = std::make_unique<Tree>(dimension_, now_);
  drift_ = 0.0;
}

std::vector<int> PoseIndex::near(const Eigen::Vector3d& position, double radius) {
  std::vector<int> found;
  int begin = 0;  // from here on poses are looked at one by one
  if (std::isfinite(radius) && size() > kFew) {
    const int newer = tree_ ? size() - tree_->size() : size();
    if (!tree_ || newer > kFew + size() / 8 || drift_ > kMostDrift * radius) build();
    // Rounding must not lose a pose that is just as far as the radius.
    tree_->find(position, (radius + drift_) * (1.0 + 1e-9), found);
    begin = tree_->size();
  }
  for (int k = begin; k < size(); ++k) found.push_back(k);
  if (std::isfinite(radius))
    std::erase_if(found, [&](int k) { return !((now_[k] - position).norm() <= radius); });
  std::ranges::sort(found);
  return found;
}

}  // namespace cairn::compact
