// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <set>
#include <span>
#include <vector>

#include "cairn/graph/free_directions.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// What an estimator's factors leave free, from one update to the next: as long as factors and
/// variables are only added, and everything was determined before, only what is new is searched.
class CAIRN_API FreedomWatch {
 public:
  /// The linear system of the estimator, by variables and factors of its graph.
  struct System {
    const Graph& graph;
    std::function<bool(int)> held;  ///< constant, if only to fix the gauge
    std::function<bool(int)> live;  ///< a factor that has not been removed
    /// Its whitened Jacobian, as for `LinearRows`.
    std::function<void(int, std::span<double>)> jacobian;
  };

  /// Something has been removed, changed or renumbered: the next look is at everything.
  void forget() { *this = {}; }
  /// To be called after additions, before they are solved for.
  const FreeDirections& look(const System& system);
  const FreeDirections& free() const { return free_; }

 private:
  bool only_added(const System& system) const;
  bool look_at_new(const System& system);
  void look_at_all(const System& system);

  FreeDirections free_;
  bool determined_ = false;          ///< everything, at the last look
  bool given_up_ = false;            ///< that look found no answer, and the next would not
  int variables_ = 0, factors_ = 0;  ///< that were searched
  std::set<int> idle_;               ///< variables of these without a factor
  std::vector<int> anchors_;         ///< of these, that were held and are not fixed
};

}  // namespace cairn
