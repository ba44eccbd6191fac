// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace cairn::incremental {

/// An estimate of the cost, Σ ρ(‖r‖²), between two evaluations of the factors, and what follows
/// from it: when they are to be evaluated again, and whether to solve once more.
///
/// Steps lower the cost by gᵀH⁻¹g each if the models are right. By how much they were wrong is seen
/// when the factors are evaluated; the share of it that was left to gain is what is expected to be
/// left the next time.
class CostPrediction {
 public:
  /// What is allowed to be left: a fraction of the cost.
  explicit CostPrediction(double accuracy) : accuracy_(accuracy) {}

  /// A step is taken that lowers the cost by so much, by the models.
  void step(double decrease) {
    decrease_ = decrease;
    gained_ += decrease;
  }
  /// Of the last step.
  double decrease() const { return decrease_; }
  /// The cost after the steps; `evaluated`: when the factors were evaluated.
  double cost(double evaluated) const;
  /// Gains up to this are as good as none.
  double negligible(double cost) const;
  /// Steps of one of the factors that matter no more than this need not be followed.
  double tolerance(double cost, int factors) const;
  /// Whether this is close enough to do without an evaluation.
  bool is_sure(double cost) const;

  /// All factors that have moved are evaluated, where the models expect this cost.
  void begin_evaluation(double evaluated);
  /// ‖J(x) − J‖ / ‖J‖ of a factor that is none of poses alone.
  void note_mismatch(double mismatch);
  void end_evaluation(double cost);
  /// Everything is linearised, evaluated, here.
  void begin_anew() { gained_ = 0.0; }
  /// Nothing is known.
  void forget() { left_share_ = 1.0; }

  struct Judgement {
    double likely;    ///< what can still be gained
    bool is_enough;   ///< that is little
    bool H_is_right;  ///< H does for another step
  };
  /// After an evaluation. The gradients that are left would gain `left` = gᵀH⁻¹g if H were right,
  /// and for poses alone, as a rule, not much more than what the cost has fallen short of (see
  /// docs/online.md). If both agree, H does as it is; if the former is much larger, H is not that
  /// of the current estimate. `rounding`: of the cost.
  Judgement judge(double left, double cost, double rounding, bool poses_alone);

 private:
  double accuracy_;
  double gained_ = 0.0;      // by steps since factors were evaluated
  double decrease_ = 0.0;    // of the last step
  double left_share_ = 1.0;  // how much of the shortfall was left to gain
  // Of the last evaluation:
  double expected_ = 0.0;   // the cost, by the models
  double looked_at_ = 0.0;  // what steps had gained before
  double square_ = 0.0;     // of the mismatches, summed over …
  int compared_ = 0;        // … so many factors
  double mismatch_ = 0.0;   // the mean one
  double shortfall_ = 0.0;  // by how much more than expected the cost was
};

}  // namespace cairn::incremental
