// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/evaluation/nonzeros.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/enum_names.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/sparsification/sparsification.hpp"
#include "cairn/types/loss.hpp"

namespace cairn {

/// Which kind of nodes may leave.
enum class NodeKind { poses, landmarks, all };
constexpr auto enum_names(NodeKind) {
  return std::to_array<EnumName<NodeKind>>(
      {{NodeKind::poses, "poses"}, {NodeKind::landmarks, "landmarks"}, {NodeKind::all, "all"}});
}

/// Which components take nodes out of a graph, and which nodes.
struct SparsifyJob {
  /// Half of the nodes, those with the fewest neighbours first.
  static constexpr const char* kDefaultSelection = "smallest_blanket:part=0.5";

  ComponentSpec sparsifier;  ///< with its options
  ComponentSpec selection;
  ComponentSpec optimizer;
  NodeKind nodes = NodeKind::poses;  ///< that the selection chooses from
  std::vector<Id> stay = {};  ///< of a whole graph: these do not leave, whatever the selection
  std::string linear_solver = "block_cholesky";    ///< for determinants
  std::string estimator = "incremental_cholesky";  ///< online
  int online = 0;                                  ///< online: take nodes out after so many poses
  RedirectionRule redirection{};                   ///< online: of factors on nodes that have left
  /// Online: one of so many nodes is known to stay, and factors to older nodes that are to leave
  /// are redirected at once (Vallvé 2018, section 4.6.4); 0: only once these have left.
  int redirect_early = 0;
  /// Of a whole graph: relative poses that are added measure what keeps the minimum where it is;
  /// else what their blanket's own minimum is, as in the thesis.
  bool keep_minimum = true;
  bool as_given = false;  ///< the graph is at its minimum: it is not optimised before
  bool measure = true;    ///< KLD, RMSE and conservative margin of the whole
  ComparedAt compared_at = ComparedAt::common;  ///< for the KLD
};

/// Where the sparsifier's topology is a tree and its options name no factor recovery: the closed
/// form, which is exact there; not with fit=graph, where factors are not alone.
CAIRN_API void choose_recovery(ComponentSpec& sparsifier);

struct SparsifyResult {
  Graph sparse;  ///< at its minimum
  Sparsification change;
  std::int64_t variables_before = 0, factors_before = 0;
  /// From the original graph; online, from a graph with the same factors redirected.
  std::optional<SparsificationError> error;
  double conservative_margin =
      std::nan("");  ///< see `conservative_margin`, of the same two; NaN: not known
  /// Online: distance of the estimate from the minimum of all factors as they arrived [m]; NaN: not
  /// known.
  double rmse_full = std::nan("");
  double chi2_before = 0.0, chi2_after = 0.0;
  double select_seconds = 0.0;
  Nonzeros nonzeros_before, nonzeros_after;  ///< of the same two graphs, if they were measured
  // Online
  std::int64_t redirected = 0, dropped = 0;  ///< factors on nodes that had left
  std::vector<double> steps;                 ///< seconds of each pose, sparsification included
  bool interrupted = false;
  /// Of the optimisations of whole graphs: the first that is not `converged`. With a tolerance of 0
  /// `max_iterations` is what was asked for, and no failure.
  Status status = Status::converged;
  bool converged = true;  ///< none of them failed
  std::vector<std::string> notes;

  CAIRN_API static ResultFields<SparsifyResult> fields();
};

/// How far a sparsification is.
struct SparsifyProgress {
  enum class Phase {
    select,  ///< nodes are about to be chosen
    remove,  ///< `done` of `total` chosen nodes are taken out
    feed,    ///< online: `done` of `total` poses are fed, `kept` variables are in the graph
    edges,   ///< loop closures are chosen (`sparsify_edges`): `done` of `total` steps
  };
  Phase phase = Phase::select;
  int done = 0, total = 0, kept = 0;

  /// Of the whole, 0 to 1; none while nodes are chosen.
  CAIRN_API std::optional<double> part() const;
  /// "3 of 10 nodes taken out"
  CAIRN_API std::string to_string() const;
};

/// The rest of the problem. Everything referred to must outlive the calls.
struct SparsifySetting {
  Registry& registry;
  Stop stop = {};  ///< of the optimisations; its interrupt ends everything early
  std::shared_ptr<const Loss> loss = nullptr;  ///< shared: graphs and their clones use one loss
  FactorSelector loss_on = {};
  /// Computes the initial estimate of a whole graph, and returns notes; empty: as it is.
  std::function<std::vector<std::string>(Graph&)> initialise = {};
  SparsificationObserver observer = {};  ///< gets every problem; may be empty
  Observer* optimisation = nullptr;      ///< follows the optimisations; may be null
  std::function<void(const SparsifyProgress&)> progress = {};

  bool interrupted() const { return stop.interrupt && stop.interrupt->load(); }
};

/// Optimises a whole graph, takes nodes out of it, optimises what is left, and measures what was
/// lost. Every free pose may leave but the newest, and every free landmark, as far as `job.nodes`
/// has them. Throws `Error` for names and options that there are not.
CAIRN_API SparsifyResult sparsify_whole(const Graph& graph, const SparsifyJob& job,
                                        const SparsifySetting& setting);

/// Feeds a recorded graph to an estimator pose by pose, and takes nodes out after every
/// `job.online` poses. Factors that arrive for nodes that have left are redirected to others, or
/// dropped (Vallvé 2018, section 4.6.4); so poses alone may leave. Throws `Error` (usage) for
/// another `job.nodes`.
CAIRN_API SparsifyResult sparsify_online(const Graph& recording, const SparsifyJob& job,
                                         const SparsifySetting& setting);

}  // namespace cairn
