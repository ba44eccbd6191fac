// SPDX-License-Identifier: BSD-3-Clause
// Simulates a graph along KITTI's poses of a camera, for the studies of `cairn compact`.
//
//   cairn_camera_world POSES TRUTH MEASUREMENTS      prints {"poses": lines of the truth}
#include <algorithm>
#include <fstream>
#include <sstream>
#include <string>

#include <fmt/core.h>

#include "camera_world.hpp"

int main(int argc, char** argv) {
  if (argc != 4) {
    fmt::print(stderr, "cairn_camera_world POSES TRUTH MEASUREMENTS\n");
    return 2;
  }
  std::ifstream in(argv[1], std::ios::binary);
  std::ostringstream poses;
  poses << in.rdbuf();
  const auto world = cairn::performance::camera_world(poses.str(), {});
  std::ofstream truth(argv[2], std::ios::binary), measurements(argv[3], std::ios::binary);
  truth << world.truth;
  measurements << world.measurements;
  if (!in || !truth.flush() || !measurements.flush()) {
    fmt::print(stderr, "cannot read {} or write {} and {}\n", argv[1], argv[2], argv[3]);
    return 1;
  }
  fmt::print("{{\"poses\": {}}}\n", std::ranges::count(world.truth, '\n'));
}
