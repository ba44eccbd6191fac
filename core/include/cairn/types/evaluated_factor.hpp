// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "cairn/runtime/api.hpp"
#include "cairn/types/factor_type.hpp"

namespace cairn {

/// Base of factor types whose sizes are known only when the program runs: what works on a range of
/// a pool calls `evaluate` for each factor. Types of fixed size are much faster by
/// `define_factor.hpp`.
class CAIRN_API EvaluatedFactorType : public FactorType {
 public:
  ~EvaluatedFactorType() override;
  void squared_norms(const FactorView& pool, std::size_t begin, std::size_t end,
                     double* out) const override;
  void linearize(const FactorView& pool, std::size_t begin, std::size_t end, const double* weights,
                 const LinearizeSink& sink, double* out_squared_norms) const override;

 protected:
  /// Factor f of a pool, as `evaluate` gives it.
  virtual void evaluate_entry(const FactorView& pool, std::size_t f, double* residual,
                              double* const* jacobians) const;
};

}  // namespace cairn
