// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace cairn {

/// What one update of the marginals of all poses by a loop closure reads and writes. Arrays hold a
/// number for each of `padded` poses, a multiple of eight, by entry: (r, c) of a 3×3 block at
/// [(3 c + r) · padded + i], the lower triangle of a symmetric one at [entry · padded + i].
struct MarginalUpdate {
  int padded;
  const double *newest, *other;           ///< Σ_it and Σ_il, 9 entries
  int closures;                           ///< before this one
  const double* const* Z_before;          ///< of each, 9 entries
  const double* coupling;                 ///< of each, a 3×3 matrix L_b by columns
  const double* inverse;                  ///< L⁻¹, by columns; its upper triangle is not read
  const double *diagonal, *determinants;  ///< Σ_ii before, 6 entries, and 1 / |Σ_ii| now
  double *Z, *updated;                    ///< 9 and 6 entries
  double* ratios;                         ///< |Σ'_ii| / |Σ_ii now|; may be null
};

/// Z_i = L⁻¹ (cov(y, ε_i) − Σ_b L_b Z_b,i) with cov(ε_i, y) = Σ_it − Σ_il, and
/// Σ'_ii = Σ_ii − Z_iᵀ Z_i, of all poses, by `count` loop closures one after another. What one
/// writes those behind it may read.
using UpdateMarginals = void (*)(const MarginalUpdate*, int count);

/// What a loop closure on a path does to the partners of poses ahead (see `PathDeterminants`).
/// Arrays hold a number for each partner, by entry, as above with `stride` in place of `padded`.
struct PartnerUpdate {
  int count;  ///< partners, a multiple of eight
  int stride;
  int closures;              ///< before this one
  const double* innovation;  ///< cov(y, ε_k − ε_l) without those before, 9 entries
  const double* D_before;    ///< of each, 9 entries; one behind the other
  const double* coupling;    ///< of each, a 3×3 matrix L_b by columns
  const double* inverse;     ///< L⁻¹, by columns; its upper triangle is not read
  const double* end;         ///< Z_k, by columns
  double* D;                 ///< 9 entries
  double *S, *K;             ///< 6 and 9 entries, which change
};

/// D = L⁻¹ (innovation − Σ_b L_b D_b), S −= Dᵀ D, K −= Z_kᵀ D, of all partners.
using UpdatePartners = void (*)(const PartnerUpdate&);

/// What a loop closure on a path does to the stretches of the path between its closures (see
/// `PathClosure`). Blocks of `kStretches` of them, each block entry by entry.
struct StretchUpdate {
  static constexpr int kStretches = 8;
  int closures;                   ///< before this one; there is one stretch more
  const double* const* Z_before;  ///< of each, blocks of 18 entries
  const double* ends;             ///< of each, Z of the poses behind it, by columns
  const double* coupling;         ///< of each, a 3×3 matrix L_b by columns
  const double* inverse;          ///< L⁻¹, by columns; its upper triangle is not read
  const double* innovation;       ///< cov(y, ε) of the stretches' first poses, blocks of 9 entries
  double* Z;                      ///< blocks of 18 entries
  double* marginals;              ///< blocks of 21 entries, which change
};

/// Z = L⁻¹ (cov(y, ε) − Σ_b L_b Z_b) of the first pose of each stretch, and Z₁ = L⁻¹ (1 − Σ_b L_b
/// Z₁,b) with b ahead of the stretch alone: by what noise on it changes y. Of the marginals
/// Σ' −= Zᵀ Z (lower triangle), Q += Z₁ᵀ Z, T += Z₁ᵀ Z₁ (lower triangle).
using UpdateStretches = void (*)(const StretchUpdate&);

/// The fastest that this machine can run: compiled for AVX-512, for AVX2 with FMA, or portable.
UpdateMarginals choose_marginal_kernel();
UpdatePartners choose_partner_kernel();
UpdateStretches choose_stretch_kernel();

}  // namespace cairn
