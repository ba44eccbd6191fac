// SPDX-License-Identifier: BSD-3-Clause
#include "states.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace cairn::incremental {

void States::add(std::shared_ptr<const VariableType> type, std::span<const double> state) {
  const std::int32_t tangent = type->tangent_size();
  const bool group = type->lie_group() != nullptr;
  records_.push_back({.type = std::move(type),
                      .place = std::ssize(frames_),
                      .ambient = static_cast<std::int32_t>(state.size()),
                      .matrices = std::ssize(adjoints_),
                      .tangent = tangent,
                      .group = group});
  estimate_.add(state);
  frames_.insert(frames_.end(), state.begin(), state.end());
  if (!group) return;
  adjoints_.resize(adjoints_.size() + static_cast<std::size_t>(tangent * tangent));
  turns_.resize(adjoints_.size());
  put_frame_here(size() - 1);
}

void States::remember() {
  log_.clear();
  logged_.clear();
}

void States::log(std::int32_t v) {
  const Record& record = records_[v];
  log_.push_back({v, false, logged_.size(), static_cast<std::size_t>(record.ambient)});
  logged_.insert(logged_.end(), x(v), x(v) + record.ambient);
}

void States::lead(std::int32_t v, const double* g) {
  log(v);
  Record& record = records_[v];
  double* x = estimate_.x(v);
  record.type->lie_group()->compose(g, x, x);
  record.away = true;
  record.known = false;
}

void States::move(std::int32_t v, const double* delta) {
  log(v);
  Record& record = records_[v];
  const std::int64_t first = 0;
  double* x = estimate_.x(v);
  if (record.away) {
    const std::int32_t size = record.tangent;
    const double* T = frame_to_body(v);
    step_.assign(static_cast<std::size_t>(size), 0.0);
    for (std::int32_t c = 0; c < size; ++c) {
      for (std::int32_t r = 0; r < size; ++r) step_[r] += T[c * size + r] * delta[c];
    }
    delta = step_.data();
  }
  record.type->retract(1, x, &first, delta, x);
  record.away = record.group;
  record.known = false;
}

void States::put_frame_here(std::int32_t v) {
  Record& record = records_[v];
  std::copy_n(x(v), record.ambient, frames_.begin() + record.place);
  record.away = record.known = false;
  if (!record.group) return;
  const LieGroup& group = *record.type->lie_group();
  element_.resize(static_cast<std::size_t>(record.ambient));
  group.inverse(x(v), element_.data());
  group.adjoint(element_.data(), adjoints_.data() + record.matrices);
}

const double* States::frame_to_body(std::int32_t v) const {
  const Record& record = records_[v];
  double* T = turns_.data() + record.matrices;
  if (record.known) return T;
  frame_to_body(v, x(v), T);
  record.known = true;
  return T;
}

void States::frame_to_body(std::int32_t v, const double* x, double* T) const {
  records_[v].type->lie_group()->adjoint_between(x, frame(v), T);
}

}  // namespace cairn::incremental
