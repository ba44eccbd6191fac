// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "cairn/io/generator.hpp"
#include "cairn/plugin/option_fields.hpp"

namespace cairn::generate {

/// Where the cameras of a simulated bundle adjustment stand.
enum class Layout {
  ring,    ///< around a thing
  street,  ///< along a street
};
constexpr auto enum_names(Layout) {
  return std::to_array<EnumName<Layout>>({{Layout::ring, "ring"}, {Layout::street, "street"}});
}

/// Errors of initial estimates and measurements: standard deviations.
struct BundleErrors {
  double pixel = 1.0;        ///< each axis [px]
  double translation = 0.1;  ///< each axis [m]
  double rotation = 0.01;    ///< each axis [rad]
  double focal = 10.0;       ///< [px]
  double distortion = 0.01;  ///< of k1 and k2
  double point = 0.2;        ///< each axis [m]
  double scale = 1.0;        ///< factor on all of them

  static auto fields() {
    using E = BundleErrors;
    return OptionFields<E>()
        .real("pixel_sigma", &E::pixel, 1e-9, 1e6,
              "noise of what is measured, each axis [px]; BAL files can only express 1")
        .real("translation_sigma", &E::translation, 0.0, 1e6,
              "error of a camera's initial position, each axis [m]; none for the first camera")
        .real("rotation_sigma", &E::rotation, 0.0, 3.0,
              "error of its initial orientation, each axis [rad]")
        .real("focal_sigma", &E::focal, 0.0, 1e6, "error of its initial focal length [px]")
        .real("distortion_sigma", &E::distortion, 0.0, 10.0, "error of its initial k1 and k2")
        .real("point_sigma", &E::point, 0.0, 1e6,
              "error of a point's initial position, each axis [m]")
        .real("noise", &E::scale, 0.0, 1000.0,
              "factor on all noise and errors; 0: all exact, weighted as for 1");
  }
};

/// Options of the generator `bundle`.
struct BundleOptions {
  Layout layout = Layout::ring;
  int cameras = 50;
  int points = 2000;
  int track = 6;  ///< cameras that see a point, at most
  BundleErrors errors{};
  std::int64_t outliers = 0;

  static auto fields() {
    using O = BundleOptions;
    return OptionFields<O>()
        .choice("layout", &O::layout,
                "cameras around an object, or along a street: which cameras share points")
        .integer("cameras", &O::cameras, 4, 1e6, "number of cameras")
        .integer("points", &O::points, 8, 1e8, "number of points")
        .integer("track", &O::track, 2, 1e6, "cameras that see a point, at most")
        .part(&O::errors)
        .integer("outliers", &O::outliers, 0, 1e9, "observations associated with a wrong point");
  }
};

std::unique_ptr<Generator> make_bundle(const BundleOptions& world);

}  // namespace cairn::generate
