// SPDX-License-Identifier: BSD-3-Clause
// Losses that are wrong: a weight that is no derivative, one that writes beyond its outputs, one
// whose factory throws, one with an option whose default is none of its choices, and one that is
// wrong with a choice that is not the default.
#include <cmath>
#include <memory>
#include <span>
#include <stdexcept>

#include "cairn/plugin/registry.hpp"
#include "cairn/types/loss.hpp"

namespace {

/// ρ(s) = ln(1 + s), with a weight of which `power` should be −1.
class Logarithm : public cairn::Loss {
 public:
  explicit Logarithm(double power) : power_(power) {}
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    for (std::size_t k = 0; k < s.size(); ++k) {
      if (!rho.empty()) rho[k] = std::log1p(s[k]);
      if (!weight.empty()) weight[k] = std::pow(1.0 + s[k], power_);
    }
  }
  double second_derivative(double s) const override { return -1.0 / ((1.0 + s) * (1.0 + s)); }

 private:
  double power_;
};

class Overrun final : public Logarithm {
 public:
  Overrun() : Logarithm(-1.0) {}
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    Logarithm::evaluate(s, rho, weight);
    if (!weight.empty()) *(weight.data() + weight.size() + 3) = 1.0;
  }
};

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  using cairn::Loss, cairn::Options, cairn::Registry;
  registrar.add<Loss>("wrong_weight", {},
                      [](const Options&, Registry&) { return std::make_unique<Logarithm>(-2.0); });
  registrar.add<Loss>("overrun", {},
                      [](const Options&, Registry&) { return std::make_unique<Overrun>(); });
  registrar.add<Loss>("unmakeable", {}, [](const Options&, Registry&) -> std::unique_ptr<Loss> {
    throw std::runtime_error("no licence was found");
  });
  registrar.add<Loss>(
      "misnamed", cairn::OptionTable{}.choice("shape", "flat", {"round", "square"}, "its shape"),
      [](const Options&, Registry&) { return std::make_unique<Logarithm>(-1.0); });
  registrar.add<Loss>(
      "wrong_choice", cairn::OptionTable{}.choice("weight", "right", {"right", "wrong"}, "which"),
      [](const Options& options, Registry&) {
        return std::make_unique<Logarithm>(options.text("weight") == "right" ? -1.0 : -2.0);
      });
}
