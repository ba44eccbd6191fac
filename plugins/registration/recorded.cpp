// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/geometry/pose_chain.hpp"
#include "recorded_links.hpp"
#include "registrations.hpp"

namespace cairn::registration {
namespace {

/// Answers with what was recorded: all relative factors between the two poses, as they stand. For
/// poses that follow each other that is their odometry; whoever has it already must not ask.
///
/// A false match is one factor instead of them, with the type and weight of the first: any motion
/// that is no longer and turns no further than what the recording's loop closures measured (its
/// odometry, if it has none).
class Recorded final : public Registration, public FalseMatches {
 public:
  Recorded(double false_rate, std::uint64_t seed) : false_rate_(false_rate), seed_(seed) {}

  void begin(const RegistrationData& data) override {
    const RecordedLinks links = recorded_links(data, "recorded");
    recording_ = data.recording;
    factors_.clear();
    for (const int f : links.all) {
      const auto variables = recording_->factor_variables(f);
      factors_[pair_of(recording_->id(variables[0]), recording_->id(variables[1]))].push_back(f);
    }
    if (false_rate_ == 0.0 || links.all.empty()) return;
    motions_.emplace(links.pose);
    extent_ = largest_extent(*recording_, links, *motions_);
  }

  std::vector<Factor> match(Id earlier, Id later) override {
    if (!recording_) throw std::logic_error("registration recorded: match before begin");
    const auto found = factors_.find(pair_of(earlier, later));
    if (found == factors_.end()) return {};
    PairRandom random(seed_, earlier, later);
    std::vector<Factor> answer;
    for (const int f : found->second) answer.push_back(recording_->factor(f));
    if (random.chance(false_rate_)) {
      answer.resize(1);
      answer.front().measurement = motions_->draw(extent_, random);
    }
    return answer;
  }

  bool was_false(Id earlier, Id later) const override {
    return factors_.contains(pair_of(earlier, later)) &&
           PairRandom(seed_, earlier, later).chance(false_rate_);
  }

  void* ability(std::string_view name) override {
    return name == FalseMatches::kAbility ? static_cast<FalseMatches*>(this) : nullptr;
  }

 private:
  using Pair = std::pair<Id, Id>;
  static Pair pair_of(Id a, Id b) { return std::minmax(a, b); }

  double false_rate_;
  std::uint64_t seed_;
  const Graph* recording_ = nullptr;
  std::map<Pair, std::vector<int>> factors_;
  std::optional<RigidMotions> motions_;  ///< for false matches, if there are any
  Extent extent_;                        ///< of false matches
};

}  // namespace

std::unique_ptr<Registration> make_recorded(const RecordedOptions& options) {
  return std::make_unique<Recorded>(options.false_rate, options.seed);
}

}  // namespace cairn::registration
