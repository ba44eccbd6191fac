// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <tuple>

#include "cairn/runtime/api.hpp"
#include "cairn/types/define_factor.hpp"

namespace cairn {

/// What a factor type also is whose residual has a meaning at some states only, though it is a
/// number at all: a camera sees nothing that lies behind it. An estimate outside of that is no
/// solution, however small its chi2. Ask with `dynamic_cast<const Domain*>(&type)`.
class CAIRN_API Domain {
 public:
  virtual ~Domain();
  /// Why the residual has no meaning at the states x, one of each variable in order, such as "the
  /// point is behind the camera"; empty where it has.
  virtual std::string outside(const double* const* x) const = 0;
  /// How far the variables are from each other, such as a point from the camera; negative where the
  /// residual has no meaning.
  virtual double reach(const double* const* x) const = 0;
  /// The state of variable `target`, given the others, that is so far from them and has nearly no
  /// residual, inside the domain. False if the measurement does not determine it.
  virtual bool place(int target, const double* const* x, const double* measurement, double reach,
                     double* out) const = 0;
};

/// `define_factor` for a struct that also has, all static, what a `Domain` has.
template <FactorTraits F>
std::shared_ptr<const FactorType> define_factor_with_domain() {
  class Type final : public FactorType,
                     public Domain,
                     public std::conditional_t<detail::never_throws<F>(
                                                   static_cast<typename F::Variables*>(nullptr)),
                                               NeverThrows, detail::MayThrow> {
   public:
    std::string outside(const double* const* x) const override { return F::outside(x); }
    double reach(const double* const* x) const override { return F::reach(x); }
    bool place(int target, const double* const* x, const double* measurement, double reach,
               double* out) const override {
      return F::place(target, x, measurement, reach, out);
    }

    std::string_view tag() const override { return factor_->tag(); }
    int arity() const override { return factor_->arity(); }
    std::span<const std::string_view> variable_tags() const override {
      return factor_->variable_tags();
    }
    int residual_size() const override { return factor_->residual_size(); }
    int measurement_size() const override { return factor_->measurement_size(); }
    int tangent_size(int variable) const override { return factor_->tangent_size(variable); }
    int ambient_size(int variable) const override { return factor_->ambient_size(variable); }
    std::string normalize(double* measurement) const override {
      return factor_->normalize(measurement);
    }
    void squared_norms(const FactorView& pool, std::size_t begin, std::size_t end,
                       double* out) const override {
      factor_->squared_norms(pool, begin, end, out);
    }
    void linearize(const FactorView& pool, std::size_t begin, std::size_t end,
                   const double* weights, const LinearizeSink& sink,
                   double* out_squared_norms) const override {
      factor_->linearize(pool, begin, end, weights, sink, out_squared_norms);
    }
    void evaluate(const double* const* x, const double* measurement, const double* sqrt_information,
                  double* residual, double* const* jacobians) const override {
      factor_->evaluate(x, measurement, sqrt_information, residual, jacobians);
    }
    bool propagate(int target, const double* const* x, const double* measurement,
                   double* out) const override {
      return factor_->propagate(target, x, measurement, out);
    }
    bool is_relative() const override { return factor_->is_relative(); }
    std::string_view metric() const override { return factor_->metric(); }
    int absolute_size() const override { return factor_->absolute_size(); }
    bool takes_loss() const override { return factor_->takes_loss(); }

   private:
    std::shared_ptr<const FactorType> factor_ = define_factor<F>();
  };
  return std::make_shared<Type>();
}

}  // namespace cairn
