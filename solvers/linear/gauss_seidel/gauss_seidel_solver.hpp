// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "iterative/relaxation.hpp"

namespace cairn {

struct GaussSeidelOptions {
  iterative::RelaxationOptions relaxation{};
  double omega = 1.0;

  static auto fields() {
    using O = GaussSeidelOptions;
    return OptionFields<O>()
        .part(&O::relaxation,
              iterative::RelaxationOptions::fields(
                  "sweeps (forwards and backwards) of one solve; 0: as many as 3e8 multiplications "
                  "allow; a step that has not converged by then is used, and reported"))
        .real("omega", &O::omega, 1e-3, 1.999, "over-relaxation; 1 is Gauss-Seidel itself");
  }
};

/// Symmetric block Gauss-Seidel, over-relaxed by ω (SSOR): for every block i forwards, then
/// backwards, x_i ← x_i + ω (H_ii⁻¹ (g_i − Σ_{j≠i} H_ij x_j) − x_i) (Duckett, Marsland, Shapiro
/// 2000; Vallvé 2018, eq. 2.35). Each block is the best answer to its neighbours as they are. It
/// converges for every positive definite H if 0 < ω < 2, and carries a correction all along a
/// trajectory within one sweep, but shrinks it on the way: still some n² sweeps for n poses, with a
/// smaller constant than Jacobi's. In the order of the variables, on one thread.
class GaussSeidelSolver final : public iterative::Relaxation {
 public:
  explicit GaussSeidelSolver(const GaussSeidelOptions& options);

 private:
  void sweep(std::span<const double> g, std::span<double> x) override;
  int products_per_sweep() const override { return 2; }
  std::string note() const override;
  void relax(int block, std::span<const double> g, std::span<double> x);

  const double omega_;
  std::vector<double> right_, answer_;  // of one block
};

}  // namespace cairn
