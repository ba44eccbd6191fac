// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "cairn/runtime/aligned.hpp"
#include "cairn/solve/estimator.hpp"
#include "models.hpp"
#include "system.hpp"
#include "tree.hpp"

namespace cairn::incremental {

/// The diagonal blocks of Σ = H⁻¹, and some others, while H changes.
///
/// H changes by a few factors at a time: H′ = H + Vᵀ S V, V being the Jacobians of the factors that
/// came (S = 1) and of those that went or were relinearised, as they were (S = −1). Then, with the
/// new factor of H′,
///
///     B = Σ′ Vᵀ,   U = S − V B,   Σ = Σ′ + B U⁻¹ Bᵀ   ⇒   Σ′_ij = Σ_ij − B_i U⁻¹ B_jᵀ
///
/// (IJRR 2017, equations 11 to 15, there for S = 1 and with the increment's sign turned). Variables
/// that are new are eliminated from V first, and their own blocks solved for. B takes a solution
/// for each row that is left, eight at a time. Where these are too many, or U too badly
/// conditioned, all blocks on the diagonal are recomputed by the recursion from the roots of the
/// tree down.
class Covariances {
 public:
  /// What changes: to be called before H does, for every factor that goes or is relinearised, and
  /// after, for every one that comes.
  void note(const Models& models, const System& system, int f, double sign,
            std::span<const std::uint8_t> held);
  /// Everything is new.
  void note_everything() { everything_ = true; }
  /// Variables are numbered anew: now[v], or -1 for one that is gone. Everything is new.
  void renumber(std::span<const std::int32_t> now);
  void note_variable(std::int32_t v) { fresh_.push_back(v); }
  void keep(KeptMarginals kept);
  void keep(std::int32_t a, std::int32_t b);
  /// Forgets the crosses of a variable.
  void drop(std::int32_t v);
  bool keeps_anything() const { return kept_ != KeptMarginals::none || !crosses_.empty(); }

  /// Updates everything from the tree.
  MarginalsBy update(const System& system, Tree& tree, std::span<const std::uint8_t> held);
  /// A kept block, size_a × size_b, column-major; null if it is not kept.
  const double* kept(std::int32_t a, std::int32_t b) const;
  std::int64_t doubles() const;

 private:
  bool downdate(const System& system, Tree& tree, std::span<const std::uint8_t> held);
  bool take_out_fresh(const System& system, const Tree& tree);
  bool apply(const System& system, const Tree& tree);
  void recompute(const System& system, Tree& tree);
  void solve_for(const System& system, Tree& tree, std::int32_t v);
  void solve_crosses(const System& system, Tree& tree, std::span<const std::uint8_t> held);
  double* diagonal(std::int32_t v) { return diagonal_.data() + place_[v]; }

  struct Row {
    std::size_t begin, count;  // in entries_
    double sign;
  };
  struct Entry {
    std::int64_t scalar;
    double value;
  };

  KeptMarginals kept_ = KeptMarginals::none;
  bool everything_ = true;
  std::vector<std::int32_t> fresh_;
  std::vector<std::int32_t> sources_;  // variables that the rows touch
  std::vector<Row> rows_;
  std::vector<Entry> entries_;
  std::vector<std::int64_t> place_;  // by variable, in diagonal_
  std::vector<double> diagonal_;
  std::map<std::pair<std::int32_t, std::int32_t>, std::vector<double>> crosses_;
  std::vector<AlignedVector> B_;  // eight columns each
  int age_ = 0;                   // downdates since the last recomputation
};

}  // namespace cairn::incremental
