// SPDX-License-Identifier: BSD-3-Clause
#include "covariances.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"
#include "inverse.hpp"

namespace cairn::incremental {
namespace {

/// More rows than this are not worth a solution each: recomputing is cheaper. Found by measuring.
constexpr std::size_t kMostRows = 24;
/// U's eigenvalues are between −1 and 1, and near 0 where a measurement tells much more than was
/// known: as many digits are lost as they are small.
constexpr double kLeastEigenvalue = 1e-4;
/// Rounding adds up slowly; every so many downdates all is computed anew.
constexpr int kOldest = 1000;

}  // namespace

void Covariances::keep(KeptMarginals kept) {
  everything_ = everything_ || (kept == KeptMarginals::diagonal && kept_ != kept);
  kept_ = kept;
}

void Covariances::keep(std::int32_t a, std::int32_t b) { crosses_[{a, b}]; }

void Covariances::drop(std::int32_t v) {
  std::erase_if(crosses_, [&](const auto& cross) {
    return cross.first.first == v || cross.first.second == v;
  });
}

void Covariances::renumber(std::span<const std::int32_t> now) {
  Covariances anew;
  anew.kept_ = kept_;
  for (const auto& [pair, block] : crosses_) {
    const std::int32_t a = now[static_cast<std::size_t>(pair.first)],
                       b = now[static_cast<std::size_t>(pair.second)];
    if (a >= 0 && b >= 0) anew.keep(a, b);
  }
  *this = std::move(anew);
}

void Covariances::note(const Models& models, const System& system, int f, double sign,
                       std::span<const std::uint8_t> held) {
  if (everything_ || kept_ != KeptMarginals::diagonal) return;
  if (rows_.size() > kMostRows) {
    everything_ = true;
    return;
  }
  const int rows = models.rows(f);
  const double* J = models.jacobian(f);
  const auto variables = models.variables(f);
  for (const std::int32_t v : variables) {
    if (!held[v]) sources_.push_back(v);
  }
  for (int r = 0; r < rows; ++r) {
    Row row{entries_.size(), 0, sign};
    std::int64_t column = 0;
    for (const std::int32_t v : variables) {
      for (std::int32_t c = 0; c < system.size(v); ++c, ++column) {
        const double value = J[column * rows + r];
        if (!held[v] && value != 0.0) entries_.push_back({system.offset(v) + c, value});
      }
    }
    row.count = entries_.size() - row.begin;
    rows_.push_back(row);
  }
}

MarginalsBy Covariances::update(const System& system, Tree& tree,
                                std::span<const std::uint8_t> held) {
  MarginalsBy by = keeps_anything() ? MarginalsBy::unchanged : MarginalsBy::none;
  if (kept_ == KeptMarginals::diagonal) {
    while (std::ssize(place_) < system.variables()) {
      const std::int32_t size = system.size(static_cast<std::int32_t>(place_.size()));
      place_.push_back(std::ssize(diagonal_));
      diagonal_.resize(diagonal_.size() + static_cast<std::size_t>(size * size), 0.0);
    }
    if (!everything_ && (!rows_.empty() || !fresh_.empty()))
      by = downdate(system, tree, held) ? MarginalsBy::downdate : MarginalsBy::recomputation;
    if (everything_) by = MarginalsBy::recomputation;
    if (by == MarginalsBy::recomputation) recompute(system, tree);
  } else if (kept_ == KeptMarginals::last) {
    by = MarginalsBy::recomputation;
  }
  if (!crosses_.empty()) {
    solve_crosses(system, tree, held);
    if (by == MarginalsBy::unchanged) by = MarginalsBy::recomputation;
  }
  everything_ = false;
  fresh_.clear();
  sources_.clear();
  rows_.clear();
  entries_.clear();
  return by;
}

/// False if it cannot be done accurately.
bool Covariances::downdate(const System& system, Tree& tree, std::span<const std::uint8_t> held) {
  if (rows_.size() > kMostRows || ++age_ > kOldest) return false;
  if (!fresh_.empty() && !rows_.empty() && !take_out_fresh(system, tree)) return false;
  const std::size_t n = rows_.size(), groups = (n + 7) / 8;
  while (B_.size() < groups) B_.emplace_back();
  for (std::size_t g = 0; g < groups; ++g) {
    AlignedVector& B = B_[g];
    B.assign(static_cast<std::size_t>(system.scalars()) * 8, 0.0);
    for (std::size_t r = g * 8; r < std::min(n, g * 8 + 8); ++r) {
      for (std::size_t e = rows_[r].begin; e < rows_[r].begin + rows_[r].count; ++e)
        B[static_cast<std::size_t>(entries_[e].scalar) * 8 + r % 8] += entries_[e].value;
    }
    tree.solve_many(sources_, B);
  }
  if (n > 0 && !apply(system, tree)) return false;
  for (const std::int32_t v : fresh_) {
    std::fill_n(diagonal(v), system.size(v) * system.size(v), 0.0);
    if (!held[v] && tree.node_of(v) >= 0) solve_for(system, tree, v);
  }
  return true;
}

/// What the rows say of the variables that were there before, when those that are new have been
/// eliminated: V_oᵀ M V_o with M = S − S V_f (V_fᵀ S V_f)⁻¹ V_fᵀ S, which has lower rank by as much
/// as the new ones have freedoms. A pose that came with its odometry alone leaves nothing. False if
/// the rows do not determine what is new.
bool Covariances::take_out_fresh(const System& system, const Tree& tree) {
  const auto is_fresh = [&](std::int64_t scalar) {
    return std::ranges::any_of(fresh_, [&](std::int32_t v) {
      return scalar >= system.offset(v) && scalar < system.offset(v) + system.size(v);
    });
  };
  std::vector<std::int64_t> fresh, old;  // scalars
  for (const Entry& entry : entries_)
    (is_fresh(entry.scalar) ? fresh : old).push_back(entry.scalar);
  for (auto* scalars : {&fresh, &old}) {
    std::ranges::sort(*scalars);
    scalars->erase(std::unique(scalars->begin(), scalars->end()), scalars->end());
  }
  const auto n = static_cast<Eigen::Index>(rows_.size());
  Eigen::MatrixXd V_f = Eigen::MatrixXd::Zero(n, std::ssize(fresh)),
                  V_o = Eigen::MatrixXd::Zero(n, std::ssize(old));
  Eigen::VectorXd S(n);
  for (Eigen::Index r = 0; r < n; ++r) {
    const Row& row = rows_[static_cast<std::size_t>(r)];
    S[r] = row.sign;
    for (std::size_t e = row.begin; e < row.begin + row.count; ++e) {
      const std::int64_t scalar = entries_[e].scalar;
      const auto place = std::ranges::lower_bound(old, scalar);
      if (place != old.end() && *place == scalar) {
        V_o(r, place - old.begin()) += entries_[e].value;
      } else {
        V_f(r, std::ranges::lower_bound(fresh, scalar) - fresh.begin()) += entries_[e].value;
      }
    }
  }
  const Eigen::MatrixXd SV = S.asDiagonal() * V_f;
  const Eigen::LDLT<Eigen::MatrixXd> inner(dense::product_of_transpose(V_f, SV));
  if (!fresh.empty() && (inner.info() != Eigen::Success || !(inner.rcond() > 1e-12))) return false;
  Eigen::MatrixXd M = S.asDiagonal();
  if (!fresh.empty()) M -= SV * inner.solve(SV.transpose());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> parts(M);
  rows_.clear();
  entries_.clear();
  for (Eigen::Index k = 0; k < n; ++k) {
    const double value = parts.eigenvalues()[k];
    if (std::abs(value) < 1e-9) continue;  // those of M are 0 or not far from ±1
    const Eigen::RowVectorXd row =
        std::sqrt(std::abs(value)) * (parts.eigenvectors().col(k).transpose() * V_o);
    rows_.push_back({entries_.size(), old.size(), value > 0.0 ? 1.0 : -1.0});
    for (std::size_t c = 0; c < old.size(); ++c)
      entries_.push_back({old[c], row[static_cast<Eigen::Index>(c)]});
  }
  std::erase_if(sources_, [&](std::int32_t v) {
    return std::ranges::find(fresh_, v) != fresh_.end() || tree.node_of(v) < 0;
  });
  return true;
}

/// Σ ← Σ − B U⁻¹ Bᵀ on the diagonal. False if U is too badly conditioned.
bool Covariances::apply(const System& system, const Tree& tree) {
  const std::size_t n = rows_.size(), groups = (n + 7) / 8, width = groups * 8;
  Eigen::MatrixXd U =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(n));
  for (std::size_t i = 0; i < n; ++i) {
    U(i, i) = rows_[i].sign;
    for (std::size_t e = rows_[i].begin; e < rows_[i].begin + rows_[i].count; ++e) {
      for (std::size_t j = 0; j < n; ++j)
        U(i, j) -=
            entries_[e].value * B_[j / 8][static_cast<std::size_t>(entries_[e].scalar) * 8 + j % 8];
    }
  }
  U = 0.5 * (U + U.transpose().eval());
  const Eigen::VectorXd eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(U, Eigen::EigenvaluesOnly).eigenvalues();
  if (!(eigenvalues.cwiseAbs().minCoeff() >= kLeastEigenvalue)) return false;
  // U⁻¹ in rows of whole groups of eight, as B has them.
  const Eigen::MatrixXd inverse = U.inverse();
  AlignedVector inverse_rows(n * width, 0.0), row(width);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j)
      inverse_rows[i * width + j] =
          inverse(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
  }
  for (std::int32_t v = 0; v < system.variables(); ++v) {
    const std::int32_t size = system.size(v);
    double* const block = diagonal(v);
    if (tree.node_of(v) < 0) {
      std::fill_n(block, size * size, 0.0);
      continue;
    }
    const std::size_t first = static_cast<std::size_t>(system.offset(v)) * 8;
    for (std::int32_t c = 0; c < size; ++c) {
      // A row of B_v U⁻¹, times B_vᵀ.
      std::ranges::fill(row, 0.0);
      for (std::size_t j = 0; j < n; ++j) {
        const double value = B_[j / 8][first + static_cast<std::size_t>(c) * 8 + j % 8];
        const double* from = inverse_rows.data() + j * width;
        for (std::size_t k = 0; k < width; ++k) row[k] += value * from[k];
      }
      for (std::int32_t r = c; r < size; ++r) {
        double sum = 0.0;
        for (std::size_t g = 0; g < groups; ++g) {
          const double* B_r = B_[g].data() + first + static_cast<std::size_t>(r) * 8;
          for (std::size_t k = 0; k < 8; ++k) sum += row[g * 8 + k] * B_r[k];
        }
        block[c * size + r] -= sum;
        block[r * size + c] = block[c * size + r];
      }
    }
  }
  return true;
}

void Covariances::recompute(const System& system, Tree& tree) {
  age_ = 0;
  std::ranges::fill(diagonal_, 0.0);
  diagonal_of_inverse(system, tree, [&](std::int32_t v, const double* block, std::int64_t stride) {
    double* out = diagonal(v);
    const std::int32_t size = system.size(v);
    for (std::int32_t c = 0; c < size; ++c) {
      for (std::int32_t r = 0; r < size; ++r) out[c * size + r] = block[c * stride + r];
    }
  });
}

/// Σ_vv by solving along the path from v to its root.
void Covariances::solve_for(const System& system, Tree& tree, std::int32_t v) {
  const std::int32_t size = system.size(v);
  B_.resize(std::max<std::size_t>(B_.size(), 1));
  AlignedVector& X = B_.front();
  for (std::int32_t first = 0; first < size; first += 8) {
    const std::int32_t width = std::min(8, size - first);
    X.assign(static_cast<std::size_t>(system.scalars()) * 8, 0.0);
    for (std::int32_t k = 0; k < width; ++k)
      X[static_cast<std::size_t>(system.offset(v) + first + k) * 8 + k] = 1.0;
    tree.solve_many_above({&v, 1}, X);
    for (std::int32_t k = 0; k < width; ++k) {
      for (std::int32_t r = 0; r < size; ++r)
        diagonal(v)[(first + k) * size + r] =
            X[static_cast<std::size_t>(system.offset(v) + r) * 8 + k];
    }
  }
}

void Covariances::solve_crosses(const System& system, Tree& tree,
                                std::span<const std::uint8_t> held) {
  B_.resize(std::max<std::size_t>(B_.size(), 1));
  AlignedVector& X = B_.front();
  for (auto& [pair, block] : crosses_) {
    const auto [a, b] = pair;
    const std::int32_t rows = system.size(a), columns = system.size(b);
    block.assign(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns), 0.0);
    if (held[a] || held[b]) continue;
    for (std::int32_t first = 0; first < columns; first += 8) {
      const std::int32_t width = std::min(8, columns - first);
      X.assign(static_cast<std::size_t>(system.scalars()) * 8, 0.0);
      for (std::int32_t k = 0; k < width; ++k)
        X[static_cast<std::size_t>(system.offset(b) + first + k) * 8 + k] = 1.0;
      const std::int32_t both[2] = {a, b};
      tree.solve_many_above(both, X);
      for (std::int32_t k = 0; k < width; ++k) {
        for (std::int32_t r = 0; r < rows; ++r)
          block[(first + k) * rows + r] = X[static_cast<std::size_t>(system.offset(a) + r) * 8 + k];
      }
    }
  }
}

const double* Covariances::kept(std::int32_t a, std::int32_t b) const {
  if (a == b && kept_ == KeptMarginals::diagonal && a < std::ssize(place_))
    return diagonal_.data() + place_[a];
  const auto cross = crosses_.find({a, b});
  return cross == crosses_.end() || cross->second.empty() ? nullptr : cross->second.data();
}

std::int64_t Covariances::doubles() const {
  std::int64_t sum = std::ssize(diagonal_);
  for (const AlignedVector& B : B_) sum += std::ssize(B);
  return sum;
}

}  // namespace cairn::incremental
