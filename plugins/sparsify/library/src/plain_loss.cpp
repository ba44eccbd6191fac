// SPDX-License-Identifier: BSD-3-Clause
#include "plain_loss.hpp"

#include <algorithm>

namespace cairn {
namespace {

class PlainLoss final : public Loss {
 public:
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    if (!rho.empty()) std::ranges::copy(s, rho.begin());
    std::ranges::fill(weight, 1.0);
  }
  double second_derivative(double /*s*/) const override { return 0.0; }
};

}  // namespace

std::shared_ptr<const Loss> plain_loss() {
  static const auto loss = std::make_shared<const PlainLoss>();
  return loss;
}

}  // namespace cairn
