// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "cairn/runtime/api.hpp"
#include "cairn/types/factor_type.hpp"
#include "cairn/types/variable_type.hpp"

/// Initial estimates from measurements. A component without information is a number that was
/// not measured, whatever stands in the file: it is never used for an initial estimate.
namespace cairn {

/// Whether a measurement measures all components of its residual: whether the square root U of its
/// information (packed, upper triangular: `Graph::sqrt_information`) has full rank.
CAIRN_API bool measures_all(const FactorType& type, std::span<const double> sqrt_information);

/// Where the measurement z puts variable `target`, given the states x of the others. False if it
/// does not determine that: the type cannot say (`FactorType::propagate`), or a component has no
/// information.
CAIRN_API bool place_wholly(const FactorType& type, std::span<const double> sqrt_information,
                            int target, const double* const* x, const double* z, double* out);

/// As much of a state as the measurement says, for variables that no measurement determines wholly:
/// moves `state` by the least that makes the whitened residual zero (Gauss-Newton steps of least
/// norm), so that what is not measured stays what it was. `x` are the states of the others; the
/// entry of `target` is not read. False, with `state` as it was, if nothing is measured or
/// what follows is not finite.
CAIRN_API bool place_in_part(const FactorType& type, const VariableType& variable,
                             std::span<const double> sqrt_information, int target,
                             std::span<const double* const> x, const double* z,
                             std::vector<double>& state);

/// `place_in_part` by a measurement that would determine the variable if it had all its
/// information: from beside another variable of the factor of the same type, such as the pose
/// before it in the chain, or from `state` where there is none.
CAIRN_API bool place_beside(const FactorType& type, const VariableType& variable,
                            std::span<const double> sqrt_information, int target,
                            std::span<const double* const> x, const double* z,
                            std::vector<double>& state);

}  // namespace cairn
