// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <span>

#include "cairn/graph/update.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// Which of an update's factors decide on the initial estimate of a new variable.
enum class Deciding {
  all,    ///< those whose other variables have theirs, each with its own loss
  first,  ///< the first of them that puts the variable somewhere
};

/// Replaces initial estimates of new variables that all measurements of the update contradict.
///
/// A new variable may come with a state that belongs to another estimate of the rest, such as that
/// of a file or of a front end that does not follow loop closures; what is linearised there is off
/// by the whole difference. So for each new variable that factors of the update join with what was
/// there before, directly or through other new ones, chi2 over these factors is computed where the
/// first sixteen of them that can put it (`place_wholly`). It gets the best of these
/// states if the one that it came with leaves more than nine times as much, three times the
/// residuals, in each single one of the factors that can put it somewhere. What was composed from
/// the current estimate and one of the measurements therefore stays; and so do fixed variables,
/// those that are not joined with what was there before, and those that no factor puts anywhere.
///
/// `update` is one that `check_update` has passed; `state_of`: the estimate of a variable that was
/// there before. `deciding`: `first` where losses are not those of the factors, so that an outlier
/// does not decide. Returns how many variables got another state.
CAIRN_API int replace_poor_states(GraphUpdate& update,
                                  const std::function<std::span<const double>(Id)>& state_of,
                                  Deciding deciding = Deciding::all);

}  // namespace cairn
