// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <string>
#include <string_view>
#include <tuple>

#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/types/define_factor.hpp"

namespace {

using cairn::Measured;
using cairn::Vector;

/// The distance from a robot to a radio beacon: r = |l - t| - z, with t the position of the pose.
struct RangeFactor {
  static constexpr std::string_view kTag = "EDGE_RANGE_SE2_XY";
  static constexpr int kResidual = 1;
  static constexpr int kMeasurement = 1;  // measured distance [m]
  using Variables = std::tuple<cairn::Se2, cairn::PointXY>;

  template <class S>
  static Vector<S, 1> residual(const Vector<S, 3>& pose, const Vector<S, 2>& beacon,
                               const Measured<S, 1>& measured) {
    using std::sqrt;  // that of double; dual numbers bring their own
    const S dx = beacon[0] - pose[0];
    const S dy = beacon[1] - pose[1];
    return Vector<S, 1>(sqrt(dx * dx + dy * dy) - measured[0]);
  }

  static std::string normalize(Vector<double, 1>& measured) {
    return measured[0] > 0.0 ? "" : "a measured distance must be positive";
  }
};

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  registrar.add_types("range", {}, [](const cairn::Options&) {
    return cairn::TypeSet{.variables = {}, .factors = {cairn::define_factor<RangeFactor>()}};
  });
}
