// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "cairn/graph/gauge.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// What a variable does in a direction that no measurement sees.
struct FreeMove {
  int variable;
  std::vector<double> delta;  ///< in its tangent space
};

/// A displacement δ ≠ 0 of some variables with J_f δ = 0 for every factor f: chi2 is flat there.
struct FreeDirection {
  std::vector<FreeMove> moves;
  int part = 0;  ///< directions of different parts have no variable in common
};

/// Directions that the measurements leave free at some states, the gauge being settled: a basis of
/// the null space of H in which each vector moves few variables.
struct CAIRN_API FreeDirections {
  std::vector<FreeDirection> directions;
  /// False where the search was given up: too many directions depend on each other, as where
  /// cameras and points determine each other only all together, or Jacobians are not finite.
  bool complete = true;
  bool finite = true;  ///< so were all Jacobians that were evaluated
  /// No Jacobian was evaluated: the answer is the same at all states.
  bool everywhere = true;

  bool empty() const { return directions.empty(); }
  /// One sentence that names variables and directions, at the graph's states, such as
  /// "VERTEX_XY 2 is free along its bearing from pose 7; it stays at the initial estimate".
  /// Empty where nothing is free. `estimated`: whether to say what becomes of the estimate.
  std::string describe(const Graph& graph, bool estimated = true) const;
};

/// Whitened rows J of factors, as the search below reads them. Factors are numbered from 0, and
/// their variables are those of the search.
class CAIRN_API LinearRows {
 public:
  virtual ~LinearRows();
  virtual std::span<const std::int32_t> variables(int factor) const = 0;
  virtual int rows(int factor) const = 0;
  /// Whether the factor determines each of its variables if the others are known, as far as that is
  /// known without its Jacobian. It need not be said.
  virtual bool determines_each(int factor) const = 0;
  /// Whether `determines_each` says the same at all states.
  virtual bool constant() const { return true; }
  /// rows × Σ tangent sizes of its variables, column-major.
  virtual void jacobian(int factor, std::span<double> J) const = 0;
};

/// How many of the first numbers of a type's tangent space have one unit: the translation of poses
/// and points, one of any other type.
CAIRN_API int numbers_of_one_unit(const VariableType& type);

/// `LinearRows::determines_each` of a factor of a graph: a relative pose, fully measured, without a
/// loss.
CAIRN_API bool determines_each(const Graph& graph, int factor);

/// What is to be searched.
struct FreeSearch {
  std::span<const std::int32_t> sizes;  ///< tangent size of each variable
  /// By variable, how many of the first numbers of its tangent space have one unit, the others
  /// having another (`numbers_of_one_unit`).
  std::span<const std::int32_t> of_one_unit;
  /// By variable: constant, or known to be determined by factors that are left out.
  const std::vector<bool>& determined;
  std::span<const std::int32_t> factors;  ///< which of the rows count
};

/// Finds what these rows leave free.
///
/// From what is determined the search goes on along factors: a variable is determined if those of
/// its factors whose other variables are have full rank in it, and most graphs end there, without
/// one Jacobian where poses hang together by relative poses. Where it stops, a variable moves by
/// parameters α of its own, what depends on it by δ = T α, and every row that is then left over
/// must be zero. Rows are compared with themselves: each is divided by its largest number, since
/// what it leaves free does not depend on how much it weighs, so that information of 10⁻³ beside
/// 10¹³ is information. α is free where Σ ‖J T α‖² ≤ 10⁻¹³ (T α)ᵀ D T α, D having for each number
/// the largest sum of squares in that unit: that is rounding. A direction whose eigenvalue of H,
/// scaled to unit diagonal, is 10⁻¹⁰ of the largest one is not among them.
CAIRN_API FreeDirections find_free_directions(const LinearRows& rows, const FreeSearch& search);

/// The same for a graph's factors at `values`, weighed by their losses.
CAIRN_API FreeDirections find_free_directions(const Graph& graph, const Gauge& gauge,
                                              const Values& values);
/// At the graph's own states, with the gauge that `resolve_gauge` gives it.
CAIRN_API FreeDirections find_free_directions(const Graph& graph);

}  // namespace cairn
