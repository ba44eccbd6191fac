// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pybind11/pybind11.h>

#include "cairn/solve/estimator.hpp"
#include "exclusive.hpp"

/// What an estimator holds, as Python reads it: of an estimator itself, or of a policy's.
namespace cairn::python {

namespace py = pybind11;

/// Something that has an estimator.
class HasEstimator {
 public:
  explicit HasEstimator(const char* message) : exclusive_(message) {}
  HasEstimator(const HasEstimator&) = delete;
  HasEstimator& operator=(const HasEstimator&) = delete;
  virtual ~HasEstimator() = default;

  /// For a call that keeps the interpreter's lock. Throws `Error` (usage) while it is in use.
  Estimator& get() {
    exclusive_.refuse_if_used();
    return held();
  }

 protected:
  virtual Estimator& held() = 0;
  const Exclusive& exclusive() const { return exclusive_; }

 private:
  friend class EstimatorUse;
  Exclusive exclusive_;
};

/// For a call that releases the interpreter's lock. Throws `Error` (usage) if it is in use already.
class EstimatorUse {
 public:
  explicit EstimatorUse(HasEstimator& bound) : use_(bound.exclusive_), bound_(&bound) {}
  Estimator& estimator() const { return bound_->held(); }

 private:
  Use use_;
  HasEstimator* bound_;
};

}  // namespace cairn::python
