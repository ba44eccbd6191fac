// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace cairn::performance {

/// KITTI's poses of a camera, rows of [R t] with x to the right, y down and z forward, as the
/// planar poses of a robot on the ground: lines `VERTEX_SE2 row x y theta`, x forward and y to the
/// left.
std::string planar_truth(const std::string& kitti);

}  // namespace cairn::performance
