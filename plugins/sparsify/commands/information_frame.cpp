// SPDX-License-Identifier: BSD-3-Clause
#include "information_frame.hpp"

#include <vector>

#include <fmt/core.h>
#include <Eigen/Geometry>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::app {

void information_of_first_frame(Graph& graph) {
  for (int f = 0; f < graph.factor_count(); ++f) {
    const FactorType& type = *graph.type_of_factor(f);
    if (graph.factor_variables(f).size() != 2 || !type.is_relative()) continue;
    if (type.tag() != "EDGE_SE2") {
      throw Error(
          ErrorCode::usage,
          fmt::format("--information-frame first is for graphs in the plane, whose relative "
                      "factors are EDGE_SE2, and not for {}: leave it out",
                      graph.describe_factor(f)));
    }
    const auto z = graph.measurement(f);
    const std::vector<double> measured(z.begin(), z.end());
    Eigen::Matrix3d turned = Eigen::Matrix3d::Identity();
    turned.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(measured[2]).toRotationMatrix();
    const Eigen::Matrix3d given = unpack<3>(graph.information(f).data());
    graph.set_measurement(f, measured, pack(turned.transpose() * given * turned));
  }
}

}  // namespace cairn::app
