// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/plugin/option_fields.hpp"

namespace cairn::losses {

/// Options of the loss of that shape (shapes.hpp).
template <class Shape>
struct LossOptions {
  double scale = Shape::kScale;  ///< norm of the whitened residual where the loss turns robust

  static auto fields() {
    return OptionFields<LossOptions>().real(
        "scale", &LossOptions::scale, 1e-50, 1e50,
        "norm of the whitened residual [sigma] where it turns robust");
  }
};

}  // namespace cairn::losses
