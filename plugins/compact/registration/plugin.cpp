// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "registrations.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::registration;
  registrar.add<Registration, RecordedOptions>("recorded", make_recorded);
  registrar.add<Registration, SimulatedOptions>("simulated", make_simulated);
}
