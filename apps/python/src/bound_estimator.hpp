// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <utility>

#include "cairn/graph/update.hpp"
#include "cairn/solve/estimator.hpp"
#include "exclusive.hpp"

namespace cairn::python {

/// An estimator as Python holds it, with what was added since its last update.
class BoundEstimator {
 public:
  explicit BoundEstimator(std::unique_ptr<Estimator> estimator)
      : estimator_(std::move(estimator)) {}

  /// For a call that keeps the interpreter's lock. Throws `Error` (usage) while it is in use.
  Estimator& get() {
    exclusive_.refuse_if_used();
    return *estimator_;
  }
  GraphUpdate& pending() {
    exclusive_.refuse_if_used();
    return pending_;
  }

 private:
  friend class EstimatorUse;
  std::unique_ptr<Estimator> estimator_;
  GraphUpdate pending_;
  Exclusive exclusive_{
      "the estimator is in use by a call in another thread that has not returned; wait for it, or "
      "work on estimator.copy()"};
};

/// For a call that releases the interpreter's lock. Throws `Error` (usage) if it is in use already.
class EstimatorUse {
 public:
  explicit EstimatorUse(BoundEstimator& bound)
      : use_(bound.exclusive_), estimator_(bound.estimator_.get()) {}
  Estimator& estimator() const { return *estimator_; }

 private:
  Use use_;
  Estimator* estimator_;
};

}  // namespace cairn::python
