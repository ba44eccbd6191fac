// SPDX-License-Identifier: BSD-3-Clause
#include "information_form.hpp"

#include <algorithm>
#include <span>

namespace cairn::linearized {

using Eigen::MatrixXd;
using Eigen::VectorXd;

void InformationForm::begin(std::span<const Id> variables, std::span<const int> sizes,
                            std::span<const Rows>) {
  offsets_.clear();
  sizes_.clear();
  variables_.clear();
  block_.clear();
  Lambda_.clear();
  eta_.clear();
  d_.clear();
  structure_.reset();
  factorized_ = false;
  for (std::size_t k = 0; k < variables.size(); ++k) add_variable(variables[k], sizes[k]);
}

void InformationForm::add_variable(Id id, int size) {
  block_.emplace(id, static_cast<std::int32_t>(sizes_.size()));
  offsets_.add(id, size);
  sizes_.push_back(size);
  variables_.push_back(id);
  eta_.resize(static_cast<std::size_t>(offsets_.size()), 0.0);
  d_.resize(eta_.size(), 0.0);
  structure_.reset();
  factorized_ = false;
}

void InformationForm::add(const Rows& rows) {
  factorized_ = false;
  Eigen::Index at = 0;
  for (std::size_t a = 0; a < rows.variables.size(); ++a) {
    const auto J_a = rows.J.middleCols(at, rows.sizes[a]);
    at += rows.sizes[a];
    Eigen::Map<VectorXd>(eta_.data() + offsets_.offset(rows.variables[a]), rows.sizes[a]) -=
        J_a.transpose() * rows.c;
    Eigen::Index next = 0;
    for (std::size_t b = 0; b < rows.variables.size(); ++b) {
      const auto J_b = rows.J.middleCols(next, rows.sizes[b]);
      next += rows.sizes[b];
      const std::pair<std::int32_t, std::int32_t> place(block_.at(rows.variables[a]),
                                                        block_.at(rows.variables[b]));
      if (place.first < place.second) continue;
      auto [entry, is_new] =
          Lambda_.try_emplace(place, MatrixXd::Zero(rows.sizes[a], rows.sizes[b]));
      entry->second.noalias() += J_a.transpose() * J_b;
      if (is_new && place.first != place.second) structure_.reset();
    }
  }
}

std::span<const double> InformationForm::displacement() {
  if (sizes_.empty()) return d_;
  // The solution is refined from the last: what is solved for is small.
  std::vector<double> rest(d_.size());
  H_.multiply(d_, rest);
  for (std::size_t k = 0; k < rest.size(); ++k) rest[k] = eta_[k] - rest[k];
  cholesky_->solve(rest, rest);
  for (std::size_t k = 0; k < rest.size(); ++k) d_[k] += rest[k];
  return d_;
}

bool InformationForm::factorize() {
  if (factorized_ || sizes_.empty()) return true;
  if (!structure_) {
    std::vector<std::pair<std::int32_t, std::int32_t>> entries;
    for (const auto& [place, block] : Lambda_) {
      if (place.first != place.second) entries.push_back(place);
    }
    structure_ = std::make_unique<BlockStructure>(sizes_, std::move(entries));
    H_ = BlockMatrix(*structure_);
    if (!cholesky_) cholesky_ = std::make_unique<block::SupernodalCholesky>();
    cholesky_->analyze(*structure_, "amd");
  }
  H_.set_zero();
  for (const auto& [place, block] : Lambda_)
    std::ranges::copy(block.reshaped(), H_.block(structure_->find(place.first, place.second)));
  const Factorization result = cholesky_->factorize(H_);
  factorized_ = result.ok;
  if (!result.ok)
    undetermined_ = variables_[static_cast<std::size_t>(std::max(0, result.failed_block))];
  return result.ok;
}

void InformationForm::multiply_covariance(std::span<const double> g, std::span<double> x) {
  if (factorize() && !x.empty()) cholesky_->solve(g, x);
}

std::int64_t InformationForm::memory() const { return cholesky_ ? 8 * cholesky_->numbers() : 0; }

void InformationForm::changed(bool blocks) {
  factorized_ = false;
  if (blocks) structure_.reset();
}

void InformationForm::copy_to(InformationForm& copy) const {
  copy.offsets_ = offsets_;
  copy.sizes_ = sizes_;
  copy.variables_ = variables_;
  copy.block_ = block_;
  copy.Lambda_ = Lambda_;
  copy.eta_ = eta_;
  copy.d_ = d_;
  copy.undetermined_ = undetermined_;
}

std::unique_ptr<GaussianForm> InformationForm::clone() const {
  auto copy = std::make_unique<InformationForm>();
  copy_to(*copy);
  return copy;
}

}  // namespace cairn::linearized
