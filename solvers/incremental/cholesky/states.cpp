// SPDX-License-Identifier: BSD-3-Clause
#include "states.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "add_product.hpp"

namespace cairn::incremental {
void States::add(std::shared_ptr<const VariableType> type, std::span<const double> state) {
  const std::int32_t tangent = type->tangent_size();
  const bool group = type->lie_group() != nullptr;
  records_.push_back({.type = std::move(type),
                      .place = std::ssize(frames_),
                      .ambient = static_cast<std::int32_t>(state.size()),
                      .matrices = std::ssize(adjoints_),
                      .tangent = tangent,
                      .first = std::ssize(travelled_),
                      .group = group});
  estimate_.add(state);
  travelled_.resize(travelled_.size() + static_cast<std::size_t>(tangent), 0.0);
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

void States::lead(std::int32_t v, const double* g, const double* twist) {
  log(v);
  Record& record = records_[v];
  double* x = estimate_.x(v);
  record.type->lie_group()->compose(g, x, x);
  record.away = true;
  record.known = false;
  if (twist)
    add_product(record.tangent, world_to_frame(v), record.tangent, twist,
                travelled_.data() + record.first);
}

void States::move(std::span<const std::int32_t> variables, const double* steps) {
  for (std::size_t begin = 0; begin < variables.size();) {
    const auto first = variables.begin() + static_cast<std::ptrdiff_t>(begin);
    const VariableType* type = records_[*first].type.get();
    const auto end = std::find_if(first, variables.end(),
                                  [&](std::int32_t v) { return records_[v].type.get() != type; });
    move_alike({first, end}, steps);
    begin += static_cast<std::size_t>(end - first);
  }
}

/// For variables of one type, which are moved several at a time.
void States::move_alike(std::span<const std::int32_t> variables, const double* steps) {
  const Record& one = records_[variables.front()];
  const std::int32_t ambient = one.ambient, tangent = one.tangent;
  const std::size_t before = logged_.size(), doubles = static_cast<std::size_t>(ambient);
  logged_.resize(before + variables.size() * doubles);
  moved_.resize(variables.size() * doubles);
  turned_.assign(variables.size() * static_cast<std::size_t>(tangent), 0.0);
  turned_at_.resize(variables.size());
  for (std::size_t i = 0; i < variables.size(); ++i) {
    const std::int32_t v = variables[i];
    const Record& record = records_[v];
    const std::size_t place = before + i * doubles;
    log_.push_back({v, false, place, doubles});
    std::copy_n(x(v), ambient, logged_.data() + place);
    std::copy_n(x(v), ambient, moved_.data() + i * doubles);
    const double* step = steps + record.first;
    double* const travelled = travelled_.data() + record.first;
    for (std::int32_t k = 0; k < tangent; ++k) travelled[k] += step[k];
    turned_at_[i] = static_cast<std::int64_t>(i) * tangent;
    double* const turned = turned_.data() + turned_at_[i];
    if (record.away) {
      add_product(tangent, frame_to_body(v), tangent, step, turned);
    } else {
      std::copy_n(step, tangent, turned);
    }
  }
  one.type->retract(variables.size(), moved_.data(), turned_at_.data(), turned_.data(),
                    moved_.data());
  const double* next = moved_.data();
  for (const std::int32_t v : variables) {
    std::copy_n(next, ambient, estimate_.x(v));
    next += ambient;
    records_[v].away = records_[v].group;
    records_[v].known = false;
  }
}

void States::put_frame_here(std::int32_t v) {
  Record& record = records_[v];
  std::copy_n(x(v), record.ambient, frames_.begin() + record.place);
  record.away = record.known = false;
  std::fill_n(travelled_.begin() + record.first, record.tangent, 0.0);
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
