// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include <boost/json/array.hpp>

#include "cairn/plugin/registry.hpp"
#include "cairn/sparsification/sparsification.hpp"
#include "recovery_curves.hpp"

namespace cairn::app {

/// Collects sparsification problems as they come up, for `--record`.
class ProblemRecorder {
 public:
  void add(const SparsificationRecord& record);
  /// {"problems": [{"removed", "blanket", "variable", "factor", "states", "sizes", "information"
  /// (upper triangle), "models": [{"nodes", "size", "jacobian" (of those nodes)}], "kld"}]}
  std::string text() const;
  std::size_t size() const { return problems_.size(); }

 private:
  boost::json::array problems_;
};

/// The problems of a file that `--record` has written. Throws `Error` (input).
std::vector<DenseBlanket> read_problems(const std::string& file);

/// How one topology and one recovery did on problems of one size.
struct ReplayRow {
  std::string topology, recovery;
  int nodes = 0;  ///< 0: of all sizes
  int problems = 0;
  int refused = 0;                        ///< that the topology or the method could not do
  double kld = 0.0, kld_deviation = 0.0;  ///< mean [nats]
  double factors = 0.0;                   ///< mean
  double topology_seconds = 0.0, recovery_seconds = 0.0;  ///< mean
  double recovery_median = 0.0;                           ///< [s]
  double iterations = 0.0;
  int not_converged = 0, not_positive = 0;
  std::map<std::string, int> notes;  ///< of the topology, with the number of problems
  double largest_excess = 0.0;  ///< KLD above the lowest of all recoveries of that topology [nats]
};

/// Solves every problem with every topology and recovery, interleaved: each problem by all in turn.
/// `population` as the sparsifier takes it, but for loss. `step` is called with the number of
/// problems solved, and returns whether to go on. `curves`, unless null, gets each recovery's
/// trace.
std::vector<ReplayRow> replay_problems(const std::vector<DenseBlanket>& problems,
                                       const std::vector<std::string>& topologies,
                                       const std::string& population,
                                       const std::vector<std::string>& recoveries,
                                       const std::function<bool(std::size_t)>& step,
                                       Registry& registry, RecoveryCurves* curves = nullptr);

}  // namespace cairn::app
