// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "cairn/policy/pose_policy.hpp"
#include "compact_graph.hpp"
#include "compact_pose_options.hpp"
#include "consistency.hpp"
#include "triangulation.hpp"

namespace cairn::compact {

/// A landmark that is not in the graph, since nothing determines it so far, and what poses that
/// are kept measure of it.
struct WaitingLandmark {
  Variable landmark;
  std::vector<View> views;  ///< in the order of arrival; perhaps none
};

/// Where a landmark is by some of its views, of these numbers.
struct Triangulated {
  std::vector<std::size_t> chosen;
  Triangulation found;
};

/// Landmarks that no single measurement determines, such as those of which bearings are measured:
/// what was measured of them waits until several poses determine them together.
class WaitingLandmarks {
 public:
  WaitingLandmarks() = default;
  explicit WaitingLandmarks(const CompactPoseOptions& options)
      : several_views_(options.several_views),
        most_(options.waiting),
        trust_(options.trust),
        gate_{options.gate} {}

  /// By rising id.
  std::vector<Id> ids() const;
  /// The type of one; null: it does not wait.
  const VariableType* type(Id landmark) const;
  bool has_views(Id landmark) const;
  /// Whether what poses measure of a landmark may wait: not of one that has left the graph so often
  /// that it will again.
  bool may_wait(Id landmark) const;
  /// Whether something that this pose measured waits.
  bool has_views_from(Id pose) const;

  /// What the newest pose measures of a landmark, beside what waits.
  WaitingLandmark with_newest(const Variable& landmark, std::span<const Measured> factors,
                              const CompactGraph& graph) const;
  /// Where views of which the last is the newest pose's put their landmark, and which of them say
  /// so.
  std::optional<Triangulated> triangulate(const WaitingLandmark& waiting, CompactGraph& graph,
                                          PolicySeconds& seconds) const;
  /// Whether the views are consistent; with a gate, more of them than their landmark needs: any
  /// others are.
  bool agree(const Triangulated& some) const;

  /// A landmark that was seen, and nothing waits of it.
  void note(const Variable& landmark);
  /// One that has left the graph.
  void note_left(const Variable& landmark);
  /// Gives up what waits of the landmark that was not seen for longest, where more than so many
  /// wait; and of this one's views the oldest.
  void add(WaitingLandmark waiting, const CompactGraph& graph, PoseReport& report);
  /// What a pose that is kept measured of a landmark that waits.
  void add(Id landmark, const View& view, const CompactGraph& graph);
  /// It is in the graph now, or will be: what waited of it.
  std::vector<View> take(Id landmark);
  /// What poses that have left measured waits no more.
  void forget(std::span<const Id> poses, PoseReport& report);

 private:
  using Consensus = std::function<std::optional<Triangulated>(std::span<const std::size_t>)>;

  bool fits(const Triangulated& some) const;
  std::optional<Triangulated> consensus_of(std::span<const std::size_t> places,
                                           const Consensus& of) const;

  bool several_views_ = true;
  int most_ = 0;
  double trust_ = 0.0;
  Gate gate_;
  std::map<Id, WaitingLandmark> waiting_;
  std::unordered_map<Id, int> removals_;  ///< how often landmarks have left the graph
};

}  // namespace cairn::compact
