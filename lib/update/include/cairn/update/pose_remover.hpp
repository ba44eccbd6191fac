// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/graph/update.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/solve/estimator.hpp"

namespace cairn {

/// Removes poses from the map of an estimator and keeps their information in factors that can be
/// relinearised, changed and written (the command SPARSIFY). `MapSparsifier`
/// (cairn/sparsification/map_sparsifier.hpp) is the one there is, by the name of `sparsify`.
class CAIRN_API PoseRemover : public Component {
 public:
  static constexpr std::string_view kKind = "pose_remover";
  /// What a removal comes to. Nothing has changed yet.
  struct CAIRN_API Removal {
    GraphUpdate update;  ///< `removed_variables`: the poses; `factors`: what takes their place
    /// Divergence of the new factors from the dense result of marginalisation, summed over the
    /// Markov blankets [nats].
    double kld = 0.0;
    std::string note;  ///< why fewer poses leave than were asked for; empty: they do
    /// What else should be known. Each is said once by a remover, when it first applies.
    std::vector<std::string> notes{};

    bool empty() const { return update.empty(); }
    /// Makes it a part of another update: the new factors are the first of that.
    void add_to(GraphUpdate& other) const;
  };

  ~PoseRemover() override;

  /// All of `poses`, in this order. Throws `Error` (input) if one of them cannot be removed or is
  /// not there.
  virtual Removal remove(Estimator& estimator, std::span<const Id> poses) = 0;
  /// As many poses as there would be above `limit` with those of `coming`, but none on which
  /// `coming` has a factor. Where not so many can be removed, those that can be, with a note.
  virtual Removal make_room(Estimator& estimator, int limit, const GraphUpdate& coming) = 0;
};

/// The pose remover of that name and options, made by `registry`, which must outlive it, when it is
/// first used: a session that removes no pose loads no plugin for it.
CAIRN_API std::unique_ptr<PoseRemover> made_when_used(ComponentSpec spec, Registry& registry);

}  // namespace cairn
