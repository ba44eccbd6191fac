// SPDX-License-Identifier: BSD-3-Clause
#include "states.hpp"

#include <utility>

namespace cairn::incremental {

void States::add(std::shared_ptr<const VariableType> type, std::span<const double> state) {
  records_.push_back({.type = std::move(type),
                      .place = std::ssize(x_),
                      .ambient = static_cast<std::int32_t>(state.size())});
  x_.insert(x_.end(), state.begin(), state.end());
}

void States::remember() {
  log_.clear();
  logged_.clear();
}

void States::log(std::int32_t v) {
  const Record& record = records_[v];
  log_.push_back({v, false, logged_.size(), static_cast<std::size_t>(record.ambient)});
  logged_.insert(logged_.end(), x_.begin() + record.place,
                 x_.begin() + record.place + record.ambient);
}

void States::lead(std::int32_t v, const double* g) {
  log(v);
  double* x = x_.data() + records_[v].place;
  records_[v].type->lie_group()->compose(g, x, x);
}

void States::move(std::int32_t v, const double* delta) {
  log(v);
  const Record& record = records_[v];
  const std::int64_t first = 0;
  double* x = x_.data() + record.place;
  record.type->retract(1, x, &first, delta, x);
}

}  // namespace cairn::incremental
