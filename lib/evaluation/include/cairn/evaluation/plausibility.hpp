// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/graph/gauge.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/update/rejected_factors.hpp"

namespace cairn {

/// The ranks of the information of all factors minus unknowns (the tangent sizes of the variables
/// that are not constant): the mean of chi2 at the minimum of a good model. What a factor has no
/// information of, such as the range of a measured bearing, counts for nothing. Negative: there are
/// fewer measurements than unknowns.
CAIRN_API std::int64_t degrees_of_freedom(const Graph& graph, const Gauge& gauge);

/// Beyond this chi2 per degree of freedom, an optimised estimate is not plausible: on average,
/// residuals are more than five times as large as the information of their factors says.
inline constexpr double kImplausibleChi2 = 25.0;

/// Whether chi2 of an optimised estimate is plausible; without degrees of freedom, any finite chi2
/// is.
CAIRN_API bool is_plausible(double chi2, std::int64_t degrees_of_freedom);

/// For an optimised estimate: empty if its chi2 is plausible, else a sentence for the user with the
/// likely causes and what helps.
CAIRN_API std::string implausible_estimate(const Graph& graph, double chi2);

/// Compares Jacobians with differences of residuals (`check_factor`) at the graph's states, on up
/// to three factors of each type: a sentence for each type whose factors all deviate by more than
/// one per thousand, with the entry that deviates most. A factor that throws beside the states is
/// left out. Takes microseconds for each type.
CAIRN_API std::vector<std::string> wrong_jacobians(const Graph& graph);

/// Names the first factor whose residual is not finite at the graph's states, and its measurement;
/// empty if there is none.
CAIRN_API std::string residual_not_finite(const Graph& graph);

/// Names the factors whose residual has no meaning at the graph's states (`Domain`), such as points
/// behind the camera that sees them: a sentence for each type and reason, with the first of them
/// and their number.
CAIRN_API std::vector<std::string> outside_of_domains(const Graph& graph);

/// A sentence where robust losses take the weight of every factor at the graph's states (ρ′ below
/// 1e-9): H is then zero to rounding. Empty else.
CAIRN_API std::string losses_weigh_nothing(const Graph& graph);

/// What speaks against an optimised estimate of this chi2, a sentence each: `implausible_estimate`,
/// `residual_not_finite`, `losses_weigh_nothing`, loop closures that are rejected nearly all
/// (`rejected_factors`), `outside_of_domains` and `wrong_jacobians`. Empty if nothing does.
CAIRN_API std::vector<std::string> reasons_for_doubt(const Graph& graph, double chi2);

/// What a user is to be given with an estimate.
struct NotesOnEstimate {
  /// The doubts, or, where losses reject fewer factors, how many they are ("the loss leaves 3 of
  /// 120 loop closures less than 1 % of their weight").
  std::vector<std::string> notes;
  std::vector<std::string> doubts;  ///< `reasons_for_doubt`
};
CAIRN_API NotesOnEstimate notes_on_estimate(const Graph& graph, double chi2);

}  // namespace cairn
