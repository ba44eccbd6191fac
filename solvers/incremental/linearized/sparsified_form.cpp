// SPDX-License-Identifier: BSD-3-Clause
#include "sparsified_form.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "dense/cholesky.hpp"

namespace cairn::linearized {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// The Schur complement of some rows and columns of A, in the place of those that stay, and zero
/// elsewhere.
MatrixXd marginal(const MatrixXd& A, const std::vector<int>& stay, const std::vector<int>& leave) {
  MatrixXd result = MatrixXd::Zero(A.rows(), A.cols());
  MatrixXd left = A(stay, stay);
  if (!leave.empty()) {
    const MatrixXd across = A(leave, stay), of = A(leave, leave);
    left -= across.transpose() * Eigen::LLT<MatrixXd>(of).solve(across);
  }
  result(stay, stay) = left;
  return result;
}

}  // namespace

// What it is made of ------------------------------------------------------------------------------

void SparsifiedForm::begin(std::span<const Id> variables, std::span<const int> sizes,
                           std::span<const Rows> rows) {
  links_.clear();
  unsettled_.clear();
  next_ = 0;
  InformationForm::begin(variables, sizes, rows);
}

void SparsifiedForm::add_variable(Id id, int size) {
  unsettled_.insert(static_cast<int>(links_.size()));
  links_.emplace_back();
  InformationForm::add_variable(id, size);
}

void SparsifiedForm::add(const Rows& rows) {
  InformationForm::add(rows);
  for (const Id a : rows.variables) {
    for (const Id b : rows.variables) {
      if (a != b) links_[static_cast<std::size_t>(block_.at(a))].insert(block_.at(b));
    }
  }
}

MatrixXd SparsifiedForm::block(int a, int b) const {
  const auto found = Lambda_.find(std::minmax(a, b, std::greater{}));
  if (found == Lambda_.end())
    return MatrixXd::Zero(sizes_[static_cast<std::size_t>(a)], sizes_[static_cast<std::size_t>(b)]);
  return a >= b ? found->second : MatrixXd(found->second.transpose());
}

void SparsifiedForm::add_to_block(int a, int b, const MatrixXd& change) {
  if (a < b) return;  // the lower half is what there is
  auto [at, is_new] = Lambda_.try_emplace({a, b}, MatrixXd::Zero(change.rows(), change.cols()));
  at->second += change;
  if (a == b) return;
  links_[static_cast<std::size_t>(a)].insert(b);
  links_[static_cast<std::size_t>(b)].insert(a);
}

Eigen::Map<VectorXd> SparsifiedForm::part(std::vector<double>& of, int block) const {
  const auto at = static_cast<std::size_t>(block);
  return {of.data() + offsets_.offset(variables_[at]), sizes_[at]};
}

// The mean ----------------------------------------------------------------------------------------

/// Without a factorisation only the blocks of single variables show what is not determined.
bool SparsifiedForm::settle() {
  if (recovery_ == MeanRecovery::exact) return InformationForm::settle();
  for (auto at = unsettled_.begin(); at != unsettled_.end();) {
    const Eigen::LLT<MatrixXd> llt(block(*at, *at));
    if (llt.info() != Eigen::Success) {
      undetermined_ = variables_[static_cast<std::size_t>(*at)];
      return false;
    }
    at = unsettled_.erase(at);
  }
  return true;
}

std::span<const double> SparsifiedForm::displacement() {
  if (sizes_.empty()) return d_;
  const bool exact = recovery_ == MeanRecovery::exact || std::exchange(fully_, false);
  if (exact && factorize()) {
    InformationForm::displacement();
  } else {
    approach_mean();
  }
  sparsify();
  return d_;
}

/// The newest pose and what is linked with it, then others in turn.
void SparsifiedForm::approach_mean() {
  const int blocks = static_cast<int>(std::ssize(sizes_));
  int left = std::min(steps_, blocks);
  if (const auto at = block_.find(newest_); at != block_.end()) {
    step(at->second);
    --left;
    for (const int linked : links_[static_cast<std::size_t>(at->second)]) {
      if (left-- > 0) step(linked);
    }
  }
  for (; left > 0; --left) {
    step(next_ % blocks);
    next_ = (next_ + 1) % blocks;
  }
}

/// d_i ← Λ_ii⁻¹ (η_i − Σ_j Λ_ij d_j).
void SparsifiedForm::step(int i) {
  VectorXd rest = part(eta_, i);
  for (const int j : links_[static_cast<std::size_t>(i)]) rest -= block(i, j) * part(d_, j);
  part(d_, i) = Eigen::LLT<MatrixXd>(block(i, i)).solve(rest);
}

// Links -------------------------------------------------------------------------------------------

void SparsifiedForm::sparsify() {
  const auto newest = block_.find(newest_);
  if (newest == block_.end()) return;
  const int x = newest->second;
  std::vector<std::pair<double, int>> linked;
  const Eigen::LLT<MatrixXd> root_x(block(x, x));
  for (const int j : links_[static_cast<std::size_t>(x)]) {
    const Eigen::LLT<MatrixXd> root_j(block(j, j));
    const MatrixXd half = root_x.matrixL().solve(block(x, j));
    linked.emplace_back(root_j.matrixL().solve(half.transpose()).norm(), j);
  }
  if (std::ssize(linked) <= active_) return;
  std::ranges::stable_sort(linked, std::greater{}, &std::pair<double, int>::first);
  // Of x, m⁺ and m⁰, in this order, m⁻ being held: a block of Λ.
  std::vector<int> nodes{x}, of_x, of_kept, of_given_up, begin;
  for (const auto& [strength, j] : linked) nodes.push_back(j);
  int size = 0;
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    begin.push_back(size);
    std::vector<int>& rows = k == 0 ? of_x : static_cast<int>(k) <= active_ ? of_kept : of_given_up;
    for (int row = 0; row < sizes_[static_cast<std::size_t>(nodes[k])]; ++row)
      rows.push_back(size++);
  }
  MatrixXd held(size, size);
  for (std::size_t a = 0; a < nodes.size(); ++a) {
    for (std::size_t b = 0; b < nodes.size(); ++b) {
      const MatrixXd of = block(nodes[a], nodes[b]);
      held.block(begin[a], begin[b], of.rows(), of.cols()) = of;
    }
  }
  const auto joined = [](std::vector<int> rows, const std::vector<int>& more) {
    rows.insert(rows.end(), more.begin(), more.end());
    return rows;
  };
  const MatrixXd change = marginal(held, joined(of_x, of_kept), of_given_up) -
                          marginal(held, of_kept, joined(of_x, of_given_up)) +
                          marginal(held, joined(of_kept, of_given_up), of_x) - held;
  VectorXd mean(size);
  for (std::size_t a = 0; a < nodes.size(); ++a)
    mean.segment(begin[a], sizes_[static_cast<std::size_t>(nodes[a])]) = part(d_, nodes[a]);
  const VectorXd shift = change * mean;
  for (std::size_t a = 0; a < nodes.size(); ++a) {
    const int rows = sizes_[static_cast<std::size_t>(nodes[a])];
    part(eta_, nodes[a]) += shift.segment(begin[a], rows);
    for (std::size_t b = 0; b < nodes.size(); ++b) {
      add_to_block(
          nodes[a], nodes[b],
          change.block(begin[a], begin[b], rows, sizes_[static_cast<std::size_t>(nodes[b])]));
    }
  }
  for (std::size_t k = 1 + static_cast<std::size_t>(active_); k < nodes.size(); ++k) {
    Lambda_.erase({std::max(x, nodes[k]), std::min(x, nodes[k])});
    links_[static_cast<std::size_t>(x)].erase(nodes[k]);
    links_[static_cast<std::size_t>(nodes[k])].erase(x);
  }
  changed(/*blocks=*/true);
}

// Copies ------------------------------------------------------------------------------------------

std::int64_t SparsifiedForm::memory() const {
  std::int64_t doubles = 0;
  for (const auto& [place, of] : Lambda_) doubles += of.size();
  return InformationForm::memory() + 8 * doubles;
}

std::unique_ptr<GaussianForm> SparsifiedForm::clone() const {
  auto copy = std::make_unique<SparsifiedForm>(active_, recovery_, steps_);
  copy_to(*copy);
  copy->newest_ = newest_;
  copy->fully_ = fully_;
  copy->links_ = links_;
  copy->unsettled_ = unsettled_;
  copy->next_ = next_;
  return copy;
}

}  // namespace cairn::linearized
