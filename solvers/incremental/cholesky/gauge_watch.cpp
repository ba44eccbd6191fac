// SPDX-License-Identifier: BSD-3-Clause
#include "gauge_watch.hpp"

#include <algorithm>
#include <utility>

namespace cairn::incremental {

void GaugeWatch::add_variable(int tangent, bool anchors, bool fixed) {
  const std::int32_t v = static_cast<std::int32_t>(components_.size());
  components_.push_back(
      {.parent = v, .largest_tangent = tangent, .first_largest = v, .fixed = fixed});
  anchors_.push_back(anchors);
  fixed_.push_back(fixed);
  touched_.push_back(0);
  released_.push_back(0);
  dirty_.push_back(v);
}

std::int32_t GaugeWatch::root(std::int32_t v) {
  while (components_[v].parent != v) {
    components_[v].parent = components_[components_[v].parent].parent;
    v = components_[v].parent;
  }
  return v;
}

void GaugeWatch::add_factor(const std::int32_t* variables, int arity, int absolute) {
  std::int32_t a = root(variables[0]);
  components_[a].touched = true;
  components_[a].absolute += absolute;
  dirty_.push_back(variables[0]);
  for (int k = 1; k < arity; ++k) {
    std::int32_t b = root(variables[k]);
    dirty_.push_back(variables[k]);
    if (a == b) continue;
    Component *into = &components_[a], *from = &components_[b];
    if (from->largest_tangent > into->largest_tangent ||
        (from->largest_tangent == into->largest_tangent &&
         from->first_largest < into->first_largest)) {
      std::swap(a, b);
      std::swap(into, from);
    }
    from->parent = a;
    into->absolute += from->absolute;
    into->fixed = into->fixed || from->fixed;
    into->touched = true;
    if (from->anchor >= 0) {
      released_[from->anchor] = 1;
      dirty_.push_back(from->anchor);
    }
  }
}

void GaugeWatch::set_fixed(std::int32_t v) {
  fixed_[v] = 1;
  components_[root(v)].fixed = true;
  released_[v] = 1;
  dirty_.push_back(v);
}

bool GaugeWatch::left_free(std::int32_t v) {
  const Component& c = components_[root(v)];
  return floats(c) && !may_be_anchored(c);
}

}  // namespace cairn::incremental
