// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cairn/report/number_table.hpp"
#include "cairn/sparsification/recovery.hpp"

namespace cairn::app {

/// How the KLD of recoveries falls, as in Figures 4.6 and 4.7 of the thesis: its mean over all
/// problems of one size against time or iterations.
class RecoveryCurves {
 public:
  enum class Against { seconds, iterations };
  explicit RecoveryCurves(Against against) : against_(against) {}

  /// Adds a run on a problem of so many nodes. `trace` begins where the recovery did.
  void add(const std::string& recovery, int nodes, std::span<const RecoveryPoint> trace);
  /// A column for each recovery and size, named RECOVERY@NODES. A run that has ended stays at its
  /// last KLD. Times are on a logarithmic grid between the first step of any run and the end of the
  /// longest.
  NumberTable table() const;

 private:
  Against against_;
  std::map<std::pair<std::string, int>, std::vector<std::vector<RecoveryPoint>>> runs_;
};

}  // namespace cairn::app
