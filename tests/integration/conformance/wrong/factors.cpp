// SPDX-License-Identifier: BSD-3-Clause
// Factors, each wrong in one way but for EDGE_WRAPPED and EDGE_RIGHT; most are on a point of the
// plane.
#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>

#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/lie/so2.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/types/define_factor.hpp"
#include "cairn/types/evaluated_factor.hpp"

namespace {

using cairn::Vector;
using Jacobian = Eigen::Matrix<double, 1, 2>;

/// The distance of a point from the origin, squared: r = x² + y² − z.
struct Square {
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<cairn::PointXY>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 2>& x, const Vector<double, 1>& z) {
    return Vector<S, 1>(x[0] * x[0] + x[1] * x[1] - z[0]);
  }
};

struct Right : Square {
  static constexpr std::string_view kTag = "EDGE_RIGHT";
};

/// Its second point is there, and nothing more.
struct Bystander {
  static constexpr std::string_view kTag = "EDGE_BYSTANDER";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<cairn::PointXY, cairn::PointXY>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 2>& x, const Vector<S, 2>&,
                               const Vector<double, 1>& z) {
    return Square::residual<S>(x, z);
  }
};

struct WrongJacobian : Square {
  static constexpr std::string_view kTag = "EDGE_WRONG_JACOBIAN";
  static Vector<double, 1> evaluate(const Vector<double, 2>& x, const Vector<double, 1>& z,
                                    Jacobian& J) {
    J << 2.0 * x[0], x[1];
    return residual<double>(x, z);
  }
};

struct NotANumber : Square {
  static constexpr std::string_view kTag = "EDGE_NAN";
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 2>& x, const Vector<double, 1>& z) {
    using std::sqrt;
    return Vector<S, 1>(sqrt(x[0] - 1.0) - z[0]);
  }
};

struct Throwing : Square {
  static constexpr std::string_view kTag = "EDGE_THROWS";
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 2>& x, const Vector<double, 1>& z) {
    if (x[0] > 0.5) throw std::domain_error("too far to the right");
    return Square::residual<S>(x, z);
  }
};

struct Aborting : Square {
  static constexpr std::string_view kTag = "EDGE_ABORTS";
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 2>& x, const Vector<double, 1>& z) {
    if (x[0] > 0.5) std::abort();
    return Square::residual<S>(x, z);
  }
};

struct Exiting : Square {
  static constexpr std::string_view kTag = "EDGE_EXITS";
  static std::string normalize(Vector<double, 1>& z) {
    if (z[0] > 1.0) std::exit(0);
    return {};
  }
};

struct Looping : Square {
  static constexpr std::string_view kTag = "EDGE_LOOPS";
  static bool propagate(int, const double* const*, const double* z, double*) {
    for (volatile double x = z[0]; x < 1e9;) x = z[0];
    return false;
  }
};

struct Remembering : Square {
  static constexpr std::string_view kTag = "EDGE_REMEMBERS";
  static Vector<double, 1> evaluate(const Vector<double, 2>& x, const Vector<double, 1>& z,
                                    Jacobian& J) {
    thread_local double last = 0.0;
    J << 2.0 * x[0], 2.0 * x[1];
    const Vector<double, 1> r = residual<double>(x, z) + Vector<double, 1>(1e-12 * last);
    last += x[0];
    return r;
  }
};

/// The direction in which a robot sees a point, whose error may be anything from −2π − 2 on.
struct Bearing {
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<cairn::Se2, cairn::PointXY>;
  template <class S>
  static S error(const Vector<S, 3>& pose, const Vector<S, 2>& point, const Vector<double, 1>& z) {
    using std::atan2;
    using std::cos;
    using std::sin;
    const S c = cos(pose[2]), s = sin(pose[2]), x = point[0] - pose[0], y = point[1] - pose[1];
    return S(atan2(c * y - s * x, c * x + s * y) - z[0]);
  }
};

struct UnwrappedBearing : Bearing {
  static constexpr std::string_view kTag = "EDGE_UNWRAPPED";
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 3>& pose, const Vector<S, 2>& point,
                               const Vector<double, 1>& z) {
    return Vector<S, 1>(error<S>(pose, point, z));
  }
};

struct WrappedBearing : Bearing {
  static constexpr std::string_view kTag = "EDGE_WRAPPED";
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 3>& pose, const Vector<S, 2>& point,
                               const Vector<double, 1>& z) {
    return Vector<S, 1>(cairn::wrap_angle<S>(error<S>(pose, point, z)));
  }
};

/// Writes one number more than the residual has.
class BeyondTheEnd final : public cairn::EvaluatedFactorType {
 public:
  std::string_view tag() const override { return "EDGE_BEYOND"; }
  int arity() const override { return 1; }
  std::span<const std::string_view> variable_tags() const override {
    static constexpr std::string_view tags[] = {cairn::PointXY::kTag};
    return tags;
  }
  int residual_size() const override { return 2; }
  int measurement_size() const override { return 2; }
  int tangent_size(int) const override { return 2; }
  int ambient_size(int) const override { return 2; }
  std::string normalize(double*) const override { return {}; }
  void evaluate(const double* const* x, const double* z, const double* U, double* r,
                double* const* J) const override {
    const double e[] = {x[0][0] - z[0], x[0][1] - z[1]};
    r[0] = U[0] * e[0] + U[1] * e[1];
    r[1] = U[2] * e[1];
    if (!J) r[2] = 0.0;
    if (!J || !J[0]) return;
    J[0][0] = U[0];
    J[0][1] = 0.0;
    J[0][2] = U[1];
    J[0][3] = U[2];
  }
  bool propagate(int, const double* const*, const double*, double*) const override { return false; }
  bool is_relative() const override { return false; }
};

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  registrar.add_types("wrong_factors", {}, [](const cairn::Options&) {
    return cairn::TypeSet{
        .variables = {},
        .factors = {cairn::define_factor<WrongJacobian>(), cairn::define_factor<NotANumber>(),
                    cairn::define_factor<Throwing>(), cairn::define_factor<Aborting>(),
                    cairn::define_factor<Exiting>(), cairn::define_factor<Looping>(),
                    cairn::define_factor<Remembering>(), std::make_shared<BeyondTheEnd>(),
                    cairn::define_factor<UnwrappedBearing>(),
                    cairn::define_factor<WrappedBearing>(), cairn::define_factor<Bystander>(),
                    cairn::define_factor<Right>()}};
  });
}
