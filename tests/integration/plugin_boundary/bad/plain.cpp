// SPDX-License-Identifier: BSD-3-Clause
#include "plain_loss.hpp"

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::Loss>("plain", {}, make_plain_loss);
}
