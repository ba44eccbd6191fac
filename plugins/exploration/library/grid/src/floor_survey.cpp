// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/grid/floor_survey.hpp"

namespace cairn {

FloorSurveyor::~FloorSurveyor() = default;

}  // namespace cairn
