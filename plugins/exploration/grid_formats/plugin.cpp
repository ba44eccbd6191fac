// SPDX-License-Identifier: BSD-3-Clause
#include <memory>

#include "cairn/plugin/registry.hpp"
#include "image_format.hpp"
#include "ros_format.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn::grids;
  registrar.add<cairn::GridFormat, RosOptions>(
      "ros", [](const RosOptions& options) { return std::make_unique<RosFormat>(options); });
  registrar.add<cairn::GridFormat, ImageOptions>(
      "image", [](const ImageOptions& options) { return std::make_unique<ImageFormat>(options); });
}
