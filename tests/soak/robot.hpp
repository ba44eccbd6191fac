// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace cairn::soak {

/// How the map of a robot that never stops stays bounded.
enum class Forgetting {
  marginalize,  ///< the oldest pose is marginalised
  remove,       ///< it is removed; now and then measurements are changed and removed as well
};

/// A robot on a round course, without end: the lines that it sends to `cairn online`. Each lap
/// meets the one before; 40 poses are kept. The same seed gives the same lines.
class Robot {
 public:
  Robot(Forgetting forgetting, std::uint64_t seed);

  /// The lines of the next pose, each of which changes the graph.
  std::vector<std::string> next_pose();

 private:
  struct Pose {
    double x, y, theta;
  };
  static Pose truth(long pose);
  std::string measured(long from, long to);
  double noise(double sigma);
  void forget(long now, std::vector<std::string>& lines);

  Forgetting forgetting_;
  std::mt19937_64 random_;
  long pose_ = 0;
  long factors_ = 0;  // so far; with `remove` the number of the next
  long closure_ = 0;  // the number of the last loop closure
};

}  // namespace cairn::soak
