// SPDX-License-Identifier: BSD-3-Clause
// Explorers that grow a tree of paths and drive along that which lowers the joint entropy of
// trajectory and map most per metre (thesis, 5.4).
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/exploration/explorer.hpp"
#include "cairn/exploration/random_stream.hpp"
#include "cairn/planning/free_space.hpp"
#include "cairn/planning/path_value.hpp"
#include "cairn/planning/rrt_star.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/timed.hpp"
#include "discovery.hpp"

namespace cairn::exploration {
namespace {

using Eigen::Vector2d;

struct TreeExplorerOptions {
  double density = 5.0, step = 0.5, reach = 1.0;
  double least_gain = 0.0, replan = 0.9;
  int revisits = 3;
  std::string fallback = "frontier";
  PathValueOptions value = {};

  static auto fields() {
    using O = TreeExplorerOptions;
    return OptionFields<O>()
        .real("density", &O::density, 0.01, 10000.0, "nodes of the tree per m² of free floor")
        .real("step", &O::step, 0.01, 100.0, "by which the tree grows towards a sample at most [m]")
        .real("reach", &O::reach, 0.01, 1000.0,
              "largest distance of nodes that are joined [m], at least the step")
        .part(&O::value)
        .real("least_gain", &O::least_gain, 0.0, 1e9,
              "a path counts only if it lowers the entropy by more than this [nats/m]")
        .real("replan", &O::replan, 0.0, 1.0,
              "decides anew when this part of the cells is known that the path was expected to "
              "discover; 1 and paths with loop closures: at its end")
        .integer("revisits", &O::revisits, 0, 1000000,
                 "so many paths in a row may bring hardly any floor; then the fallback decides, "
                 "until more is found; 0: any number, as in the thesis")
        .text("fallback", &O::fallback,
              "explorer that decides where no path counts, frontier:length=2 for instance; none: "
              "the run ends there");
  }
};

/// A tree whose nodes are joined by what whole paths are worth takes time with the square of this
/// distance.
struct ErrtStarOptions {
  TreeExplorerOptions tree = {.reach = 0.5};

  static auto fields() { return OptionFields<ErrtStarOptions>().part(&ErrtStarOptions::tree); }
};

/// Part of the time budget of a decision for the growth of a tree whose paths are evaluated
/// afterwards, and for both.
constexpr double kGrowthPart = 0.3, kTreePart = 0.8;
/// And the least that is left for it.
constexpr double kLeastPart = 0.2;
/// Paths of a tree that are evaluated exactly at least, the best ones by their estimates.
constexpr std::size_t kEvaluated = 32;
/// Paths that bring no more than this, or no more than this part of what is known, have only closed
/// loops [m²].
constexpr double kLittleFloor = 0.5, kLittlePart = 0.01;
/// Further candidates that a decision lists, and how far their ends are apart [m].
constexpr std::size_t kListed = 10;
constexpr double kApart = 1.0;

/// A tree of paths, evaluated.
struct Search {
  std::vector<Vector2d> points;
  std::vector<int> parents;
  std::vector<std::optional<PathValue::State>> values;  ///< none: not evaluated in time
  bool complete = true;                                 ///< not cut short by the clock

  std::vector<std::size_t> path(std::size_t node) const {
    std::vector<std::size_t> nodes{node};
    while (parents[nodes.back()] >= 0)
      nodes.push_back(static_cast<std::size_t>(parents[nodes.back()]));
    std::ranges::reverse(nodes);
    return nodes;
  }
};

template <class Cost>
Search nodes_of(const RrtStar<Cost>& tree) {
  Search search;
  for (const auto& node : tree.nodes()) {
    search.points.push_back(node.point);
    search.parents.push_back(node.parent);
  }
  return search;
}

/// Drives along the best path of a tree.
class TreeExplorer : public Explorer {
 public:
  TreeExplorer(const TreeExplorerOptions& options, Registry& registry) : options_(options) {
    if (options.fallback != "none")
      fallback_ = registry.make<Explorer>(parse_component(options.fallback));
  }

  void begin(std::uint64_t seed) override {
    random_.emplace(seed, RandomStream::Purpose::explorer);
    discovery_ = {};
    by_fallback_ = false;
    revisits_ = 0;
    covered_ = 0.0;
    if (fallback_) fallback_->begin(seed);
  }

  Decision decide(const Situation& situation) override {
    const auto begin = std::chrono::steady_clock::now();
    Decision decision;
    by_fallback_ = false;
    const FreeSpace space(situation.map, situation.pose.translation(), situation.robot.radius);
    if (space.empty()) return otherwise(situation, "the robot does not fit where it is", {});
    if (fallback_ && options_.revisits > 0) {
      const std::string why = why_done(situation);
      if (!why.empty()) return otherwise(situation, why, {});
    }
    const std::vector<Vector2d> left_out =
        discovery_.not_found(situation, options_.value.simulated_range);
    PathValue value(situation, options_.value, left_out);
    // What came before is part of the time, but there must be a tree.
    const double left =
        std::max(situation.budget - seconds_since(begin), kLeastPart * situation.budget);
    Search search = grow(space, value, left, situation.interrupt);
    if (situation.interrupted()) return decision;
    const std::vector<std::size_t> best = best_nodes(search, value, situation);
    if (situation.interrupted()) return decision;
    add_tree(search, decision);
    if (!search.complete) decision.notes.emplace_back("trees were cut short by the time budget");
    for (const std::size_t node : best)
      decision.candidates.push_back(candidate(search, node, situation));
    if (best.empty() || !(search.values[best.front()]->value < -options_.least_gain)) {
      const double least = best.empty() ? 0.0 : search.values[best.front()]->value;
      return otherwise(
          situation,
          fmt::format(
              "none of {} paths lowers the entropy{} (the best: {:+.2g} "
              "nats/m)",
              search.points.size() - 1,
              options_.least_gain > 0.0 ? fmt::format(" by {:g} nats/m", options_.least_gain) : "",
              least),
          std::move(decision));
    }
    const PathValue::State& chosen = *search.values[best.front()];
    discovery_.expect(value.seen_cells().middles(*chosen.seen),
                      chosen.information.loops() > 0 ? 2.0 : options_.replan);
    decision.why = fmt::format(
        "{}, {:+.2g} nats/m: trajectory {:+.2g} nats, map {:+.3g} nats·m² by {:.2g}; the best of "
        "{} paths",
        decision.candidates.front().what, chosen.value, chosen.change.trajectory, chosen.change.map,
        chosen.change.alpha, search.points.size() - 1);
    return decision;
  }

  bool is_worthwhile(const Situation& situation, const PlannedPath& path) override {
    discovery_.drive(situation.pose);
    if (by_fallback_) return fallback_->is_worthwhile(situation, path);
    return !discovery_.is_done(situation.map);
  }

 protected:
  virtual Search grow(const FreeSpace& space, PathValue& value, double budget,
                      const std::atomic<bool>* interrupt) = 0;

  RrtStarOptions tree_options() const { return {.step = options_.step, .reach = options_.reach}; }

  TreeExplorerOptions options_;
  std::optional<RandomStream> random_;

 private:
  static void add_tree(const Search& search, Decision& decision) {
    for (std::size_t k = 0; k < search.points.size(); ++k) {
      const auto& value = search.values[k];
      const double theta = value ? value->information.pose().theta() : 0.0;
      decision.tree.push_back({.pose = Pose2(search.points[k].x(), search.points[k].y(), theta),
                               .parent = search.parents[k],
                               .value = value ? value->value : 0.0});
    }
  }

  /// The best one and further ones of which each ends away from the others, best first, with their
  /// exact values. Of all paths those may be better that are estimated to be worse than these.
  static std::vector<std::size_t> best_nodes(Search& search, const PathValue& value,
                                             const Situation& situation) {
    const auto value_of = [&](std::size_t k) { return search.values[k]->value; };
    std::vector<std::size_t> nodes;
    for (std::size_t k = 1; k < search.points.size(); ++k) {
      if (search.values[k] && search.values[k]->information.steps() > 0) nodes.push_back(k);
    }
    std::ranges::stable_sort(nodes, {}, value_of);
    double least = std::numeric_limits<double>::infinity();
    std::size_t count = 0;
    for (; count < nodes.size() && !situation.interrupted(); ++count) {
      std::optional<PathValue::State>& state = search.values[nodes[count]];
      if (count >= kEvaluated && !(state->value < least)) break;
      state = value.evaluated(*std::move(state));
      least = std::min(least, state->value);
    }
    std::ranges::stable_sort(nodes.begin(), nodes.begin() + static_cast<std::ptrdiff_t>(count), {},
                             value_of);
    std::vector<std::size_t> listed;
    for (const std::size_t node : nodes) {
      const bool apart = std::ranges::all_of(listed, [&](std::size_t other) {
        return (search.points[node] - search.points[other]).norm() > kApart;
      });
      if (!apart) continue;
      std::optional<PathValue::State>& state = search.values[node];
      if (!state->is_exact) state = value.evaluated(*std::move(state));
      listed.push_back(node);
      if (listed.size() > kListed) break;
    }
    // Those behind the best were in the order of their estimates.
    std::ranges::stable_sort(listed, {}, value_of);
    return listed;
  }

  static Candidate candidate(const Search& search, std::size_t node, const Situation& situation) {
    const PathValue::State& state = *search.values[node];
    Candidate candidate;
    for (const std::size_t k : search.path(node)) candidate.path.points.push_back(search.points[k]);
    candidate.path.length = state.information.length();
    candidate.value = state.value;
    candidate.change = state.change;
    const double area = static_cast<double>(state.cells) * situation.map.frame.cell_area();
    const int loops = state.information.loops();
    candidate.what = fmt::format("{:.1f} m to {:.1f} m² of floor and {} loop closure{}",
                                 candidate.path.length, area, loops, loops == 1 ? "" : "s");
    return candidate;
  }

  static bool has_wide_frontier(const Situation& situation) {
    const std::vector<Frontier>& frontiers = situation.map.frontiers;  // longest first
    return !frontiers.empty() && frontiers.front().length >= 2.0 * situation.robot.radius;
  }

  /// Why the fallback decides, whatever paths are worth: there is always more to know about a
  /// trajectory, and through the gaps of a ragged wall floor is expected that is none. Else empty.
  std::string why_done(const Situation& situation) {
    if (!has_wide_frontier(situation)) return "no frontier is as wide as the body";
    const double coverage = situation.map.coverage();
    if (coverage > covered_ + std::max(kLittleFloor, kLittlePart * covered_)) {
      covered_ = coverage;
      revisits_ = 0;
    } else if (++revisits_ > options_.revisits) {
      return fmt::format("{} paths in a row brought hardly any floor", options_.revisits);
    }
    return {};
  }

  /// What is decided where no path counts.
  Decision otherwise(const Situation& situation, const std::string& why, Decision searched) {
    discovery_.expect({}, 2.0);
    const std::vector<Frontier>& frontiers = situation.map.frontiers;
    if (!fallback_) {
      searched.kind =
          has_wide_frontier(situation) ? Decision::Kind::stuck : Decision::Kind::finished;
      searched.why = fmt::format("{}; {} frontiers are left", why, frontiers.size());
      if (!frontiers.empty())
        searched.why += fmt::format(", the longest of {:.1f} m", frontiers.front().length);
      return searched;
    }
    by_fallback_ = true;
    Decision decision = fallback_->decide(situation);
    decision.why = fmt::format("{}; {}: {}", why, options_.fallback, decision.why);
    decision.tree = std::move(searched.tree);
    decision.notes.insert(decision.notes.end(), searched.notes.begin(), searched.notes.end());
    return decision;
  }

  std::unique_ptr<Explorer> fallback_;
  Discovery discovery_;
  bool by_fallback_ = false;  ///< the last decision
  int revisits_ = 0;          ///< decisions in a row since floor was discovered
  double covered_ = 0.0;      ///< of the map then [m²]
};

/// A tree of short paths, each of which is evaluated when it is grown.
class DrrtStar final : public TreeExplorer {
 public:
  using TreeExplorer::TreeExplorer;

 private:
  Search grow(const FreeSpace& space, PathValue& value, double budget,
              const std::atomic<bool>* interrupt) override {
    PathLength length;
    RrtStar<PathLength> tree(space, length, tree_options());
    const bool grown = tree.grow(*random_, options_.density, kGrowthPart * budget, interrupt);
    Search search = nodes_of(tree);
    search.values = path_values(tree, value, (kTreePart - kGrowthPart) * budget, interrupt);
    search.complete = grown && std::ranges::none_of(search.values, [](const auto& state) {
                        return !state.has_value();
                      });
    return search;
  }
};

/// A tree whose nodes are joined so that each path is worth most.
class ErrtStar final : public TreeExplorer {
 public:
  using TreeExplorer::TreeExplorer;

 private:
  Search grow(const FreeSpace& space, PathValue& value, double budget,
              const std::atomic<bool>* interrupt) override {
    RrtStar<PathValue> tree(space, value, tree_options());
    const bool grown = tree.grow(*random_, options_.density, kTreePart * budget, interrupt);
    if (interrupt && interrupt->load(std::memory_order_relaxed)) return {};
    Search search = nodes_of(tree);
    for (const auto& node : tree.nodes()) search.values.emplace_back(node.state);
    search.complete = grown;
    return search;
  }
};

}  // namespace
}  // namespace cairn::exploration

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::exploration;
  registrar.add<Explorer, TreeExplorerOptions>(
      "drrt_star", [](const TreeExplorerOptions& options, Registry& registry) {
        return std::make_unique<DrrtStar>(options, registry);
      });
  registrar.add<Explorer, ErrtStarOptions>(
      "errt_star", [](const ErrtStarOptions& options, Registry& registry) {
        return std::make_unique<ErrtStar>(options.tree, registry);
      });
}
