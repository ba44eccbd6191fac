// SPDX-License-Identifier: BSD-3-Clause
// A factor whose residual throws, or its normalize for measurements below zero, or what makes its
// type where an option says so.
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
  static std::string normalize(Vector<double, 1>& measured) {
    if (measured[0] < 0.0) throw std::domain_error("below my range");
    return {};
  }
};

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  const auto table = cairn::OptionTable{}.boolean("sound", true, "whether the types can be made");
  registrar.add_types("brittle", table, [](const cairn::Options& options) {
    if (!options.boolean("sound")) throw std::domain_error("no types of mine");
    return cairn::TypeSet{.variables = {}, .factors = {cairn::define_factor<BrittleFactor>()}};
  });
}
