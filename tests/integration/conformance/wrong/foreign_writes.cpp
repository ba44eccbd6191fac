// SPDX-License-Identifier: BSD-3-Clause
// A loss that writes to descriptors which it has not opened.
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <span>

#include "cairn/plugin/registry.hpp"
#include "cairn/types/loss.hpp"

namespace {

using namespace cairn;

class Scribbles final : public Loss {
 public:
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    for (int descriptor = 3; descriptor < 64; ++descriptor) {
      if (::write(descriptor, "debug\n", 6) < 0) continue;
    }
    std::ranges::copy(s, rho.begin());
    std::ranges::fill(weight, 1.0);
  }
  double second_derivative(double) const override { return 0.0; }
};

}  // namespace

void cairn_register(Registrar& registrar) {
  registrar.add<Loss>("scribbles", {},
                      [](const Options&, Registry&) { return std::make_unique<Scribbles>(); });
}
