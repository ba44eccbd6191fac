// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <memory>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "cairn/exploration/explorer.hpp"
#include "cairn/exploration/random_stream.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "frontier_goals.hpp"

namespace cairn::exploration {
namespace {

struct FrontierOptions {
  double length = 0.9, smallest = 0.0, keep = 0.7;
  std::string planner = "grid_dijkstra";

  static auto fields() {
    using O = FrontierOptions;
    return OptionFields<O>()
        .real("length", &O::length, 0.0, 1000.0,
              "frontiers shorter than this count only when there are no longer ones, half as long "
              "at a time [m]")
        .real("smallest", &O::smallest, 0.0, 1000.0,
              "shorter ones are left unexplored [m]; 0: shorter than the robot is wide")
        .real("keep", &O::keep, 0.0, 1.0,
              "the frontier that it was on the way to counts as nearer, by this factor")
        .component<PathPlanner>("planner", &O::planner, "finds the paths");
  }
};

/// The middle of a frontier moves by less while it is seen better [m].
constexpr double kSameGoal = 1.0;

/// The sentence with which a run without any frontier left ends.
std::string end_text(const FrontierGoals& goals, double smallest) {
  if (goals.unreachable() == 0)
    return fmt::format("no frontier of {:g} m or more is left", smallest);
  return fmt::format(
      "no frontier of {:g} m or more is left that can be reached; {} without a path, "
      "the longest {:.1f} m",
      smallest, goals.unreachable(), goals.longest_unreachable());
}

/// Drives to frontiers; which of them, the derived class decides.
class FrontierExplorer : public Explorer {
 public:
  FrontierExplorer(const FrontierOptions& options, Registry& registry)
      : options_(options), goals_(registry.make<PathPlanner>(options.planner)) {}

  void begin(std::uint64_t) override {
    goals_.begin();
    goal_.reset();
  }

  Decision decide(const Situation& situation) override {
    Decision decision;
    const double smallest =
        options_.smallest > 0.0 ? options_.smallest : 2.0 * situation.robot.radius;
    double least = 0.0;
    for (const bool tight : {false, true}) {
      goals_.start(situation, tight);
      for (least = std::max(options_.length, smallest);; least = std::max(0.5 * least, smallest)) {
        decision.candidates = goals_.candidates(least);
        if (!decision.candidates.empty() || least <= smallest) break;
      }
      if (!decision.candidates.empty()) break;
    }
    if (decision.candidates.empty()) {
      decision.kind = Decision::Kind::finished;
      decision.why = end_text(goals_, smallest);
      return decision;
    }
    for (Candidate& candidate : decision.candidates) {
      if (goal_ && (*candidate.path.look_at - *goal_).norm() < kSameGoal)
        candidate.value *= options_.keep;
    }
    decision.chosen = choose(decision.candidates);
    const Candidate& chosen = decision.candidates[decision.chosen];
    goal_ = chosen.path.look_at;
    decision.why = fmt::format("to {}, {:.1f} m away, of {} of at least {:.2g} m", chosen.what,
                               chosen.path.length, decision.candidates.size(), least);
    return decision;
  }

  bool is_worthwhile(const Situation& situation, const PlannedPath& path) override {
    return !path.look_at || FrontierGoals::is_there(situation.map, *path.look_at);
  }

 private:
  virtual std::size_t choose(const std::vector<Candidate>& candidates) = 0;

  FrontierOptions options_;
  FrontierGoals goals_;
  std::optional<Eigen::Vector2d> goal_;  ///< of the last decision [m]
};

/// The nearest one by the length of the path.
class NearestFrontier final : public FrontierExplorer {
 public:
  using FrontierExplorer::FrontierExplorer;

 private:
  std::size_t choose(const std::vector<Candidate>& candidates) override {
    const auto nearest = std::ranges::min_element(candidates, {}, &Candidate::value);
    return static_cast<std::size_t>(nearest - candidates.begin());
  }
};

class RandomFrontier final : public FrontierExplorer {
 public:
  using FrontierExplorer::FrontierExplorer;
  void begin(std::uint64_t seed) override {
    FrontierExplorer::begin(seed);
    random_.emplace(seed, RandomStream::Purpose::explorer);
  }

 private:
  std::size_t choose(const std::vector<Candidate>& candidates) override {
    return random_->below(candidates.size());
  }

  std::optional<RandomStream> random_;
};

}  // namespace
}  // namespace cairn::exploration

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::exploration;
  registrar.add<Explorer, FrontierOptions>(
      "frontier", [](const FrontierOptions& options, Registry& registry) {
        return std::make_unique<NearestFrontier>(options, registry);
      });
  registrar.add<Explorer, FrontierOptions>(
      "random", [](const FrontierOptions& options, Registry& registry) {
        return std::make_unique<RandomFrontier>(options, registry);
      });
}
