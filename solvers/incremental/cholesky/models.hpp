// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "answers.hpp"
#include "cairn/graph/graph.hpp"
#include "segmented_array.hpp"
#include "states.hpp"
#include "system.hpp"

namespace cairn::incremental {

/// The linear model of every factor: a whitened Jacobian J, that of some earlier estimate, its
/// gradient γ = Jᵀr when it was last evaluated, and where its variables were then: the change of r
/// by the steps since is J (t − t₀), t being what `States` counts as `travelled`.
///
/// Steps are always expressed from the current estimate, in the frames of `States`. A step δ moves
/// the estimate, and the modelled residual and gradient by J δ and JᵀJ δ. The error of that is
/// found by evaluating the factor again at x:
///
///  - the *drift* J(x)ᵀr(x) − γ goes into the right-hand side: the estimate converges to where the
///    true gradient is zero, whatever J is;
///  - the *mismatch* μ = ‖J(x) − J‖ / ‖J‖ determines how fast it does.
///
/// For a relative measurement between poses of a Lie group, J δ is zero for every rigid motion of
/// both, however old J is, since frames are constant. The remaining error of an old J is μ times
/// the change of the residual by the step, and that, over all factors, is the decrease of chi2:
/// after the step no more than about μ² of it is left. So H and L last for a long time, even if a
/// loop closure moves everything by metres.
///
/// The gradient is kept in the frame of the pose (in the coordinates of x ⊕ δ), where a rigid
/// motion of the whole does not change it: a factor that is evaluated again agrees with its
/// neighbours that are not.
class Models {
 public:
  /// The next factor, as it stands in the graph at that position.
  void add(const Graph& graph, int position);
  void clear() { *this = Models(); }
  int size() const { return static_cast<int>(records_.size()); }
  std::span<const std::int32_t> variables(int f) const {
    return std::span(variables_)
        .subspan(static_cast<std::size_t>(records_[f].variables),
                 static_cast<std::size_t>(records_[f].arity));
  }

  /// Linearises at the current estimate: J = J(x), γ = Jᵀr.
  void linearize(int f, const Graph& graph, const States& states);
  /// Adds the factor's part of H and of the right-hand side, times `sign`; constant variables have
  /// none.
  void add_to(System& system, const States& states, int f, double sign,
              std::span<const std::uint8_t> held) const;
  /// Its part of the block row of one of its variables: H_vv and what joins v with others.
  void add_row(System& system, int f, std::int32_t variable,
               std::span<const std::uint8_t> held) const;

  /// Counts a step of one of its variables for this factor alone.
  void move(int f, std::int32_t variable, const double* step);
  /// Whether two factors are of one type, between variables of the same types.
  bool alike(int f, int other) const { return records_[f].pool == records_[other].pool; }
  /// Evaluates factors that are alike again: their drift goes into the gradient.
  void correct(std::span<const std::int32_t> factors, const Graph& graph, const States& states,
               System& system, std::span<const std::uint8_t> held);
  /// ‖J(x) − J‖ / ‖J‖ of a factor, its mismatch.
  double mismatch(int f, const Graph& graph, const States& states) const;
  /// g_v: minus the gradient of all its factors at the current estimate, by the model.
  void right_hand_side(System& system, const States& states, std::int32_t v) const;

  /// What steps have changed in its residual since it was last evaluated, by the model: `rows`
  /// doubles, until this is called again.
  const double* change(int f, const States& states) const;
  /// Whether it is invariant to rigid motions of all its variables.
  bool relative(int f) const { return records_[f].relative; }
  /// ρ(‖r‖²) when last evaluated.
  double cost(int f) const { return records_[f].cost; }
  /// Rows of the whitened residual.
  std::int32_t rows(int f) const { return records_[f].rows; }
  /// ρ(‖r‖²) at an estimate; nothing is kept of it.
  double cost_now(int f, const Graph& graph, const Estimate& estimate) const;
  /// J of all its variables side by side, rows × scalars, column-major.
  const double* jacobian(int f) const { return values_.at(records_[f].place); }
  std::int64_t doubles() const { return values_.size(); }
  /// What factors answer is recorded here, or taken from here.
  void keep_answers(Answers* answers) { answers_.in(answers); }

 private:
  struct Record {
    std::int64_t place;  // in values_: J; what its variables had travelled; γ
    std::int32_t variables;
    std::int32_t pool, entry;
    std::int16_t arity, rows, scalars;
    bool relative;
    bool of_poses = false;  // two variables, both with as many coordinates as it has rows
    double cost = 0.0;
  };
  int size_of(const Record& record, int k) const { return tangents_[record.variables + k]; }
  const double* block(const Record& record, int k) const;
  void gather(std::span<const std::int32_t> factors, const Graph& graph, const Estimate& estimate);
  void replace_gradient(int f, const double* now, const States& states, System& system,
                        std::span<const std::uint8_t> held);
  template <int Size>
  void replace_gradient_of_pair(const Record& record, const double* now, const States& states,
                                System& system, std::span<const std::uint8_t> held);
  void start_here(const Record& record, const States& states);
  bool has_moved(const Record& record, const States& states) const;
  void add_block(System& system, const Record& record, int ka, int kb, double sign) const;
  void add_in_frame(const States& states, std::int32_t v, int size, const double* gradient,
                    double* out) const;
  void into_frames(const Record& record, const States& states, double* J) const;
  double evaluate(const Record& record, const Graph& graph, const Estimate& estimate, double* r,
                  double* J) const;
  double ask(const Record& record, const Graph& graph, const Estimate& estimate, double* r,
             double* J) const;
  void ask(std::span<const std::int32_t> factors, const Graph& graph, bool weighs);
  void ask_gathered(std::span<const std::int32_t> factors, const Graph& graph, bool weighs);

  std::vector<Record> records_;
  std::vector<std::int32_t> variables_;
  std::vector<std::int16_t> tangents_;  // of each of a factor's variables
  SegmentedArray values_;
  mutable std::vector<double> scratch_, turned_, change_, step_;
  mutable std::vector<double*> pointers_;
  mutable std::vector<const double*> points_;

  /// Factors that are evaluated together, as a pool of their own.
  struct Gathered {
    std::vector<std::int32_t> slots, noises;
    std::vector<double> measurements;
    std::vector<std::vector<double>> states;  // of the k-th variables
    std::vector<const double*> state_arrays;
    std::vector<LinearizeTarget> blocks, gradient_targets;
    std::vector<double> gradients, norms, costs, weights;
  };
  Gathered gathered_;
  AnswersKept answers_;
};

}  // namespace cairn::incremental
