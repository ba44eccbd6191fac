// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

namespace cairn::incremental {

/// Follows the connected components of a graph that grows, and determines which variables are
/// constant, as `resolve_gauge` would: those marked as fixed, those without any factor, and one
/// pose of each component whose gauge is free otherwise. What leaves the graph needs a new watch.
class GaugeWatch {
 public:
  /// The next variable. `anchors`: its states form a group, so that anchoring it does not change
  /// the minimum.
  void add_variable(int tangent, bool anchors, bool fixed);
  /// A factor on these variables, which measures `absolute` numbers of where they are.
  void add_factor(const std::int32_t* variables, int arity, int absolute);
  void set_fixed(std::int32_t v);

  /// Calls set(v, constant) for every variable for which that may have changed since the last call.
  template <class Set>
  void settle(Set set) {
    for (const std::int32_t v : dirty_) settle_one(v, set);
    dirty_.clear();
  }
  /// Components whose gauge is free, since their first pose is no group or priors determine a part.
  bool left_free(std::int32_t v);
  bool anchored(std::int32_t v) { return components_[root(v)].anchor == v; }

 private:
  struct Component {
    std::int32_t parent;
    std::int32_t largest_tangent;
    std::int32_t first_largest;
    std::int64_t absolute = 0;
    std::int32_t anchor = -1;
    bool fixed;
    bool touched = false;
  };
  std::int32_t root(std::int32_t v);
  bool floats(const Component& c) const {
    return c.touched && !c.fixed && c.absolute < c.largest_tangent;
  }
  /// An anchor changes no minimum where the first pose is a group, and no prior pulls at it.
  bool may_be_anchored(const Component& c) const {
    return c.absolute == 0 && anchors_[c.first_largest];
  }
  template <class Set>
  void settle_one(std::int32_t v, Set& set) {
    if (released_[v]) {
      released_[v] = 0;
      set(v, fixed_[v] != 0);
    }
    Component& c = components_[root(v)];
    if (!c.touched) return set(v, true);
    if (!touched_[v]) touched_[v] = 1, set(v, fixed_[v] != 0);
    const std::int32_t anchor = floats(c) && may_be_anchored(c) ? c.first_largest : -1;
    if (anchor == c.anchor) return;
    if (c.anchor >= 0) set(c.anchor, fixed_[c.anchor] != 0);
    c.anchor = anchor;
    if (anchor >= 0) touched_[anchor] = 1, set(anchor, true);
  }

  std::vector<Component> components_;  // by variable: its own if it is a root
  std::vector<std::uint8_t> anchors_, fixed_, touched_, released_;
  std::vector<std::int32_t> dirty_;
};

}  // namespace cairn::incremental
