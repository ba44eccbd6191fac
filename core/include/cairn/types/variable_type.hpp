// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Ability of a variable type whose states form a Lie group: what policies need to compose
/// measurements, without knowing which group it is. All arguments are states in ambient storage.
class CAIRN_API LieGroup {
 public:
  virtual ~LieGroup();
  virtual void compose(const double* a, const double* b, double* ab) const = 0;
  virtual void inverse(const double* a, double* a_inverse) const = 0;
  /// Ad(a), tangent × tangent, column-major: a exp(δ) a⁻¹ = exp(Ad(a) δ).
  virtual void adjoint(const double* a, double* Ad) const = 0;
  /// Ad(a⁻¹ b), without loss of digits where both are far from the origin.
  virtual void adjoint_between(const double* a, const double* b, double* Ad) const = 0;
  /// exp: tangent vector to group element; log: its inverse.
  virtual void exp(const double* tangent, double* a) const = 0;
  virtual void log(const double* a, double* tangent) const = 0;
};

/// Ability of a variable type with a position in the plane or in space: what trajectory writers,
/// viewers, ground-truth comparison and the chordal initial guess need.
class CAIRN_API Placement {
 public:
  virtual ~Placement();
  virtual int dimension() const = 0;         ///< 2 or 3
  virtual bool has_orientation() const = 0;  ///< a pose; without it a point
  /// R: dimension × dimension rotation, column-major (left alone by a point); t: position [m].
  virtual void split(const double* x, double* R, double* t) const = 0;
  virtual void join(const double* R, const double* t, double* x) const = 0;
};

/// A kind of variable (pose, landmark, …): its sizes and how its states move. One object serves all
/// graphs; it has no state. Every function works on a whole pool of variables, since it is called
/// across the boundary of a plugin. Authors don't derive from this: see `define_variable.hpp`.
class CAIRN_API VariableType {
 public:
  virtual ~VariableType();

  /// The name in files and messages, such as VERTEX_SE2.
  virtual std::string_view tag() const = 0;
  virtual int ambient_size() const = 0;  ///< doubles in a stored state
  virtual int tangent_size() const = 0;  ///< degrees of freedom

  virtual void identity(double* x) const = 0;

  /// Brings a state that was read into canonical form (unit quaternion, wrapped angle). Returns an
  /// empty string, or what is wrong with it.
  virtual std::string normalize(double* x) const = 0;

  /// out[s] = retract(x[s], delta at delta_offsets[s]) for s = 0 … count-1; a negative offset means
  /// that the variable is constant: out[s] = x[s]. x and out hold ambient_size() doubles per
  /// variable and may be the same array.
  virtual void retract(std::size_t count, const double* x, const std::int64_t* delta_offsets,
                       const double* delta, double* out) const = 0;

  /// delta[s] = local(x[s], y[s]), the tangent vector with retract(x, delta) = y; count of them,
  /// tangent_size() doubles each.
  virtual void local(std::size_t count, const double* x, const double* y, double* delta) const = 0;

  /// D (tangent × tangent, column-major) of one variable: a step ε from retract(x, δ) is a step of
  /// D⁻¹ε in δ, that is, retract(x, δ + ε) = retract(retract(x, δ), D ε) to first order. For a Lie
  /// group it is the right Jacobian of exp at δ; the identity where states move by addition.
  virtual void retract_jacobian(const double* x, const double* delta, double* D) const = 0;

  virtual const LieGroup* lie_group() const { return nullptr; }
  virtual const Placement* placement() const { return nullptr; }
};

}  // namespace cairn
