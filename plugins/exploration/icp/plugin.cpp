// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "icp.hpp"

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::Registration, cairn::icp::ScanMatcherOptions>("icp", cairn::icp::make_icp);
}
