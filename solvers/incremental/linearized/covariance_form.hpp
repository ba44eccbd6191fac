// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include "linear_model.hpp"

namespace cairn::linearized {

/// Mean and dense covariance, as an extended Kalman filter has them (Smith, Self, Cheeseman 1990):
///
///     K = P Jᵀ (J P Jᵀ + I)⁻¹      d ← d − K (J d + c)      P ← P − K J P
///
/// at n² operations for each row. A new variable has no covariance until rows determine it: these
/// are split by J_new = Q R into as many as it has unknowns, which give its mean and covariances
/// given the others, and the rest, which measure the others. That is exact.
class CovarianceForm final : public GaussianForm {
 public:
  /// `max_size`: unknowns; the covariance of n takes 8 n² bytes.
  explicit CovarianceForm(int max_size) : max_size_(max_size) {}

  void check_size(std::int64_t size) const override;
  void begin(std::span<const Id>, std::span<const int>, std::span<const Rows>) override;
  void add_variable(Id id, int size) override;
  void add(const Rows& rows) override;
  bool settle() override;
  Id undetermined() const override { return waiting_.front(); }
  bool has(Id id) const override { return offsets_.has(id) || sizes_.contains(id); }
  std::span<const double> displacement() override {
    return {d_.data(), static_cast<std::size_t>(offsets_.size())};
  }
  void multiply_covariance(std::span<const double> g, std::span<double> x) override;
  std::int64_t memory() const override { return 8 * static_cast<std::int64_t>(P_.size()); }
  std::unique_ptr<GaussianForm> clone() const override {
    return std::make_unique<CovarianceForm>(*this);
  }

 private:
  /// Rows on variables that have a covariance: their scalar columns, and J.
  struct Measurement {
    std::vector<int> columns;
    Eigen::MatrixXd J;
    Eigen::VectorXd c;
  };
  void measure(const Measurement& z);
  /// Variables that wait and share rows, with these rows.
  struct Group {
    std::vector<Id> variables;
    std::vector<const Rows*> rows;
  };
  std::vector<Group> groups() const;
  /// Gives the group's variables mean and covariances; false if its rows do not determine them.
  bool initialise(const Group& group);
  void reserve(int size);
  Eigen::VectorXd column(int scalar) const;

  int max_size_;
  Eigen::MatrixXd P_;  ///< lower triangle, with room to grow
  Eigen::VectorXd d_;  ///< likewise
  std::vector<Id> waiting_;
  std::unordered_map<Id, int> sizes_;  ///< of those that wait
  std::vector<Rows> pending_;          ///< rows on those
};

}  // namespace cairn::linearized
