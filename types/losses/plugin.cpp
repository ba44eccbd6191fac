// SPDX-License-Identifier: BSD-3-Clause
#include <cassert>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "cairn/plugin/registry.hpp"
#include "cairn/types/loss.hpp"
#include "cairn/types/loss_by_size.hpp"
#include "cairn/types/never_throws.hpp"
#include "loss_options.hpp"
#include "scale_of_size.hpp"
#include "shapes.hpp"

namespace {

using namespace cairn;

/// A shape with its scale: the loop over a batch, inlined.
template <class Shape>
class ScaledLoss : public Loss, public NeverThrows {
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

/// A shape whose scale follows from the size of the residual; by itself it is that of one number.
template <class Shape>
class LossOfAnySize final : public ScaledLoss<Shape>, public LossBySize {
 public:
  LossOfAnySize() : ScaledLoss<Shape>(Shape::kScale) {}

  void* ability(std::string_view name) override {
    return name == kAbility ? static_cast<LossBySize*>(this) : nullptr;
  }
  std::shared_ptr<const Loss> for_size(int size) const override {
    const std::lock_guard lock(mutex_);
    std::shared_ptr<const Loss>& made = made_[size];
    if (!made)
      made = std::make_shared<ScaledLoss<Shape>>(losses::scale_of_size(Shape::kScale, size));
    return made;
  }

 private:
  mutable std::mutex mutex_;
  mutable std::map<int, std::shared_ptr<const Loss>> made_;
};

template <class Shape>
std::unique_ptr<Loss> make(const Options& options) {
  if (Shape::kGrows && !options.given("scale")) return std::make_unique<LossOfAnySize<Shape>>();
  return std::make_unique<ScaledLoss<Shape>>(options.real("scale"));
}

template <class Shape>
void add(Registrar& registrar, std::string name) {
  registrar.add<Loss>(std::move(name), losses::loss_options<Shape>(),
                      [](const Options& options, Registry&) { return make<Shape>(options); });
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
