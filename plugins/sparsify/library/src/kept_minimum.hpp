// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>

#include "cairn/graph/graph.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/sparsification/sparsifier.hpp"

namespace cairn {

/// Changes what the new factors of a sparsification measure, by as little as possible, so that the
/// sparse graph has its minimum where `original` has its own.
///
/// A blanket's factors are made from its own linearisation, and of a few factors instead of all: at
/// the states of the original their gradient is not that of the factors which they replace, so that
/// the minimum moves. With g = −Jᵀr of the sparse graph at these states, and Λ and J̆ of the new
/// factors alone, changing their residuals by J̆ δ, Λ δ = g, makes it zero: of all changes that do,
/// that with the least Σ ‖Δr‖². A relative pose z between x_i and x_j whose residual there is to be
/// that of the states x ⊕ δ measures h h'⁻¹ z then, h = x_i⁻¹ x_j and h' the same of x ⊕ δ.
/// Repeated while gᵀδ falls.
/// Nothing changes where new factors are not all relative poses, or correlated pairs of these,
/// where Λ is singular besides the gauge, or where gᵀδ does not become far less.
void keep_minimum(const Graph& original, Sparsification& change,
                  const std::function<std::unique_ptr<LinearSolver>()>& make_solver);

}  // namespace cairn
