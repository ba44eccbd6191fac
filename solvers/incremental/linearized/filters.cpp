// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <optional>

#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "covariance_form.hpp"
#include "information_form.hpp"
#include "linearized_estimator.hpp"

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
}
