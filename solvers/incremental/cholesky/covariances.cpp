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
/// U's eigenvalues are between 0 and 1 for rows that are added, the smaller the more information a
/// measurement has beside what there was, and the more digits are lost; for rows that are removed
/// they are below −1. All have the rounding of the largest.
constexpr double kLeastEigenvalue = 1e-4, kLeastPart = 1e-6;
/// Rounding adds up slowly; every so many downdates all is computed anew.
constexpr int kOldest = 1000;
/// What changes the variances of a subtree by less than this part is left out.
constexpr double kNothing = 1e-11;

/// The rows of a node's own variables in eight columns become zero.
void clear_rows(const System& system, const Node& node, AlignedVector& X) {
  for (const std::int32_t v : node.own_variables())
    std::fill_n(X.data() + system.offset(v) * 8, std::int64_t{system.size(v)} * 8, 0.0);
}
void clear_path(const System& system, const Tree& tree, const Substitution& substitution,
                AlignedVector& X) {
  for (const std::int32_t n : substitution.path()) clear_rows(system, tree.nodes()[n], X);
}

/// Whether |s| Σ H_ii ‖X_i‖² over a node's separator, of the first `width` columns, is no more than
/// `kNothing`; mostly the first row says that it is more.
template <int width>
bool changes_nothing_below(const System& system, const Node& node, const AlignedVector& X) {
  const double most = kNothing / std::max(node.below(), 1);
  double sum = 0.0;
  for (const std::int32_t v : node.separator()) {
    const std::int32_t size = system.size(v);
    const double* const H = system.diagonal(v);
    const double* row = X.data() + system.offset(v) * 8;
    for (std::int32_t i = 0; i < size; ++i, row += 8) {
      double square = 0.0;
      for (int k = 0; k < width; ++k) square += row[k] * row[k];
      sum += H[i * (size + 1)] * square;
      if (!(sum <= most)) return false;  // also where it is not a number
    }
  }
  return true;
}

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

Covariances Covariances::renumbered(std::span<const std::int32_t> now) const {
  Covariances anew;
  anew.kept_ = kept_;
  for (const auto& [pair, block] : crosses_) {
    const std::int32_t a = now[static_cast<std::size_t>(pair.first)],
                       b = now[static_cast<std::size_t>(pair.second)];
    if (a >= 0 && b >= 0) anew.keep(a, b);
  }
  return anew;
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

MarginalsBy Covariances::update(const System& system, const Tree& tree, Substitution& substitution,
                                std::span<const std::uint8_t> held) {
  MarginalsBy by = keeps_anything() ? MarginalsBy::unchanged : MarginalsBy::none;
  if (kept_ == KeptMarginals::diagonal) {
    while (std::ssize(place_) < system.variables()) {
      const std::int32_t size = system.size(static_cast<std::int32_t>(place_.size()));
      place_.push_back(std::ssize(diagonal_));
      diagonal_.resize(diagonal_.size() + static_cast<std::size_t>(size * size), 0.0);
    }
    if (!everything_ && (!rows_.empty() || !fresh_.empty()))
      by = downdate(system, tree, substitution, held) ? MarginalsBy::downdate
                                                      : MarginalsBy::recomputation;
    if (everything_) by = MarginalsBy::recomputation;
    if (by == MarginalsBy::recomputation) recompute(system, tree);
  } else if (kept_ == KeptMarginals::last) {
    by = MarginalsBy::recomputation;
  }
  if (!crosses_.empty()) {
    solve_crosses(system, tree, substitution, held);
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
bool Covariances::downdate(const System& system, const Tree& tree, Substitution& substitution,
                           std::span<const std::uint8_t> held) {
  if (rows_.size() > kMostRows || ++age_ > kOldest) return false;
  if (!fresh_.empty() && !rows_.empty() && !take_out_fresh(system, tree)) return false;
  const std::size_t n = rows_.size(), groups = (n + 7) / 8;
  for (std::size_t g = 0; g < groups; ++g) {
    AlignedVector& B = columns(system, g);
    for (std::size_t r = g * 8; r < std::min(n, g * 8 + 8); ++r) {
      for (std::size_t e = rows_[r].begin; e < rows_[r].begin + rows_[r].count; ++e)
        B[static_cast<std::size_t>(entries_[e].scalar) * 8 + r % 8] += entries_[e].value;
    }
    substitution.forward_many(system, tree, sources_, B);
  }
  if (n > 0 && !scale_rows(system, tree, substitution)) {
    for (std::size_t g = 0; g < groups; ++g) clear_path(system, tree, substitution, B_[g]);
    return false;
  }
  for (std::size_t g = 0; g < groups; ++g) {
    const double* const signs = signs_.data() + g * 8;
    n - g * 8 <= 4 ? apply<4>(system, tree, substitution, B_[g], signs)
                   : apply<8>(system, tree, substitution, B_[g], signs);
  }
  for (const std::int32_t v : fresh_) {
    std::fill_n(diagonal(v), system.size(v) * system.size(v), 0.0);
    if (!held[v] && tree.node_of(v) >= 0) solve_for(system, tree, substitution, v);
  }
  return true;
}

/// Eight columns of zeros, one row for each scalar.
AlignedVector& Covariances::columns(const System& system, std::size_t group) {
  if (B_.size() <= group) B_.resize(group + 1);
  const std::size_t doubles = static_cast<std::size_t>(system.scalars()) * 8;
  if (B_[group].size() < doubles) B_[group].resize(doubles, 0.0);
  return B_[group];
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

/// Y, in B_, becomes Y Q |Λ|^(−1/2) with Q Λ Qᵀ = U = S − Yᵀ Y. False if U is too badly
/// conditioned.
bool Covariances::scale_rows(const System& system, const Tree& tree,
                             const Substitution& substitution) {
  const std::size_t n = rows_.size();
  const auto for_each_row = [&](const auto& visit) {
    for (const std::int32_t node : substitution.path()) {
      for (const std::int32_t v : tree.nodes()[node].own_variables()) {
        const std::size_t first = static_cast<std::size_t>(system.offset(v));
        for (std::size_t row = first; row < first + static_cast<std::size_t>(system.size(v)); ++row)
          visit(row * 8);
      }
    }
  };
  Eigen::MatrixXd U =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(n));
  for_each_row([&](std::size_t row) {
    for (std::size_t j = 0; j < n; ++j) {
      const double value = B_[j / 8][row + j % 8];
      for (std::size_t i = j; i < n; ++i) U(i, j) -= value * B_[i / 8][row + i % 8];
    }
  });
  for (std::size_t i = 0; i < n; ++i) U(i, i) += rows_[i].sign;
  // The lower triangle is read.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> parts(U);
  const Eigen::VectorXd& values = parts.eigenvalues();
  if (parts.info() != Eigen::Success || !values.allFinite()) return false;
  const Eigen::VectorXd sizes = values.cwiseAbs();
  if (sizes.minCoeff() < std::max(kLeastEigenvalue, kLeastPart * sizes.maxCoeff())) return false;
  const Eigen::MatrixXd scale =
      parts.eigenvectors() * sizes.cwiseSqrt().cwiseInverse().asDiagonal();
  std::vector<double> before(n), after(n);
  for_each_row([&](std::size_t row) {
    for (std::size_t j = 0; j < n; ++j) before[j] = B_[j / 8][row + j % 8];
    for (std::size_t j = 0; j < n; ++j) {
      double sum = 0.0;
      for (std::size_t i = 0; i < n; ++i) sum += before[i] * scale(i, j);
      B_[j / 8][row + j % 8] = sum;
    }
  });
  signs_.assign((n + 7) / 8 * 8, 0.0);
  for (std::size_t j = 0; j < n; ++j) signs_[j] = values[j] > 0.0 ? 1.0 : -1.0;
  return true;
}

/// C ← L⁻ᵀ C, then Σ ← Σ − C sign(Λ) Cᵀ on the diagonal; leaves C as zero. Its columns from
/// `width` on are zero.
template <int width>
void Covariances::apply(const System& system, const Tree& tree, Substitution& substitution,
                        AlignedVector& C, const double* signs) {
  visited_.clear();
  const auto enter = [&](const Node& node) {
    return !changes_nothing_below<width>(system, node, C);
  };
  const auto subtract = [&](const Node& node) {
    visited_.push_back(tree.number_of(node));
    for (const std::int32_t v : node.own_variables()) {
      const std::int32_t size = system.size(v);
      double* const block = diagonal(v);
      const double* const rows = C.data() + system.offset(v) * 8;
      for (std::int32_t c = 0; c < size; ++c) {
        double row[width];
        for (int k = 0; k < width; ++k) row[k] = signs[k] * rows[c * 8 + k];
        for (std::int32_t r = c; r < size; ++r) {
          double sum = 0.0;
          for (int k = 0; k < width; ++k) sum += row[k] * rows[r * 8 + k];
          block[c * size + r] -= sum;
          block[r * size + c] = block[c * size + r];
        }
      }
    }
  };
  substitution.backward_many(system, tree, C, enter, subtract);
  for (const std::int32_t n : visited_) clear_rows(system, tree.nodes()[n], C);
}

void Covariances::recompute(const System& system, const Tree& tree) {
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
void Covariances::solve_for(const System& system, const Tree& tree, Substitution& substitution,
                            std::int32_t v) {
  const std::int32_t size = system.size(v);
  AlignedVector& X = columns(system, 0);
  for (std::int32_t first = 0; first < size; first += 8) {
    const std::int32_t width = std::min(8, size - first);
    for (std::int32_t k = 0; k < width; ++k)
      X[static_cast<std::size_t>(system.offset(v) + first + k) * 8 + k] = 1.0;
    substitution.solve_many_above(system, tree, {&v, 1}, X);
    for (std::int32_t k = 0; k < width; ++k) {
      for (std::int32_t r = 0; r < size; ++r)
        diagonal(v)[(first + k) * size + r] =
            X[static_cast<std::size_t>(system.offset(v) + r) * 8 + k];
    }
    clear_path(system, tree, substitution, X);
  }
}

void Covariances::solve_crosses(const System& system, const Tree& tree, Substitution& substitution,
                                std::span<const std::uint8_t> held) {
  AlignedVector& X = columns(system, 0);
  for (auto& [pair, block] : crosses_) {
    const auto [a, b] = pair;
    const std::int32_t rows = system.size(a), columns = system.size(b);
    block.assign(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns), 0.0);
    if (held[a] || held[b] || tree.node_of(b) < 0) continue;
    for (std::int32_t first = 0; first < columns; first += 8) {
      const std::int32_t width = std::min(8, columns - first);
      for (std::int32_t k = 0; k < width; ++k)
        X[static_cast<std::size_t>(system.offset(b) + first + k) * 8 + k] = 1.0;
      const std::int32_t both[2] = {a, b};
      substitution.solve_many_above(system, tree, both, X);
      for (std::int32_t k = 0; k < width; ++k) {
        for (std::int32_t r = 0; r < rows; ++r)
          block[(first + k) * rows + r] = X[static_cast<std::size_t>(system.offset(a) + r) * 8 + k];
      }
      clear_path(system, tree, substitution, X);
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
