// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace cairn::compact {

/// Finds the poses within a distance without looking at each. Positions move when the estimate
/// does: the tree keeps those with which it was built, and is asked for as much more as any pose
/// has moved since. So nothing is lost; when that becomes wasteful, the tree is built anew.
class PoseIndex {
 public:
  explicit PoseIndex(int dimension);  ///< 2 or 3
  ~PoseIndex();

  /// The next pose; poses count from 0.
  void add(const Eigen::Vector3d& position);
  void move(int pose, const Eigen::Vector3d& position);
  int size() const { return static_cast<int>(now_.size()); }

  /// All poses at most `radius` [m] away, by rising number; the radius may be infinite.
  std::vector<int> near(const Eigen::Vector3d& position, double radius);

 private:
  struct Tree;
  void build();

  int dimension_;
  std::vector<Eigen::Vector3d> now_;
  std::unique_ptr<Tree> tree_;  ///< of the first poses, where they were
  double drift_ = 0.0;          ///< the farthest that one of those has moved since [m]
};

}  // namespace cairn::compact
