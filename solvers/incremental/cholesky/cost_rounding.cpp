// SPDX-License-Identifier: BSD-3-Clause
#include "cost_rounding.hpp"

#include <algorithm>
#include <cmath>

#include "cairn/update/marginal_prior.hpp"

namespace cairn::incremental {
namespace {

/// What the cost of a factor is off by where its information is ordinary.
constexpr double kOrdinary = 1e-18;
/// Up to here chi2 is rounded as if its residuals were of ordinary size.
constexpr double kOrdinaryInformation = 1e12;
/// Relative rounding of a difference of two positions, some operations later.
constexpr double kDigitsOfPositions = 2e-15;

double distance_from_origin(const States& states, std::int32_t v) {
  double R[9] = {}, t[3] = {};
  if (const Placement* place = states.type(v).placement()) place->split(states.x(v), R, t);
  return std::max({std::abs(t[0]), std::abs(t[1]), std::abs(t[2])});
}

}  // namespace

double CostRounding::value() const { return kOrdinary * scale_; }

void CostRounding::add(const Graph& graph, const States& states, const Models& models, int f) {
  scale_ += scale_of(graph, states, models, f);
}

/// Below and above what is ordinary it goes with the factor's information, and far from the origin
/// with the digits that positions have left. What marginalisation leaves has its weight in its
/// Jacobian, and is no larger than what it replaces.
double CostRounding::scale_of(const Graph& graph, const States& states, const Models& models,
                              int f) {
  const FactorType& type = graph.factor_type(f);
  if (type.tag() == MarginalPrior::kTag) return 0.0;
  double largest = 0.0;
  const double* diagonal = graph.information(f).data();
  for (int left = type.residual_size(); left > 0; diagonal += left--)
    largest = std::max(largest, *diagonal);
  const double ordinary = largest < 1.0 ? largest : std::max(1.0, largest / kOrdinaryInformation);
  double off = 0.0;  // squared, of the residual
  const double* J = models.jacobian(f);
  for (const std::int32_t v : models.variables(f)) {
    const double length = distance_from_origin(states, v);
    for (const double moves : moves_position(states.type(v))) {
      for (std::int32_t row = 0; row < models.rows(f); ++row, ++J) {
        const double by = moves * kDigitsOfPositions * length * *J;
        off += by * by;
      }
    }
  }
  return ordinary + off / kOrdinary;
}

std::span<const double> CostRounding::moves_position(const VariableType& type) {
  std::vector<double>& coordinates = moves_position_[&type];
  const auto size = static_cast<std::size_t>(type.tangent_size());
  if (coordinates.size() == size) return coordinates;
  const Placement* place = type.placement();
  coordinates.assign(size, place && !place->has_orientation() ? 1.0 : 0.0);
  const LieGroup* group = type.lie_group();
  for (std::size_t k = 0; place && place->has_orientation() && group && k < size; ++k) {
    std::vector<double> step(size, 0.0), x(static_cast<std::size_t>(type.ambient_size()));
    step[k] = 0.1;
    group->exp(step.data(), x.data());
    double R[9] = {}, t[3] = {};
    place->split(x.data(), R, t);
    double trace = 0.0;
    for (int i = 0; i < place->dimension(); ++i) trace += R[i * (place->dimension() + 1)];
    coordinates[k] = trace > place->dimension() - 1e-6 ? 1.0 : 0.0;
  }
  return coordinates;
}

}  // namespace cairn::incremental
