// SPDX-License-Identifier: BSD-3-Clause
#include "scale_of_size.hpp"

#include <cmath>

#include <boost/math/distributions/chi_squared.hpp>

namespace cairn::losses {

double scale_of_size(double scale_of_one, int n) {
  const auto quantile = [](int degrees_of_freedom) {
    return boost::math::quantile(boost::math::chi_squared(degrees_of_freedom), 0.95);
  };
  return n == 1 ? scale_of_one : scale_of_one * std::sqrt(quantile(n) / quantile(1));
}

}  // namespace cairn::losses
