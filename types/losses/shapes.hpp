// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

/// The shapes of robust losses. Each is a function ρ of s = ‖r‖², the squared norm of the whitened
/// residual, and of a scale c in units of ‖r‖, with q = c² and ρ(s) = s + O(s²). (Textbooks state
/// them for ½ρ(r²).)
///
/// Sources: [Huber64] Huber, "Robust estimation of a location parameter", 1964. [Charbonnier94]
/// Charbonnier et al., "Two deterministic half-quadratic regularization algorithms", 1994.
/// [Black96] Black, Rangarajan, "On the unification of line processes, outlier rejection, and
/// robust statistics", 1996. [GM85] Geman, McClure, "Bayesian image analysis", 1985. [Dennis78]
/// Dennis, Welsch, "Techniques for nonlinear least squares and robust regression", 1978. [Beaton74]
/// Beaton, Tukey, "The fitting of power series", 1974. [Agarwal13] Agarwal et al., "Robust map
/// optimization using dynamic covariance scaling", 2013. [Zhang97] Zhang, "Parameter estimation
/// techniques: a tutorial", 1997, has most of them in one table.
///
/// `kScale` is the scale by default, of residuals of one number: where [Zhang97] has one, that
/// which is 95 % as efficient as least squares on normal noise, else the 95 % quantile of |r|.
/// `kGrows`: that of residuals of more numbers, which are longer, is larger (scale_of_size.hpp). It
/// is so where residuals beyond the scale lose their influence: right ones must not. Where they
/// keep it (huber, pseudo_huber), or nearly (cauchy), a small scale costs little, and limits wrong
/// ones more.
namespace cairn::losses {

/// ρ(s) and its first two derivatives.
struct Value {
  double rho, first, second;
};

/// s up to q, then 2c√s − q: convex, linear in the norm. [Huber64]
struct Huber {
  static constexpr double kScale = 1.345;
  static constexpr bool kGrows = false;
  static Value at(double s, double q) {
    if (s <= q) return {s, 1.0, 0.0};
    const double ratio = std::sqrt(q / s);
    return {2.0 * ratio * s - q, ratio, -0.5 * ratio / s};
  }
};

/// 2q (√(1 + s/q) − 1): Huber's without the corner. [Charbonnier94]
struct PseudoHuber {
  static constexpr double kScale = 1.345;
  static constexpr bool kGrows = false;
  static Value at(double s, double q) {
    const double root = std::sqrt(1.0 + s / q);
    // √(1 + x) − 1 = x / (√(1 + x) + 1) keeps its digits where x is small.
    return {2.0 * s / (root + 1.0), 1.0 / root, -0.5 / (q * root * root * root)};
  }
};

/// q ln(1 + s/q). [Black96]
struct Cauchy {
  static constexpr double kScale = 2.3849;
  static constexpr bool kGrows = false;
  static Value at(double s, double q) {
    const double weight = 1.0 / (1.0 + s / q);
    return {q * std::log1p(s / q), weight, -weight * weight / q};
  }
};

/// s / (1 + s/q), never more than q. [GM85], scaled as in [Black96]
struct GemanMcClure {
  static constexpr double kScale = 1.9600;
  static constexpr bool kGrows = true;
  static Value at(double s, double q) {
    const double ratio = 1.0 / (1.0 + s / q);
    return {s * ratio, ratio * ratio, -2.0 * ratio * ratio * ratio / q};
  }
};

/// q (1 − exp(−s/q)), never more than q. [Dennis78]
struct Welsch {
  static constexpr double kScale = 2.9846;
  static constexpr bool kGrows = true;
  static Value at(double s, double q) {
    const double weight = std::exp(-s / q);
    return {-q * std::expm1(-s / q), weight, -weight / q};
  }
};

/// q/3 (1 − (1 − s/q)³) up to q, then q/3: no influence at all beyond the scale. [Beaton74]
struct Tukey {
  static constexpr double kScale = 4.6851;
  static constexpr bool kGrows = true;
  static Value at(double s, double q) {
    if (s > q) return {q / 3.0, 0.0, 0.0};
    const double x = s / q, rest = 1.0 - x;
    return {s * (1.0 - x + x * x / 3.0), rest * rest, -2.0 * rest / q};
  }
};

/// s up to q, then q (3s − q)/(q + s): the loss whose weight is the squared scaling factor
/// min(1, 2Φ/(Φ + s))² of dynamic covariance scaling with Φ = q. [Agarwal13]
struct DynamicCovarianceScaling {
  static constexpr double kScale = 1.9600;
  static constexpr bool kGrows = true;
  static Value at(double s, double q) {
    if (s <= q) return {s, 1.0, 0.0};
    const double ratio = 2.0 * q / (q + s);
    return {q * (3.0 * s - q) / (q + s), ratio * ratio, -2.0 * ratio * ratio / (q + s)};
  }
};

}  // namespace cairn::losses
