// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <set>
#include <vector>

#include "cairn/runtime/enum_names.hpp"
#include "information_form.hpp"

namespace cairn::linearized {

/// How the mean is recovered from Λ d = η.
enum class MeanRecovery {
  exact,      ///< by a sparse Cholesky factorisation
  amortized,  ///< by a few steps of coordinate descent from the last mean
};
constexpr auto enum_names(MeanRecovery) {
  return std::to_array<EnumName<MeanRecovery>>(
      {{MeanRecovery::exact, "exact"}, {MeanRecovery::amortized, "amortized"}});
}

/// The information form whose newest pose x keeps few links, as a sparse extended information
/// filter has it (Thrun, Liu, Koller, Ng, Ghahramani and Durrant-Whyte 2004). A link
/// is a block of Λ that is not zero. Where x has more than `active`, the weakest, with the
/// variables m⁰, are given up, those with m⁺ stay, and m⁻ are all other variables. The density p(x
/// | m⁰, m⁺, m⁻ = μ⁻) p(m) is replaced by p(x | m⁺, m⁻ = μ⁻) p(m):
///
///     Λ̃ = Λ¹ − Λ² + Λ³
///
/// Λ¹ is of (x, m⁺) and Λ² of m⁺, of what Λ is where m⁻ is held, all else marginalised; Λ³ is of m,
/// x marginalised. η̃ = η + (Λ̃ − Λ) d keeps the mean. x and m⁰ are taken for independent given m⁺,
/// and m⁻ for known in that: so the estimate is overconfident in the long run (Walter, Eustice and
/// Leonard 2007). The strength of a link is ‖L_x⁻¹ Λ_xj L_j⁻ᵀ‖ (Frobenius), L Lᵀ being the two
/// diagonal blocks: it does not depend on units.
class SparsifiedForm final : public InformationForm {
 public:
  /// `steps`: blocks that coordinate descent changes in an update.
  SparsifiedForm(int active, MeanRecovery recovery, int steps)
      : active_(active), recovery_(recovery), steps_(steps) {}

  void begin(std::span<const Id> variables, std::span<const int> sizes,
             std::span<const Rows> rows) override;
  void add_variable(Id id, int size) override;
  void add(const Rows& rows) override;
  void set_newest(Id id) override { newest_ = id; }
  void recover_fully() override { fully_ = true; }
  bool settle() override;
  /// Recovers the mean, then gives up links.
  std::span<const double> displacement() override;
  std::int64_t memory() const override;
  std::unique_ptr<GaussianForm> clone() const override;

 private:
  Eigen::MatrixXd block(int a, int b) const;
  Eigen::Map<Eigen::VectorXd> part(std::vector<double>& of, int block) const;
  void add_to_block(int a, int b, const Eigen::MatrixXd& change);
  void approach_mean();
  void step(int block);
  void sparsify();

  int active_;
  MeanRecovery recovery_;
  int steps_;
  Id newest_ = -1;
  bool fully_ = false;
  std::vector<std::set<int>> links_;  ///< by block
  std::set<int> unsettled_;           ///< blocks that no settling has found determined
  int next_ = 0;                      ///< block of the next step of coordinate descent
};

}  // namespace cairn::linearized
