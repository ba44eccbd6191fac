// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "cairn/aligned.hpp"
#include "cairn/variable_type.hpp"

namespace cairn::incremental {

/// The estimate of every variable.
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
        std::copy(values.begin(), values.end(), x_.begin() + records_[change.index].place);
      }
    }
    remember();
  }
  /// Notes values of somebody else's that are about to change.
  void log_other(std::int32_t index, std::span<const double> values) {
    log_.push_back({index, true, logged_.size(), values.size()});
    logged_.insert(logged_.end(), values.begin(), values.end());
  }

  /// The next variable.
  void add(std::shared_ptr<const VariableType> type, std::span<const double> state);
  int size() const { return static_cast<int>(records_.size()); }

  const VariableType& type(std::int32_t v) const { return *records_[v].type; }
  /// x_v, ambient_size doubles.
  const double* x(std::int32_t v) const { return x_.data() + records_[v].place; }
  std::int32_t ambient(std::int32_t v) const { return records_[v].ambient; }
  /// x_v ← g x_v, g being an element of the variable's group.
  void lead(std::int32_t v, const double* g);
  /// x_v ← x_v ⊕ δ.
  void move(std::int32_t v, const double* delta);

 private:
  struct Record {
    std::shared_ptr<const VariableType> type;
    std::int64_t place;
    std::int32_t ambient;
  };
  struct Change {
    std::int32_t index;
    bool other;
    std::size_t begin, count;  // in logged_
  };
  void log(std::int32_t v);

  std::vector<Change> log_;
  std::vector<double> logged_;
  std::vector<Record> records_;
  AlignedVector x_;
};

}  // namespace cairn::incremental
