// SPDX-License-Identifier: BSD-3-Clause
// A robot drives a square of four metres a side and recognises the place where it began. The first
// estimate has drifted; optimising finds the corners where the measurements say that they are.
#include <iostream>
#include <numbers>

#include <cairn/cairn.hpp>

using namespace cairn;

int main() {
  const double quarter = std::numbers::pi / 2;
  Graph graph;
  graph.add(0, Pose2(0.0, 0.0, 0.0));  // initial estimates: x y [m], heading [rad]
  graph.add(1, Pose2(4.1, 0.0, quarter));
  graph.add(2, Pose2(4.2, 4.1, 2 * quarter));
  graph.add(3, Pose2(0.1, 4.2, 3 * quarter));
  const auto information = Information::sigmas(0.1, 0.1, 0.05);  // [m, m, rad]
  for (Id k = 0; k < 4; ++k)  // each pose as seen from the one before; the last closes the loop
    graph.add(Between(k, (k + 1) % 4, Pose2(4.0, 0.0, quarter)), information);
  std::cout << optimize(graph);
  for (Id k = 0; k < 4; ++k) std::cout << k << ": " << graph.at<Pose2>(k) << "\n";
}
