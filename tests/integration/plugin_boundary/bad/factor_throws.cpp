// SPDX-License-Identifier: BSD-3-Clause
// A factor whose residual throws.
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>

#include "cairn/lie/se2.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/types/define_factor.hpp"

namespace {

using cairn::Vector;

struct BrittleFactor {
  static constexpr std::string_view kTag = "EDGE_BRITTLE";
  static constexpr int kResidual = 1;
  static constexpr int kMeasurement = 1;
  using Variables = std::tuple<cairn::Se2>;

  template <class S>
  static Vector<S, 1> residual(const Vector<S, 3>& pose, const Vector<double, 1>& measured) {
    if (measured[0] > 1.0) throw std::domain_error("the measurement is out of my range");
    return Vector<S, 1>(pose[0] - measured[0]);
  }
  static std::string normalize(Vector<double, 1>&) { return {}; }
};

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  registrar.add_types("brittle", {}, [](const cairn::Options&) {
    return cairn::TypeSet{.variables = {}, .factors = {cairn::define_factor<BrittleFactor>()}};
  });
}
