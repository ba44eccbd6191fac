// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "dogleg.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<Optimizer, DoglegOptions>("dogleg", [](const DoglegOptions& options,
                                                       Registry& registry) {
    return std::make_unique<Dogleg>(registry.make<LinearSolver>(options.linear_solver), options);
  });
}
