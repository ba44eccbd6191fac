// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "cairn/runtime/aligned.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn::incremental {

/// The states of all variables, one after the other.
class Estimate {
 public:
  void add(std::span<const double> state) {
    const std::int64_t place = std::ssize(x_);
    x_.insert(x_.end(), state.begin(), state.end());
    places_.push_back(place);  // last: where memory ends before, there is no such variable
  }
  int size() const { return static_cast<int>(places_.size()); }
  /// x_v, ambient_size doubles.
  double* x(std::int32_t v) { return x_.data() + places_[v]; }
  const double* x(std::int32_t v) const { return x_.data() + places_[v]; }

 private:
  std::vector<std::int64_t> places_;
  AlignedVector x_;
};

/// The estimate of every variable, and the frame in which its steps are expressed.
///
/// A pose of a Lie group has a frame F, an element that is constant while the estimate x moves: a
/// step δ takes x to F exp(δ) F⁻¹ x, which is x exp(T δ) with T = Ad(x⁻¹ F). So a rigid motion of
/// several variables, by exp(η) from the left, has the steps Ad(F⁻¹) η, whatever their estimates.
/// For a variable of any other kind T is the identity.
class States {
 public:
  /// From here on what changes can be undone.
  void remember();
  /// Undoes everything since `remember`, last first. undo_other(index, values) is called for what
  /// was logged by `log_other`.
  template <class UndoOther>
  void undo(UndoOther undo_other) {
    for (std::size_t k = log_.size(); k-- > 0;) {
      const Change& change = log_[k];
      const std::span<const double> values = std::span(logged_).subspan(change.begin, change.count);
      if (change.other) {
        undo_other(change.index, values);
      } else {
        std::ranges::copy(values, estimate_.x(change.index));
        records_[change.index].known = false;
        records_[change.index].away = records_[change.index].group;
      }
    }
    remember();
  }
  /// The states as `undo` would leave them, which changes nothing here; before_other(index, values)
  /// is called in its place for what was logged by `log_other`, last first.
  template <class BeforeOther>
  Estimate before(BeforeOther before_other) const {
    Estimate estimate = estimate_;
    for (std::size_t k = log_.size(); k-- > 0;) {
      const Change& change = log_[k];
      const std::span<const double> values = std::span(logged_).subspan(change.begin, change.count);
      if (change.other) {
        before_other(change.index, values);
      } else {
        std::ranges::copy(values, estimate.x(change.index));
      }
    }
    return estimate;
  }
  /// Logs values outside this class that are about to change.
  void log_other(std::int32_t index, std::span<const double> values) {
    log_.push_back({index, true, logged_.size(), values.size()});
    logged_.insert(logged_.end(), values.begin(), values.end());
  }

  /// The next variable.
  void add(std::shared_ptr<const VariableType> type, std::span<const double> state);
  int size() const { return static_cast<int>(records_.size()); }

  const VariableType& type(std::int32_t v) const { return *records_[v].type; }
  /// x_v, ambient_size doubles.
  const double* x(std::int32_t v) const { return estimate_.x(v); }
  /// The states alone.
  const Estimate& estimate() const { return estimate_; }
  std::int32_t ambient(std::int32_t v) const { return records_[v].ambient; }
  /// x_v ← g x_v, g being an element of the variable's group. That is a step of Ad(F_v⁻¹) η for
  /// every η with exp(η) = g; `twist` (null: zero) is the sum of those of which g is composed.
  void lead(std::int32_t v, const double* g, const double* twist = nullptr);
  /// Moves variables by steps in their frames: `steps` has those of all variables.
  void move(std::span<const std::int32_t> variables, const double* steps);
  /// The sum of all steps of a variable since its frame was put where it is, `tangent_size`
  /// doubles. It is not undone: only differences mean anything, to what is linearised since.
  const double* travelled(std::int32_t v) const { return travelled_.data() + records_[v].first; }

  /// F_v, like x_v.
  const double* frame(std::int32_t v) const { return frames_.data() + records_[v].place; }
  /// F_v ← x_v. What has `travelled` is zero again: its factors are to be linearised anew.
  void put_frame_here(std::int32_t v);
  /// Whether T_v may be anything but the identity.
  bool away(std::int32_t v) const { return records_[v].away; }
  /// T_v, tangent × tangent, column-major; for a variable that is `away`. Kept until it moves.
  const double* frame_to_body(std::int32_t v) const;
  /// T_v if the variable of a Lie group were at x; tangent × tangent doubles.
  void frame_to_body(std::int32_t v, const double* x, double* T) const;
  /// Ad(F_v⁻¹), tangent × tangent, column-major; of a variable of a Lie group.
  const double* world_to_frame(std::int32_t v) const {
    return adjoints_.data() + records_[v].matrices;
  }

 private:
  struct Record {
    std::shared_ptr<const VariableType> type;
    std::int64_t place;  // in frames_
    std::int32_t ambient;
    std::int64_t matrices;  // in turns_ and adjoints_
    std::int32_t tangent;
    std::int64_t first;          // in travelled_, and among the steps
    bool group;                  // of a Lie group
    bool away = false;           // from its frame
    mutable bool known = false;  // T
  };
  struct Change {
    std::int32_t index;
    bool other;
    std::size_t begin, count;  // in logged_
  };
  void log(std::int32_t v);
  void move_alike(std::span<const std::int32_t> variables, const double* steps);

  std::vector<Change> log_;
  std::vector<double> logged_;
  std::vector<Record> records_;
  Estimate estimate_;
  AlignedVector frames_;  // like the estimate
  AlignedVector adjoints_;
  AlignedVector travelled_;
  mutable AlignedVector turns_;
  std::vector<double> element_;
  std::vector<double> moved_, turned_;  // of several variables, one after the other
  std::vector<std::int64_t> turned_at_;
};

}  // namespace cairn::incremental
