// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "linear_model.hpp"

namespace cairn::linearized {

/// The square root R of the information matrix, RᵀR = Σ JᵀJ, upper triangular and sparse, and the
/// right-hand side b with R d = b at the minimum. A row is taken by Givens rotations (Golub, Van
/// Loan 2013, section 5.1.8): from its first column on, each rotates it with the row of R that
/// begins there, until nothing of it is left (incremental smoothing and mapping: Kaess,
/// Ranganathan, Dellaert 2008, section III). JᵀJ, whose condition number is the square of J's, is
/// never formed. `begin` orders the variables by minimum degree; those that come later go to the
/// end, so that R fills in until it is begun again.
class SquareRootForm final : public GaussianForm {
 public:
  void begin(std::span<const Id> variables, std::span<const int> sizes,
             std::span<const Rows> rows) override;
  void add_variable(Id id, int size) override;
  void add(const Rows& rows) override;
  bool settle() override;
  Id undetermined() const override { return undetermined_; }
  std::span<const double> displacement() override;
  /// x = R⁻¹ R⁻ᵀ g.
  void multiply_covariance(std::span<const double> g, std::span<double> x) override;
  std::int64_t memory() const override;
  std::unique_ptr<GaussianForm> clone() const override {
    return std::make_unique<SquareRootForm>(*this);
  }

 private:
  /// A row: columns, rising, and their values; the first is the diagonal of R.
  struct SparseRow {
    std::vector<int> columns;
    std::vector<double> values;
    double b = 0.0;
  };
  void rotate_in(SparseRow row);
  void substitute_back(std::span<double> x) const;

  std::vector<SparseRow> R_;           ///< by column; empty where no row begins
  std::vector<double> squared_norms_;  ///< of the columns of J
  std::vector<double> d_;
  Id undetermined_ = 0;
  SparseRow left_, right_;  ///< room for a rotation
};

}  // namespace cairn::linearized
