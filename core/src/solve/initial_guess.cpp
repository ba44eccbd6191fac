// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/solve/initial_guess.hpp"

namespace cairn {

InitialGuess::~InitialGuess() = default;

}  // namespace cairn
