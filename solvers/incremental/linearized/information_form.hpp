// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "block/supernodal_cholesky.hpp"
#include "cairn/linear/block_matrix.hpp"
#include "linear_model.hpp"

namespace cairn::linearized {

/// Information matrix Λ = Σ JᵀJ by blocks, and vector η = −Σ Jᵀc, as an extended information filter
/// has them (Thrun, Liu, Koller, Ng, Ghahramani, Durrant-Whyte 2004). A row changes the blocks of
/// its variables alone; Λ is as sparse as the graph. The mean is recovered by solving Λ d = η with
/// a sparse Cholesky factorisation after every update.
class InformationForm : public GaussianForm {
 public:
  void begin(std::span<const Id>, std::span<const int>, std::span<const Rows>) override;
  void add_variable(Id id, int size) override;
  void add(const Rows& rows) override;
  bool settle() override { return factorize(); }
  Id undetermined() const override { return undetermined_; }
  std::span<const double> displacement() override;
  void multiply_covariance(std::span<const double> g, std::span<double> x) override;
  std::int64_t memory() const override;
  std::unique_ptr<GaussianForm> clone() const override;

 protected:
  bool factorize();
  void copy_to(InformationForm& copy) const;
  /// Λ has changed; `blocks`: and which of its blocks there are.
  void changed(bool blocks);

  std::vector<std::int32_t> sizes_;
  std::vector<Id> variables_;
  std::unordered_map<Id, std::int32_t> block_;
  std::map<std::pair<std::int32_t, std::int32_t>, Eigen::MatrixXd> Lambda_;  ///< lower blocks
  std::vector<double> eta_, d_;
  Id undetermined_ = 0;

 private:
  std::unique_ptr<BlockStructure> structure_;  ///< null: there are new blocks
  BlockMatrix H_;
  std::unique_ptr<block::SupernodalCholesky> cholesky_;
  bool factorized_ = false;
};

}  // namespace cairn::linearized
