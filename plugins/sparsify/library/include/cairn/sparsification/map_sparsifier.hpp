// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <set>
#include <span>
#include <string>

#include "cairn/graph/graph.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/sparsification/selection.hpp"
#include "cairn/sparsification/sparsifier.hpp"
#include "cairn/update/pose_remover.hpp"

namespace cairn {

struct MapSparsifierOptions {
  std::string sparsifier = "sparsify";
  std::string selection = "nearest";
  bool savable = false;  ///< refuse a topology whose factors no format of graphs expresses

  static auto fields() {
    using O = MapSparsifierOptions;
    return OptionFields<O>()
        .component("sparsifier", &O::sparsifier, {"sparsifier"},
                   "what replaces poses that leave by factors")
        .component("selection", &O::selection, {"node_selection"},
                   "which poses leave where a number of them is kept")
        .boolean("savable", &O::savable,
                 "refuse a topology whose factors no format of graphs expresses");
  }
};

/// Throws `Error` (usage) where the topology that a sparsifier is given makes factors that no
/// format of graphs expresses.
CAIRN_API void expect_savable(const ComponentSpec& sparsifier, Registry& registry);

/// Removes poses from the map of an estimator while it grows: each pose is marginalised, and the
/// dense Gaussian that this leaves on its neighbours is replaced by a few relative factors, as by
/// `cairn sparsify`. Unlike the prior of `GraphUpdate::marginalized` these are ordinary factors:
/// they are relinearised with all others, and can be changed, removed and written to files. So an
/// estimator can keep a fixed number of poses for any length of time, in constant memory:
///
///     MapSparsifier sparsifier(registry);
///     for (;;) {
///       GraphUpdate update;
///       update.add<Pose2>(k);
///       update.add(Between(k - 1, k, odometry), information);
///       sparsifier.make_room(*estimator, 100, update).add_to(update);
///       estimator->update(update);
///     }
///
/// The information matrices of the new factors minimise the divergence ½ (tr Λ̆Σ − ln |Λ̆Σ| − r) of
/// each Markov blanket (T 4.2); where the blanket has two nodes nothing is lost. They are computed
/// at the estimate, which should be near its minimum: remove poses after an update that was solved.
/// A factor under a robust loss counts with the weight that it has there; the new ones have no
/// loss, whatever the estimator's rule says of factors that arrive.
///
/// A removal takes time in proportion to the number of variables and factors of the map, besides
/// that of the local problem: it is meant for maps of bounded size.
class CAIRN_API MapSparsifier final : public PoseRemover {
 public:
  /// Which poses leave where a number of poses is kept: `nearest`, see docs/sparsify.md.
  static constexpr const char* kDefaultSelection = "nearest";

  /// The components of these names; they are made when they are first needed. `registry` must
  /// outlive this object.
  explicit MapSparsifier(Registry& registry, ComponentSpec sparsifier = {"sparsify", {}},
                         ComponentSpec selection = {kDefaultSelection, {}});
  ~MapSparsifier() override;

  /// Makes the components now. Throws `Error` for names and options that there are not.
  void prepare();

  /// Throws `Error` (input) if a pose is not there, is named twice, or cannot be removed: it is
  /// fixed, has a neighbour that is neither a pose of its kind nor a landmark, or has landmarks as
  /// its only neighbours; or the graph has no factor of a type that the new ones need. A landmark
  /// may be removed as well.
  Removal remove(Estimator& estimator, std::span<const Id> poses) override;
  /// The selection chooses from all poses but those that are fixed or anchored, the newest one, and
  /// those of the factors of `coming`. Variables that are not poses of a Lie group do not count.
  Removal make_room(Estimator& estimator, int limit, const GraphUpdate& coming) override;

 private:
  Removal removal_of(const Sparsification& change, const Graph& graph, Estimator& estimator);

  Registry& registry_;
  ComponentSpec sparsifier_spec_, selection_spec_;
  std::unique_ptr<Sparsifier> sparsifier_;
  std::unique_ptr<NodeSelection> selection_;
  std::set<std::string> said_;  ///< notes of the sparsifier that a removal has had
};

}  // namespace cairn
