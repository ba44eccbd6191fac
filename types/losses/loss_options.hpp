// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/plugin/options.hpp"

namespace cairn::losses {

/// Options of the loss of that shape (shapes.hpp): its scale, the norm of the whitened residual
/// where the loss turns robust.
template <class Shape>
OptionTable loss_options() {
  return OptionTable{}.real(
      "scale", Shape::kScale, 1e-50, 1e50,
      Shape::kGrows
          ? "norm of the whitened residual [sigma] where it turns robust; the default, of "
            "one number, grows with the 95 % quantile of chi-square for more"
          : "norm of the whitened residual [sigma] where it turns robust");
}

}  // namespace cairn::losses
