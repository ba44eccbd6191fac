// SPDX-License-Identifier: BSD-3-Clause
#include <cassert>
#include <memory>
#include <string>

#include "cairn/plugin/registry.hpp"
#include "cairn/types/loss.hpp"
#include "cairn/types/never_throws.hpp"
#include "loss_options.hpp"
#include "shapes.hpp"

namespace {

using namespace cairn;

/// A shape with its scale: the loop over a batch, inlined.
template <class Shape>
class ScaledLoss final : public Loss, public NeverThrows {
 public:
  explicit ScaledLoss(double scale) : square_(scale * scale) {}

  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    assert(rho.empty() || rho.size() == s.size());
    assert(weight.empty() || weight.size() == s.size());
    for (std::size_t k = 0; k < s.size(); ++k) {
      const losses::Value value = Shape::at(s[k], square_);
      if (!rho.empty()) rho[k] = value.rho;
      if (!weight.empty()) weight[k] = value.first;
    }
  }
  double second_derivative(double s) const override { return Shape::at(s, square_).second; }

 private:
  double square_;
};

template <class Shape>
void add(Registrar& registrar, std::string name) {
  using Chosen = losses::LossOptions<Shape>;
  registrar.add<Loss, Chosen>(std::move(name), [](const Chosen& options) {
    return std::make_unique<ScaledLoss<Shape>>(options.scale);
  });
}

}  // namespace

void cairn_register(Registrar& registrar) {
  add<losses::Huber>(registrar, "huber");
  add<losses::PseudoHuber>(registrar, "pseudo_huber");
  add<losses::Cauchy>(registrar, "cauchy");
  add<losses::GemanMcClure>(registrar, "geman_mcclure");
  add<losses::Welsch>(registrar, "welsch");
  add<losses::Tukey>(registrar, "tukey");
  add<losses::DynamicCovarianceScaling>(registrar, "dcs");
}
