// SPDX-License-Identifier: BSD-3-Clause
#include "planar_truth.hpp"

#include <array>
#include <cmath>
#include <sstream>

#include <fmt/format.h>

namespace cairn::performance {

std::string planar_truth(const std::string& kitti) {
  std::istringstream numbers(kitti);
  std::string lines;
  std::array<double, 12> row{};  // [R t] row by row
  for (int id = 0;; ++id) {
    for (double& number : row) numbers >> number;
    if (!numbers) return lines;
    // R's third column is where the camera looks.
    lines +=
        fmt::format("VERTEX_SE2 {} {} {} {}\n", id, row[11], -row[3], std::atan2(-row[2], row[10]));
  }
}

}  // namespace cairn::performance
