// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "registrations.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using cairn::Options;
  using cairn::Registration;
  using cairn::Registry;
  namespace registration = cairn::registration;

  registrar.add<Registration>(
      "recorded", registration::recorded_options(),
      [](const Options& options, Registry&) { return registration::make_recorded(options); });
  registrar.add<Registration>(
      "simulated", registration::simulated_options(),
      [](const Options& options, Registry&) { return registration::make_simulated(options); });
}
