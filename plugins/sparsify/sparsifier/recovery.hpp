// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <memory>

#include "approximation.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/runtime/timed.hpp"
#include "cairn/sparsification/recovery.hpp"
#include "initial_information.hpp"

namespace cairn::sparsify {

/// Options of `fd` and `ncfd`, and of every iterative method.
struct RecoveryOptions {
  InitialInformation initial = InitialInformation::odb;
  /// Ends where no element of `RecoveryResult::gradient` is larger.
  double tolerance = 1e-3;
  int iterations = 10000;
  double seconds = 0.0;  ///< 0: no limit

  static auto fields() {
    using O = RecoveryOptions;
    return OptionFields<O>()
        .choice("initial", &O::initial,
                "begin at off-diagonal blocks of Λ, at each factor's optimum alone (scaled), at "
                "identity matrices, or at these after a cycle of factor descent")
        .real("tolerance", &O::tolerance, 0.0, 1.0,
              "largest element of the gradient at the end, each factor in units of its own optimum")
        .integer("iterations", &O::iterations, 0, 1000000000,
                 "at most; 0: see how good the beginning is")
        .real("seconds", &O::seconds, 0.0, 1e6, "for one problem, at most; 0: no limit");
  }
};

/// Time that has gone, what is recorded of it, and whether it is up.
class RecoveryClock {
 public:
  RecoveryClock(const RecoveryOptions& options, bool trace)
      : options_(options), trace_(trace), begin_(Clock::now()) {}
  double seconds() const { return seconds_since(begin_); }
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
  /// Whether there is time for another iteration. Throws `Interruption` if the work is to end.
  bool has_time(const RecoveryClock& clock) const {
    check_interruption();
    return !clock.up();
  }

  RecoveryOptions options_;
  bool trace_ = false;
};

/// Ω_k = (J_k J_kᵀ)⁻¹ (T 4.4), the minimum where the factors' Jacobians together are square and
/// invertible, as those of a tree are. Refuses other topologies.
class ClosedForm final : public FactorRecovery {
 public:
  RecoveryResult recover(const RecoveryProblem& problem) override;
};

struct FactorDescentOptions {
  RecoveryOptions recovery{};
  bool conservative = false;

  static auto fields() {
    using O = FactorDescentOptions;
    return OptionFields<O>()
        .part(&O::recovery)
        .boolean("conservative", &O::conservative,
                 "then reduce the information to at most Λ: the approximation is conservative");
  }
};

/// Factor descent (T 4.3.3): the minimum in one factor while the others stay, factor by factor, in
/// turn or (`greedy`, non-cyclic) always the one that gains the most. A factor that measures what
/// no other does is solved once. `conservative`: with `make_conservative` at the end.
class FactorDescent final : public IterativeRecovery {
 public:
  FactorDescent(RecoveryOptions options, bool greedy, bool conservative = false)
      : IterativeRecovery(options), greedy_(greedy), conservative_(conservative) {}
  RecoveryResult recover(const RecoveryProblem& problem) override;
  bool takes_background() const override { return !conservative_; }

 private:
  bool greedy_, conservative_;
};

struct InteriorPointOptions {
  RecoveryOptions recovery{};
  double start = 0.1;     ///< ω: ρ₀ = ω ‖∇KLD‖ / ‖∇barrier‖
  double decrease = 0.1;  ///< ρ is multiplied by this
  bool conservative = false;

  static auto fields() {
    using O = InteriorPointOptions;
    return OptionFields<O>()
        .part(&O::recovery)
        .real("start", &O::start, 0.0, 1e6,
              "ω: the barrier's weight, in proportion to the gradients")
        .real("decrease", &O::decrease, 1e-6, 0.999, "the weight is multiplied by this")
        .boolean("conservative", &O::conservative,
                 "keep the approximation conservative: at most the information Λ");
  }
};

/// Newton's method on KLD − ρ Σ ln |Ω_k| for falling ρ (T 4.5 to 4.7), or with −ρ ln |Λ − Λ̆| as
/// well, which keeps the approximation conservative (Λ̆ ⪯ Λ).
class InteriorPoint final : public IterativeRecovery {
 public:
  explicit InteriorPoint(const InteriorPointOptions& options)
      : IterativeRecovery(options.recovery), interior_(options) {}
  RecoveryResult recover(const RecoveryProblem& problem) override;

 private:
  InteriorPointOptions interior_;
};

struct ProjectedQuasiNewtonOptions {
  RecoveryOptions recovery{};
  int memory = 10;  ///< steps that the quadratic model remembers

  static auto fields() {
    using O = ProjectedQuasiNewtonOptions;
    return OptionFields<O>()
        .part(&O::recovery)
        .integer("memory", &O::memory, 1, 1000, "steps that the quadratic model remembers");
  }
};

/// Limited-memory projected quasi-Newton (Schmidt, van den Berg, Friedlander and Murphy 2009): a
/// quadratic model from the last steps, minimised over W ⪰ 0 by spectral projected gradients, then
/// a line search in that direction.
class ProjectedQuasiNewton final : public IterativeRecovery {
 public:
  explicit ProjectedQuasiNewton(const ProjectedQuasiNewtonOptions& options)
      : IterativeRecovery(options.recovery), memory_(options.memory) {}
  RecoveryResult recover(const RecoveryProblem& problem) override;

 private:
  int memory_;
};

}  // namespace cairn::sparsify
