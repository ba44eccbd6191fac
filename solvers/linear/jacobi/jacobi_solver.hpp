// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "iterative/relaxation.hpp"

namespace cairn {

struct JacobiOptions {
  iterative::RelaxationOptions relaxation{};
  double omega = 0.0;  ///< 0 chooses one

  static auto fields() {
    using O = JacobiOptions;
    return OptionFields<O>()
        .part(&O::relaxation, iterative::RelaxationOptions::fields(
                                  "sweeps of one solve; 0: as many as 3e8 multiplications allow; a "
                                  "step that has not converged by then is used, and reported"))
        .real("omega", &O::omega, 0.0, 2.0, "damping; 0 chooses one for which it converges");
  }
};

/// Damped block Jacobi: x ← x + ω D⁻¹ (g − H x), D the diagonal blocks of H (Vallvé 2018, eq. 2.34;
/// Saad 2003, chapter 4). It converges if and only if 0 < ω < 2/λ with λ the largest eigenvalue of
/// D⁻¹H (at most the largest number of variables of a factor, so 2 for pose graphs, which ω = 1
/// just misses). ω = 0 chooses ω = 1.8/λ, λ by power iteration in the inner product of H; if that
/// was too low, ω is halved and the solve begins anew.
///
/// A sweep shrinks the slowest error by 1 − ωμ, μ the smallest eigenvalue of D⁻¹H: for a
/// trajectory of n poses that takes some n² sweeps.
class JacobiSolver final : public iterative::Relaxation {
 public:
  explicit JacobiSolver(const JacobiOptions& options);

 private:
  void sweep(std::span<const double> g, std::span<double> x) override;
  void prepare() override;
  bool damp_more() override;
  std::string note() const override;
  double largest_eigenvalue();

  const double given_;
  double omega_ = 0.0;
  std::vector<double> z_, v_;
};

}  // namespace cairn
