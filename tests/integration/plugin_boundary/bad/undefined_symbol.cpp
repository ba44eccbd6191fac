// SPDX-License-Identifier: BSD-3-Clause
#include "plain_loss.hpp"

// Declared, called and linked nowhere, as when a library was forgotten.
void a_function_of_a_library_that_was_not_linked();

void cairn_register(cairn::Registrar& registrar) {
  a_function_of_a_library_that_was_not_linked();
  registrar.add<cairn::Loss>("unresolved", {}, make_plain_loss);
}
