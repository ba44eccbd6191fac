// SPDX-License-Identifier: BSD-3-Clause
#include "block/chain_cholesky.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <Eigen/Core>

#include "cairn/runtime/threads.hpp"

namespace cairn::block {
namespace {

/// Groups of chains that one thread takes at a time.
constexpr std::size_t kGroupsTogether = 8;
/// Right-hand sides that are solved for together, as `SupernodalCholesky` has them.
constexpr int kColumnsTogether = 8;

template <class Body>
void for_each_group(const Chains& chains, const Body& body) {
  for_each_range(static_cast<std::size_t>(chains.groups()), kGroupsTogether,
                 [&](std::size_t begin, std::size_t end) {
                   for (std::size_t g = begin; g < end; ++g) body(static_cast<int>(g));
                 });
}

/// Where the numbers of a chain start in an array with `count` numbers for each lane.
std::int64_t of_chain(const Chains& chains, const Chains::Chain& chain, std::int64_t count) {
  return (std::int64_t{chain.group} * chains.lanes() + chain.lane) * count;
}

/// Room for so many numbers; those that it has are lost.
void grow(UninitializedVector& numbers, std::int64_t count) {
  if (std::ssize(numbers) < count) numbers = UninitializedVector(count);
}

}  // namespace

ChainCholesky::ChainCholesky(std::string_view kernels, Precision precision)
    : kernels_(choose_kernels(std::string(kernels).c_str())), rest_(kernels, precision) {}

void ChainCholesky::analyze(const BlockStructure& structure, std::string_view ordering) {
  factorized_ = false;
  structure_ = &structure;
  version_ = structure.version();
  chains_ = ordering == "auto" ? Chains(structure, kernels_->lanes) : Chains();
  if (chains_.empty()) {
    rest_.analyze(structure, ordering);
    const auto order = rest_.cholesky().symbolic().order();
    order_.assign(order.begin(), order.end());
    return;
  }
  rest_.analyze(chains_.rest(), ordering);
  schur_ = BlockMatrix(chains_.rest());
  order_.assign(chains_.nodes().begin(), chains_.nodes().end());
  for (const std::int32_t b : rest_.cholesky().symbolic().order())
    order_.push_back(chains_.separators()[b]);
  const std::int64_t nodes = chains_.group_begin(chains_.groups()), d = chains_.block_size();
  const std::int64_t lanes = std::int64_t{chains_.groups()} * chains_.lanes();
  panels_ = UninitializedVector(nodes * panel_numbers());
  ends_ = UninitializedVector(lanes * 3 * d * d);
  failed_.assign(chains_.groups(), 0);
}

Factorization ChainCholesky::factorize(const BlockMatrix& H) {
  if (chains_.empty()) return rest_.factorize(H);
  if (H.structure().version() != version_)
    throw std::logic_error("factorize: analyze this structure first");
  const std::int64_t d = chains_.block_size();
  for_each_group(chains_, [&](int g) {
    failed_[g] =
        chain_kernels().eliminate(chains_.group(g), H.values().data(),
                                  panels_.data() + chains_.group_begin(g) * panel_numbers(),
                                  ends_.data() + std::int64_t{g} * chains_.lanes() * 3 * d * d);
  });
  add_ends_to_rest(H);
  Factorization result = rest_.factorize(schur_);
  if (!result.ok) result.failed_block = chains_.separators()[result.failed_block];
  factorized_ = false;
  for (int g = 0; g < chains_.groups(); ++g) {
    if (failed_[g] != 0) return failure(g, failed_[g]);
  }
  factorized_ = result.ok;
  return result;
}

/// The first node without a positive pivot, in the first of these lanes.
Factorization ChainCholesky::failure(int group, unsigned lanes) const {
  const int lane = std::countr_zero(lanes);
  const auto chain = std::ranges::find_if(chains_.chains(), [&](const Chains::Chain& each) {
    return each.group == group && each.lane == lane;
  });
  const auto nodes = chain->nodes(chains_);
  const int d = chains_.block_size();
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    const double* numbers =
        panel(group) + static_cast<std::int64_t>(k) * panel_numbers() * chains_.lanes();
    for (int i = 0; i < d; ++i) {
      const double pivot = numbers[(d * (d - 1) / 2 + i) * chains_.lanes() + lane];
      if (!(pivot > 0.0 && pivot < std::numeric_limits<double>::infinity()))
        return {.ok = false, .failed_block = nodes[k]};
    }
  }
  return {.ok = false, .failed_block = nodes.back()};
}

void ChainCholesky::add_ends_to_rest(const BlockMatrix& H) {
  const auto values = schur_.values();
  auto done = values.begin();
  for (const Chains::Copy& copy : chains_.copies()) {
    std::fill(done, values.begin() + copy.target, 0.0);
    done = std::copy_n(H.values().begin() + copy.source, copy.size, values.begin() + copy.target);
  }
  std::fill(done, values.end(), 0.0);
  const int d = chains_.block_size();
  for (const Chains::Chain& chain : chains_.chains()) {
    const double* ends = ends_.data() + of_chain(chains_, chain, 3 * d * d);
    const auto add = [&](std::int64_t place, const double* block, bool turned) {
      if (place < 0) return;
      double* to = values.data() + place;
      for (int c = 0; c < d; ++c) {
        for (int r = 0; r < d; ++r) to[c * d + r] += block[turned ? r * d + c : c * d + r];
      }
    };
    add(chain.first_block, ends, false);
    add(chain.last_block, ends + d * d, false);
    add(chain.common_block, ends + 2 * d * d, chain.turned);
  }
}

void ChainCholesky::solve(std::span<const double> g, std::span<double> x) {
  if (chains_.empty()) return rest_.solve(g, x);
  solve_together(g, x, 1);
}

/// Chains of a group for all right-hand sides before the next group, so that its panel stays near;
/// each side as if it were alone.
void ChainCholesky::solve_together(std::span<const double> G, std::span<double> X, int columns) {
  if (!factorized_) throw std::logic_error("solve: there is no factorisation");
  const std::int64_t d = chains_.block_size(), size = structure_->size(),
                     rest_size = chains_.rest().size();
  const std::int64_t nodes = chains_.group_begin(chains_.groups());
  const std::int64_t ends_size = std::int64_t{chains_.groups()} * chains_.lanes() * 2 * d;
  grow(y_, nodes * d * columns);
  grow(ends_of_g_, ends_size * columns);
  G_rest_.resize(static_cast<std::size_t>(rest_size * columns));
  const auto y_of = [&](int group, std::int64_t c) {
    return y_.data() + (chains_.group_begin(group) * columns +
                        (chains_.group_begin(group + 1) - chains_.group_begin(group)) * c) *
                           d;
  };
  const auto ends_of = [&](int group, std::int64_t c) {
    return ends_of_g_.data() + ends_size * c + std::int64_t{group} * chains_.lanes() * 2 * d;
  };
  for_each_group(chains_, [&](int group) {
    for (std::int64_t c = 0; c < columns; ++c) {
      chain_kernels().forward(chains_.group(group), panel(group), G.data() + c * size,
                              y_of(group, c), ends_of(group, c));
    }
  });
  const auto offsets = structure_->offsets(), in_rest = chains_.rest().offsets();
  const auto separators = chains_.separators();
  // visit(numbers of a separator in column c, those of the chain's end)
  const auto for_each_end = [&](std::int64_t c, auto visit) {
    for (const Chains::Chain& chain : chains_.chains()) {
      double* ends = ends_of_g_.data() + ends_size * c + of_chain(chains_, chain, 2 * d);
      visit(chain.first, ends);
      visit(chain.last, ends + d);
    }
  };
  for (std::int64_t c = 0; c < columns; ++c) {
    const double* g = G.data() + c * size;
    double* g_rest = G_rest_.data() + c * rest_size;
    for (std::size_t k = 0; k < separators.size(); ++k)
      std::copy(g + offsets[separators[k]], g + offsets[separators[k] + 1], g_rest + in_rest[k]);
    for_each_end(c, [&](std::int32_t block, const double* ends) {
      for (int i = 0; block >= 0 && i < d; ++i) g_rest[in_rest[block] + i] += ends[i];
    });
  }
  if (columns == 1)
    rest_.solve(G_rest_, G_rest_);
  else
    rest_.solve(G_rest_, G_rest_, columns);
  for (std::int64_t c = 0; c < columns; ++c) {
    const double* x_rest = G_rest_.data() + c * rest_size;
    for_each_end(c, [&](std::int32_t block, double* ends) {
      for (int i = 0; i < d; ++i) ends[i] = block < 0 ? 0.0 : x_rest[in_rest[block] + i];
    });
  }
  for_each_group(chains_, [&](int group) {
    for (std::int64_t c = 0; c < columns; ++c) {
      chain_kernels().backward(chains_.group(group), panel(group), y_of(group, c),
                               ends_of(group, c), X.data() + c * size);
    }
  });
  for (std::int64_t c = 0; c < columns; ++c) {
    const double* x_rest = G_rest_.data() + c * rest_size;
    for (std::size_t k = 0; k < separators.size(); ++k) {
      std::copy(x_rest + in_rest[k], x_rest + in_rest[k + 1],
                X.data() + c * size + offsets[separators[k]]);
    }
  }
}

void ChainCholesky::solve(std::span<const double> G, std::span<double> X, int columns) {
  if (chains_.empty()) return rest_.solve(G, X, columns);
  const auto size = static_cast<std::size_t>(structure_->size());
  if (G.size() != size * static_cast<std::size_t>(columns) || X.size() != G.size())
    throw std::logic_error("solve: right-hand sides or solutions are not size × columns");
  for (int begin = 0; begin < columns; begin += kColumnsTogether) {
    const int count = std::min(kColumnsTogether, columns - begin);
    solve_together(G.subspan(begin * size, count * size), X.subspan(begin * size, count * size),
                   count);
  }
}

void ChainCholesky::inverse_columns(std::span<const std::int64_t> scalars, std::span<double> X) {
  if (chains_.empty()) return rest_.inverse_columns(scalars, X);
  const auto size = static_cast<std::size_t>(structure_->size());
  if (X.size() != size * scalars.size())
    throw std::logic_error("inverse_columns: the result is not size × columns");
  std::ranges::fill(X, 0.0);
  for (std::size_t c = 0; c < scalars.size(); ++c)
    X[c * size + static_cast<std::size_t>(scalars[c])] = 1.0;
  solve(X, X, static_cast<int>(scalars.size()));
}

double ChainCholesky::log_determinant() {
  if (!chains_.empty() && !factorized_)
    throw std::logic_error("log_determinant: there is no factorisation");
  double sum = 0.0;
  const int d = chains_.block_size(), lanes = chains_.lanes();
  for (const Chains::Chain& chain : chains_.chains()) {
    const double* numbers = panel(chain.group) + chain.lane;
    for (std::size_t k = 0; k < chain.length; ++k, numbers += panel_numbers() * lanes) {
      for (int i = 0; i < d; ++i) sum -= std::log(numbers[(d * (d - 1) / 2 + i) * lanes]);
    }
  }
  return 2.0 * sum + rest_.log_determinant();
}

std::int64_t ChainCholesky::factor_nonzeros() const {
  std::int64_t sum = rest_.cholesky().symbolic().factor_nonzeros;
  const std::int64_t d = chains_.block_size();
  for (const Chains::Chain& chain : chains_.chains()) {
    const auto length = static_cast<std::int64_t>(chain.length);
    sum += length * d * (d + 1) / 2 + (length - 1) * d * d;
    sum += (chain.first >= 0 ? length : 0) * d * d + (chain.last >= 0 ? d * d : 0);
  }
  return sum;
}

double ChainCholesky::factor_flops() const {
  double sum = rest_.cholesky().symbolic().factor_flops;
  const int d = chains_.block_size();
  for (const Chains::Chain& chain : chains_.chains()) {
    for (std::size_t k = 0; k < chain.length; ++k) {
      const bool next = k + 1 < chain.length || chain.last >= 0;
      const int below = (next ? d : 0) + (chain.first >= 0 ? d : 0);
      for (int i = 1; i <= d; ++i) sum += double(below + i) * (below + i);
    }
  }
  return sum;
}

std::string ChainCholesky::description() const {
  std::string text;
  if (!chains_.empty()) {
    text = std::to_string(chains_.nodes().size()) + " variables in " +
           std::to_string(chains_.chains().size()) + " chains, ";
  }
  text += std::to_string(rest_.cholesky().symbolic().supernodes().size()) + " supernodes, " +
          std::string(rest_.cholesky().kernel_set()) + " kernels";
  const std::string refinement = rest_.description();
  return refinement.empty() ? text : text + "; " + refinement;
}

void ChainInverse::compute() {
  const Chains& chains = cholesky_->chains_;
  if (!chains.empty() && !cholesky_->factorized_)
    throw std::logic_error("inverse: there is no factorisation");
  cholesky_->rest_.require_double();
  rest_.compute();
  if (chains.empty()) return;
  const auto d = static_cast<std::size_t>(chains.block_size());
  blocks_.resize(chains.nodes().size() * 3 * d * d);
  chain_of_.assign(cholesky_->order_.size(), -1);
  place_of_.assign(cholesky_->order_.size(), -1);
  for (std::size_t c = 0; c < chains.chains().size(); ++c) {
    const Chains::Chain& chain = chains.chains()[c];
    for (std::size_t k = 0; k < chain.length; ++k) {
      chain_of_[chains.nodes()[chain.begin + k]] = static_cast<std::int32_t>(c);
      place_of_[chains.nodes()[chain.begin + k]] = static_cast<std::int32_t>(chain.begin + k);
    }
  }
  for_each_range(chains.chains().size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t c = begin; c < end; ++c) d == 3 ? invert<3>(c) : invert<6>(c);
  });
}

/// With n the next node, a the first separator, Y = L_RJ L_JJ⁻¹: the recursion of `SelectedInverse`
/// with R = {n, a}.
template <int D>
void ChainInverse::invert(std::size_t c) {
  using Block = Eigen::Matrix<double, D, D>;
  using Rows = Eigen::Matrix<double, D, D, Eigen::RowMajor>;
  const Chains& chains = cholesky_->chains_;
  const Chains::Chain& chain = chains.chains()[c];
  const int lanes = chains.lanes();
  const auto known = [&](std::int32_t i, std::int32_t j) {
    Block Z = Block::Zero();
    if (i >= 0 && j >= 0) rest_.block(i, j, Z.data());
    return Z;
  };
  const Block Z_aa = known(chain.first, chain.first);
  Block Z_nn = known(chain.last, chain.last), Z_na = known(chain.last, chain.first);
  for (std::size_t k = chain.length; k-- > 0;) {
    const double* numbers = cholesky_->panel(chain.group) +
                            static_cast<std::int64_t>(k) * cholesky_->panel_numbers() * lanes +
                            chain.lane;
    const auto number = [&](int i) { return numbers[i * lanes]; };
    constexpr int kPivots = D * (D - 1) / 2, kV = kPivots + D, kW = kV + D * D;
    // L⁻¹, and V and W as the kernels have them.
    Block inverse = Block::Zero();
    Rows V, W;
    for (int col = 0; col < D; ++col) {
      for (int r = col; r < D; ++r) {
        double sum = r == col ? 1.0 : 0.0;
        for (int j = col; j < r; ++j) sum -= number(r * (r - 1) / 2 + j) * inverse(j, col);
        inverse(r, col) = sum * number(kPivots + r);
      }
    }
    for (int i = 0; i < D * D; ++i) {
      V.data()[i] = number(kV + i);
      W.data()[i] = number(kW + i);
    }
    const Block Y_n = V.transpose() * inverse, Y_a = W.transpose() * inverse;
    const Block Z_nk = -(Z_nn * Y_n + Z_na * Y_a);
    const Block Z_ak = -(Z_na.transpose() * Y_n + Z_aa * Y_a);
    Block Z_kk = inverse.transpose() * inverse - (Y_n.transpose() * Z_nk + Y_a.transpose() * Z_ak);
    for (int row = 0; row < D; ++row) {  // symmetric to the last bit
      for (int col = row + 1; col < D; ++col) Z_kk(row, col) = Z_kk(col, row);
    }
    double* out = blocks_.data() + (chain.begin + k) * 3 * D * D;
    Eigen::Map<Block>{out} = Z_kk;
    Eigen::Map<Block>{out + D* D} = Z_nk;
    Eigen::Map<Block>{out + 2 * D* D} = Z_ak;
    Z_nn = Z_kk;
    Z_na = Z_ak.transpose();
  }
}

void ChainInverse::diagonal_blocks(std::span<double> out) const {
  const Chains& chains = cholesky_->chains_;
  if (chains.empty()) return rest_.diagonal_blocks(out);
  std::size_t used = 0;
  for (const std::int32_t size : cholesky_->structure_->sizes())
    used += static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  if (out.size() != used)
    throw std::logic_error("diagonal_blocks: out does not have the size of all diagonal blocks");
  double* to = out.data();
  for (std::int32_t b = 0; b < cholesky_->structure_->blocks(); ++b) {
    const std::int32_t size = cholesky_->structure_->block_size(b);
    block(b, b, to);
    to += size * size;
  }
}

/// Z_ij if i is on a chain and j is not eliminated before it.
bool ChainInverse::on_chain(std::int32_t i, std::int32_t j, double* out) const {
  const Chains& chains = cholesky_->chains_;
  if (chain_of_[i] < 0) return false;
  const Chains::Chain& chain = chains.chains()[chain_of_[i]];
  const auto d = static_cast<std::size_t>(chains.block_size()),
             k = static_cast<std::size_t>(place_of_[i]);
  const auto separator = [&](std::int32_t block) {
    return block < 0 ? -1 : chains.separators()[block];
  };
  const bool last = k + 1 == chain.begin + chain.length;
  const std::int32_t next = last ? separator(chain.last) : chains.nodes()[k + 1];
  const double* from = blocks_.data() + k * 3 * d * d;
  // Stored are Z_ii, Z_ni and Z_ai; asked for is Z_ij.
  if (j == i) {
    std::copy_n(from, d * d, out);
    return true;
  }
  if (j != next && j != separator(chain.first)) return false;
  from += (j == next ? 1 : 2) * d * d;
  for (std::size_t c = 0; c < d; ++c) {
    for (std::size_t r = 0; r < d; ++r) out[c * d + r] = from[r * d + c];
  }
  return true;
}

bool ChainInverse::block(std::int32_t i, std::int32_t j, double* out) const {
  const Chains& chains = cholesky_->chains_;
  if (chains.empty()) return rest_.block(i, j, out);
  const std::int32_t a = chains.place_in_rest()[i], b = chains.place_in_rest()[j];
  if (a >= 0 && b >= 0) return rest_.block(a, b, out);
  if (on_chain(i, j, out)) return true;
  if (!on_chain(j, i, out)) return false;
  const int d = chains.block_size();
  for (int c = 0; c < d; ++c) {
    for (int r = 0; r < c; ++r) std::swap(out[c * d + r], out[r * d + c]);
  }
  return true;
}

}  // namespace cairn::block
