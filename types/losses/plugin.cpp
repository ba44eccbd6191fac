// SPDX-License-Identifier: BSD-3-Clause
#include <cassert>
#include <memory>
#include <string>

#include "cairn/plugin/registry.hpp"
#include "cairn/types/loss.hpp"
#include "shapes.hpp"

namespace {

using namespace cairn;

/// A shape with its scale: the loop over a batch, inlined.
template <class Shape>
class ScaledLoss final : public Loss {
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
void add(Registrar& registrar, std::string name, double default_scale) {
  registrar.add<Loss>(
      std::move(name),
      OptionTable{}.real("scale", default_scale, 1e-6, 1e6,
                         "norm of the whitened residual [sigma] where it turns robust"),
      [](const Options& options, Registry&) -> std::unique_ptr<Loss> {
        return std::make_unique<ScaledLoss<Shape>>(options.real("scale"));
      });
}

}  // namespace

void cairn_register(Registrar& registrar) {
  // Where [Zhang97] has one, the scale that is 95 % as efficient as least squares on normal noise
  // of one dimension. Residuals of more dimensions are longer: a larger scale suits them.
  add<losses::Huber>(registrar, "huber", 1.345);
  add<losses::PseudoHuber>(registrar, "pseudo_huber", 1.345);
  add<losses::Cauchy>(registrar, "cauchy", 2.3849);
  add<losses::GemanMcClure>(registrar, "geman_mcclure", 1.0);
  add<losses::Welsch>(registrar, "welsch", 2.9846);
  add<losses::Tukey>(registrar, "tukey", 4.6851);
  add<losses::DynamicCovarianceScaling>(registrar, "dcs", 1.0);
}
