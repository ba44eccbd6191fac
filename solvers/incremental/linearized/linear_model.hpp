// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/elements.hpp"

namespace cairn::linearized {

/// Whitened rows J d + c ≈ 0 of a linear model, with unit covariance: d stacks the displacements of
/// its variables (each in its own tangent space), J has their columns in that order.
struct Rows {
  std::vector<Id> variables;
  std::vector<int> sizes;  ///< tangent size of each
  Eigen::MatrixXd J;
  Eigen::VectorXd c;
};

/// Offsets of variables in the order of their addition: what every form keeps.
class Offsets {
 public:
  void clear() { *this = {}; }
  void add(Id id, int size);
  bool has(Id id) const { return place_.contains(id); }
  int offset(Id id) const { return place_.at(id); }
  int size() const { return size_; }
  /// The variable with that scalar unknown.
  Id variable(int scalar) const;

 private:
  std::unordered_map<Id, int> place_;
  std::vector<std::pair<int, Id>> order_;  // by rising offset
  int size_ = 0;
};

/// The Gaussian of all displacements d that the rows taken so far define, in some form: minimum and
/// covariance of Σ ‖J d + c‖². Forms differ in what they store and in what is cheap; in exact
/// arithmetic they agree.
///
/// Displacements of all variables are stacked in the order in which they were added, from offset().
class GaussianForm {
 public:
  virtual ~GaussianForm();

  /// Throws `Error` (usage) where so many scalar unknowns are more than it has room for.
  virtual void check_size(std::int64_t) const {}
  /// Forgets everything. `rows` are the rows that will be taken next, for a form that needs an
  /// order of elimination.
  virtual void begin(std::span<const Id> variables, std::span<const int> sizes,
                     std::span<const Rows> rows) = 0;
  /// One more variable, of which nothing is known yet.
  virtual void add_variable(Id id, int size) = 0;
  /// Takes these rows; all their variables are there.
  virtual void add(const Rows& rows) = 0;
  /// The newest pose, for a form that treats it differently; before each `settle`.
  virtual void set_newest(Id) {}
  /// The next displacement is to be the minimum itself, where a form only approaches it.
  virtual void recover_fully() {}
  /// Completes what was begun: afterwards the functions below may be called. False if the rows do
  /// not determine every variable; then `undetermined()` is one that they do not.
  virtual bool settle() = 0;
  virtual Id undetermined() const = 0;

  virtual bool has(Id id) const { return offsets_.has(id); }
  int offset(Id id) const { return offsets_.offset(id); }
  int size() const { return offsets_.size(); }  ///< scalar unknowns
  /// The minimum: size() numbers. Asked for once for each change, when the estimate follows.
  virtual std::span<const double> displacement() = 0;
  /// x = Σ g, both of size().
  virtual void multiply_covariance(std::span<const double> g, std::span<double> x) = 0;

  virtual std::int64_t memory() const = 0;  ///< bytes of the form itself
  virtual std::unique_ptr<GaussianForm> clone() const = 0;

 protected:
  Offsets offsets_;
};

}  // namespace cairn::linearized
