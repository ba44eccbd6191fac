// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <utility>

#include "cairn/graph/update.hpp"
#include "cairn/solve/estimator.hpp"
#include "estimates.hpp"

namespace cairn::python {

/// An estimator as Python holds it, with what was added since its last update.
class BoundEstimator final : public HasEstimator {
 public:
  explicit BoundEstimator(std::unique_ptr<Estimator> estimator)
      : HasEstimator(
            "the estimator is in use by a call in another thread that has not returned; wait for "
            "it, or work on estimator.copy()"),
        estimator_(std::move(estimator)) {}

  GraphUpdate& pending() {
    exclusive().refuse_if_used();
    return pending_;
  }

 private:
  Estimator& held() override { return *estimator_; }

  std::unique_ptr<Estimator> estimator_;
  GraphUpdate pending_;
};

}  // namespace cairn::python
