// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <memory>

#include "approximation.hpp"
#include "cairn/sparsification/sparsification.hpp"
#include "initial_information.hpp"

namespace cairn::sparsify {

/// Parameters of every iterative method.
struct RecoveryOptions {
  InitialInformation initial = InitialInformation::scaled;
  /// Ends where no element of `RecoveryResult::gradient` is larger.
  double tolerance = 1e-3;
  int iterations = 10000;
  double seconds = 0.0;  ///< 0: no limit
};

/// Time that has gone, what is recorded of it, and whether it is up.
class RecoveryClock {
 public:
  RecoveryClock(const RecoveryOptions& options, bool trace)
      : options_(options), trace_(trace), begin_(Clock::now()) {}
  double seconds() const { return std::chrono::duration<double>(Clock::now() - begin_).count(); }
  bool up() const { return options_.seconds > 0.0 && seconds() > options_.seconds; }
  void record(double kld) {
    if (trace_) points_.push_back({seconds(), kld});
  }
  /// The result of where `at` stands.
  RecoveryResult finish(const Approximation& at, int iterations, bool converged);

 private:
  using Clock = std::chrono::steady_clock;
  RecoveryOptions options_;
  bool trace_;
  Clock::time_point begin_;
  std::vector<RecoveryPoint> points_;
};

/// Base of those that remember whether to record.
class IterativeRecovery : public FactorRecovery {
 public:
  explicit IterativeRecovery(RecoveryOptions options) : options_(options) {}
  void trace(bool on) override { trace_ = on; }

 protected:
  RecoveryOptions options_;
  bool trace_ = false;
};

/// Ω_k = (J_k J_kᵀ)⁻¹ (T 4.4), the minimum where the factors' Jacobians together are square and
/// invertible, as those of a tree are. Refuses other topologies.
class ClosedForm final : public FactorRecovery {
 public:
  RecoveryResult recover(const RecoveryProblem& problem) override;
};

/// Factor descent (T 4.3.3): the minimum in one factor while the others stay, factor by factor, in
/// turn or (`greedy`, non-cyclic) always the one that gains the most. A factor that measures what
/// no other does is solved once.
class FactorDescent final : public IterativeRecovery {
 public:
  FactorDescent(RecoveryOptions options, bool greedy)
      : IterativeRecovery(options), greedy_(greedy) {}
  RecoveryResult recover(const RecoveryProblem& problem) override;

 private:
  bool greedy_;
};

struct InteriorPointOptions {
  double start = 0.1;     ///< ω: ρ₀ = ω ‖∇KLD‖ / ‖∇barrier‖
  double decrease = 0.1;  ///< ρ is multiplied by this
  bool conservative = false;
};

/// Newton's method on KLD − ρ Σ ln |Ω_k| for falling ρ (T 4.5 to 4.7), or with −ρ ln |Λ − Λ̆| as
/// well, which keeps the approximation conservative (Λ̆ ⪯ Λ).
class InteriorPoint final : public IterativeRecovery {
 public:
  InteriorPoint(RecoveryOptions options, InteriorPointOptions interior)
      : IterativeRecovery(options), interior_(interior) {}
  RecoveryResult recover(const RecoveryProblem& problem) override;

 private:
  InteriorPointOptions interior_;
};

/// Limited-memory projected quasi-Newton (Schmidt, van den Berg, Friedlander and Murphy 2009): a
/// quadratic model from the last steps, minimised over W ⪰ 0 by spectral projected gradients, then
/// a line search in that direction.
class ProjectedQuasiNewton final : public IterativeRecovery {
 public:
  ProjectedQuasiNewton(RecoveryOptions options, int memory)
      : IterativeRecovery(options), memory_(memory) {}
  RecoveryResult recover(const RecoveryProblem& problem) override;

 private:
  int memory_;
};

}  // namespace cairn::sparsify
