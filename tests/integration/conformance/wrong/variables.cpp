// SPDX-License-Identifier: BSD-3-Clause
// Variables that break one law each.
#include <string_view>

#include "cairn/lie/se2.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/types/define_variable.hpp"

namespace {

using cairn::Se2;
using cairn::Vector;

struct WrongAdjoint : Se2 {
  static constexpr std::string_view kTag = "VERTEX_WRONG_ADJOINT";
  static Eigen::Matrix3d adjoint(const Vector<double, 3>& a) {
    Eigen::Matrix3d Ad = Se2::adjoint(a);
    Ad(0, 2) = -Ad(0, 2);
    return Ad;
  }
};

/// Steps in the world's frame, but `local` is that of the body's.
struct WrongLocal : Se2 {
  static constexpr std::string_view kTag = "VERTEX_WRONG_LOCAL";
  template <class S>
  static Vector<S, 3> retract(const Vector<S, 3>& x, const Vector<S, 3>& delta) {
    return {x[0] + delta[0], x[1] + delta[1], cairn::wrap_angle<S>(x[2] + delta[2])};
  }
};

/// Turns a little each time it is normalized.
struct Drifting : Se2 {
  static constexpr std::string_view kTag = "VERTEX_DRIFTS";
  static std::string normalize(Vector<double, 3>& x) {
    x[2] = cairn::wrap_angle(x[2] + 1e-6);
    return {};
  }
};

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  registrar.add_types("wrong_variables", {}, [](const cairn::Options&) {
    return cairn::TypeSet{
        .variables = {cairn::define_variable<WrongAdjoint>(), cairn::define_variable<WrongLocal>(),
                      cairn::define_variable<Drifting>()},
        .factors = {}};
  });
}
