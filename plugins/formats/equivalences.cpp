// SPDX-License-Identifier: BSD-3-Clause
#include "equivalences.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include <fmt/core.h>

#include "cairn/graph/packed.hpp"

namespace cairn::formats {
namespace {

constexpr double kFarApart = 5.0;  // standard deviations per root of a degree of freedom

/// The error of a factor between two variables that are one, in standard deviations per root of a
/// degree of freedom.
double norm_where_one(Draft& draft, const Draft::Factor& factor) {
  const Draft::FactorKind& kind = draft.factor(factor.kind);
  const Draft::FactorSlots slots = draft.slots(factor);
  const Draft::VariableKind& variable = draft.variable(kind.variable_kinds[0]);
  std::vector<double> state(static_cast<std::size_t>(variable.size)), z(slots.measurement.size()),
      root(slots.information.size()), error(static_cast<std::size_t>(kind.residual));
  variable.type->identity(state.data());
  std::ranges::copy(slots.measurement, z.begin());
  if (!square_root(slots.information, kind.residual, root) ||
      !kind.type->normalize(z.data()).empty())
    return 0.0;
  const std::array<const double*, 2> both{state.data(), state.data()};
  kind.type->evaluate(both.data(), z.data(), root.data(), error.data(), nullptr);
  double squared = 0.0;
  for (const double e : error) squared += e * e;
  return std::sqrt(squared / kind.residual);
}

}  // namespace

void Equivalences::apply(Draft& draft) {
  if (pairs_.empty()) return;
  check(draft);
  for (const Pair& pair : pairs_) join(pair);
  rename(draft);
  drop_loops(draft);
  const auto merged =
      std::ranges::count_if(parent_, [](const auto& p) { return p.first != p.second; });
  if (merged == 0) return;  // each with itself
  const Pair& first = *std::ranges::find_if(pairs_, [](const Pair& p) { return p.a != p.b; });
  draft.report().notes.push_back(fmt::format(
      "EQUIV makes {} {} one with another, of which the smallest id stays: {} and {} are {} by "
      "line "
      "{}",
      merged, merged == 1 ? "variable" : "variables", first.a, first.b, root(first.a), first.line));
}

Id Equivalences::root(Id id) {
  auto at = parent_.find(id);
  if (at == parent_.end()) return id;
  while (at->second != at->first) at = parent_.find(at->second);
  return at->first;
}

void Equivalences::join(const Pair& pair) {
  parent_.try_emplace(pair.a, pair.a);
  parent_.try_emplace(pair.b, pair.b);
  const Id a = root(pair.a), b = root(pair.b);
  parent_[std::max(a, b)] = std::min(a, b);
}

void Equivalences::check(Draft& draft) const {
  std::map<Id, std::int32_t> kinds;
  for (const Draft::Variable& variable : draft.variables()) kinds[variable.id] = variable.kind;
  if (kinds.empty()) {  // of a file without vertices: those that factors name
    for (const Draft::Factor& factor : draft.factors()) {
      const std::vector<std::int32_t>& of_factor = draft.factor(factor.kind).variable_kinds;
      const std::span<const Id> ids = draft.slots(factor).ids;
      for (std::size_t k = 0; k < ids.size(); ++k) kinds.try_emplace(ids[k], of_factor[k]);
    }
  }
  for (const Pair& pair : pairs_) {
    const std::string what = fmt::format("EQUIV {} {}", pair.a, pair.b);
    for (const Id id : {pair.a, pair.b}) {
      if (!kinds.contains(id))
        draft.fail(pair.line, fmt::format("{}: there is no vertex {} in this file", what, id));
    }
    const std::int32_t a = kinds[pair.a], b = kinds[pair.b];
    if (a != b) {
      draft.fail(pair.line,
                 fmt::format("{}: {} is a {} and {} a {}; expected two of one type", what, pair.a,
                             draft.variable(a).tag, pair.b, draft.variable(b).tag));
    }
  }
}

void Equivalences::rename(Draft& draft) {
  // A vertex that stands twice stays twice, so that it is refused.
  std::erase_if(draft.variables(), [&](const Draft::Variable& v) { return root(v.id) != v.id; });
  for (const Draft::Factor& factor : draft.factors()) {
    for (Id& id : draft.slots(factor).ids) id = root(id);
  }
  for (Draft::Held& held : draft.held()) held.id = root(held.id);
}

void Equivalences::drop_loops(Draft& draft) {
  std::int64_t dropped = 0;
  std::int64_t first = 0;
  std::string contradicted;  // the first that says that the two are not one
  std::erase_if(draft.factors(), [&](const Draft::Factor& factor) {
    const std::span<const Id> ids = draft.slots(factor).ids;
    // One variable that the file itself joins to itself is refused when the graph is built.
    if (ids.size() != 2 || ids[0] != ids[1] || !parent_.contains(ids[0])) return false;
    if (dropped++ == 0) first = factor.line;
    const double apart = norm_where_one(draft, factor);
    if (contradicted.empty() && apart > kFarApart) {
      contradicted = fmt::format(
          ". {} in line {} contradicts EQUIV: as one variable the two are {:.3g} standard "
          "deviations apart, so that one of the two lines is wrong",
          draft.factor(factor.kind).name, factor.line, apart);
    }
    return true;
  });
  if (dropped == 0) return;
  draft.report().notes.push_back(fmt::format(
      "{} left out, between variables that EQUIV makes one; the first is in line {}{}",
      dropped == 1 ? "1 factor" : fmt::format("{} factors", dropped), first, contradicted));
}

}  // namespace cairn::formats
