// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <optional>

#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "covariance_form.hpp"
#include "information_form.hpp"
#include "linearized_estimator.hpp"
#include "sparsified_form.hpp"

namespace {

using namespace cairn;

/// Options of the estimator `ekf`.
struct EkfOptions {
  int max_size = 12000;  ///< unknowns

  static auto fields() {
    return OptionFields<EkfOptions>().integer(
        "max_size", &EkfOptions::max_size, 1, 1e5,
        "refuses more unknowns than this, whose dense covariance takes 8 n² bytes");
  }
};

/// Options of the estimator `seif`.
struct SeifOptions {
  int active = 6;  ///< links
  linearized::MeanRecovery mean = linearized::MeanRecovery::exact;
  int steps = 50;  ///< blocks

  static auto fields() {
    using O = SeifOptions;
    return OptionFields<O>()
        .integer("active", &O::active, 1, 1e9,
                 "poses and landmarks that stay linked with the newest pose")
        .choice("mean", &O::mean,
                "recovered by a factorisation, or approached by coordinate descent")
        .integer("steps", &O::steps, 1, 1e9,
                 "variables that coordinate descent changes in an update");
  }
};

}  // namespace

void cairn_register(Registrar& registrar) {
  using namespace cairn::linearized;
  registrar.add<Estimator, EkfOptions>("ekf", [](const EkfOptions& options) {
    return std::make_unique<LinearizedEstimator>(std::make_unique<CovarianceForm>(options.max_size),
                                                 std::nullopt);
  });
  registrar.add<Estimator>("eif", {}, [](const Options&, Registry&) {
    return std::make_unique<LinearizedEstimator>(std::make_unique<InformationForm>(), std::nullopt);
  });
  registrar.add<Estimator, SeifOptions>("seif", [](const SeifOptions& options) {
    return std::make_unique<LinearizedEstimator>(
        std::make_unique<SparsifiedForm>(options.active, options.mean, options.steps),
        std::nullopt);
  });
}
