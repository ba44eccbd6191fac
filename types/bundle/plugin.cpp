// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "cairn/types/domain.hpp"
#include "camera.hpp"
#include "reprojection.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add_types("bundle", OptionTable{}, [](const Options&) {
    return TypeSet{.variables = {define_variable<bundle::Camera>()},
                   .factors = {define_factor_with_domain<bundle::Reprojection>()}};
  });
}
